"""Line protocol: escaped as its rules ask, read back as the log, and kept while a server is away."""

from __future__ import annotations

import re
import socket
import threading
from http.server import BaseHTTPRequestHandler, HTTPServer
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rw_ekf as library
from rw_ekf.logs.reader import read_log
from rw_ekf.sinks.recorders.influx import TOKEN, point
from tests.live.virtual import run, setting
from tests.recorders.ticks import ALARM, recorder, turn


def test_names_and_texts_are_escaped_as_the_reference_has_it() -> None:
    """Lines of the reference's own examples: blanks and commas in names, quotes in texts, kinds of values."""
    stamp = 1556813561098000000
    assert point("my Measurement", {}, {"fieldKey": "string value"}, stamp) == (
        rb'my\ Measurement fieldKey="string value" 1556813561098000000' + b"\n"
    )
    assert point("myMeasurement", {"tag Key1": "tag Value1", "tag Key2": "tag Value2"}, {"fieldKey": 100}, stamp) == (
        rb"myMeasurement,tag\ Key1=tag\ Value1,tag\ Key2=tag\ Value2 fieldKey=100i 1556813561098000000" + b"\n"
    )
    assert point("m", {}, {"fieldKey": '"string" within a string'}, 1) == (
        rb'm fieldKey="\"string\" within a string" 1' + b"\n"
    )
    assert point("m,n", {"a=b": "c,d=e"}, {"f g": True, "h": -1e-9, "i": None}, 1) == (
        rb"m\,n,a\=b=c\,d\=e f\ g=true,h=-1e-09 1" + b"\n"
    )
    assert point("m", {"t": "two\nlines\\"}, {"f": "a\nb\\"}, 1) == rb'm,t=two\ lines f="a b\\" 1' + b"\n"
    assert point("m", {}, {"f": None}, 1) is None


def test_a_file_of_it_is_read_back_as_the_log(tmp_path: Path) -> None:
    """Columns equal to the last bit, a silence and a new segment included; so is every estimate of a replay."""
    happenings = ((20.0, setting(silent=True)), (24.0, setting(silent=False)))
    limits = {"silence_s": 1.5, "safe_after_s": None}
    ran, _ = run(
        tmp_path, 60.0, *happenings, output={"influx": "file"}, limits=limits, wheel={"name": "wheel 1, left=x"}
    )
    ours, log = read_log(ran.outcome.files.log.with_suffix(".lp")), ran.log
    for name in ("time_s", "speed_rad_s", "current_A", "command_delay_s", "segment"):
        assert np.array_equal(getattr(ours, name), getattr(log, name), equal_nan=True), name
    assert len(set(log.segment.tolist())) > 1
    text = ran.outcome.files.log.with_suffix(".lp").read_text()
    assert re.match(r"rw_ekf_event,wheel=wheel\\ 1\\,\\ left\\=x,run=\S+,event=ended ", text.splitlines()[-1])
    assert library.replay(ours).table.equals(library.replay(log).table)


def test_a_line_that_was_torn_off_is_left_out(tmp_path: Path) -> None:
    """Cut at 40 places within its last line: the points before it are read, with a warning."""
    sink, _ = recorder(tmp_path, "influx", "file")
    for i in range(10):
        sink.write(turn(i))
    path = tmp_path / "run.lp"
    whole = path.read_bytes()
    last = whole.rindex(b"rw_ekf_sample")
    rng = np.random.default_rng(1)
    for cut in rng.integers(last + 1, whole.index(b"\n", last), 40).tolist():
        path.write_bytes(whole[:cut])
        log = read_log(path)
        assert len(log) == 9
        assert any("torn off" in warning for warning in log.warnings)


class Server:
    """A server of InfluxDB that takes what is posted, while it is there."""

    def __init__(self, port: int = 0, status: int = 204, most_bytes: int = 1 << 30) -> None:
        taken: list[bytes] = []
        tokens: list[str | None] = []

        class Handler(BaseHTTPRequestHandler):
            def do_POST(self) -> None:
                body = self.rfile.read(int(self.headers["Content-Length"]))
                answer = 413 if len(body) > most_bytes else status
                if answer == 204:
                    taken.append(body)
                tokens.append(self.headers["Authorization"])
                self.send_response(answer)
                self.end_headers()

            def log_message(self, *arguments: Any) -> None:
                pass

        self.taken, self.tokens = taken, tokens
        self._server = HTTPServer(("127.0.0.1", port), Handler)
        self.port = self._server.server_address[1]
        self._thread = threading.Thread(target=self._server.serve_forever, args=(0.01,))
        self._thread.start()

    def stop(self) -> None:
        self._server.shutdown()
        self._server.server_close()
        self._thread.join()


def test_a_server_that_is_away_gets_everything_later(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Refused, then gone, then back: every sample once and in order, one line of warning an outage, nothing missed."""
    monkeypatch.setenv(TOKEN, "secret")
    server = Server(status=503)
    port = server.port
    sink, made = recorder(tmp_path, "influx", f"http://127.0.0.1:{port}/api/v2/write?org=o&bucket=b&precision=ns")
    for i in range(30):
        sink.write(turn(i))
        made.clock.sleep(0.1)
    assert server.tokens == ["Token secret"]
    server.stop()
    for i in range(30, 100):
        sink.write(turn(i))
        made.clock.sleep(0.1)
    server = Server(port)
    for i in range(100, 200):
        sink.write(turn(i, *([ALARM] if i > 150 else [])))
        made.clock.sleep(0.1)
    sink.close()
    server.stop()
    (tmp_path / "posted.lp").write_bytes(b"".join(server.taken))
    assert read_log(tmp_path / "posted.lp").time_s.tolist() == [turn(i).sample.time_s for i in range(200)]
    assert made.logger.events == ["influx_not_reached"]
    assert made.unwritten.not_sent == {}
    assert not made.unwritten


@pytest.mark.parametrize(("status", "waits"), [(401, True), (403, True), (400, False), (422, False)])
def test_a_server_that_refuses_is_told_from_one_that_is_away(tmp_path: Path, status: int, waits: bool) -> None:
    """Without a token rows wait for one, which is named; rows that are never taken are given up, and counted."""
    server = Server(status=status)
    sink, made = recorder(tmp_path, "influx", f"http://127.0.0.1:{server.port}/write")
    for i in range(120):
        sink.write(turn(i))
        made.clock.sleep(0.1)
    lost = made.unwritten.not_sent.get("influx", 0)
    server.stop()
    sink.close()
    assert made.logger.events.count("influx_refused") == 1
    assert (lost == 0) is waits
    assert made.unwritten.not_sent["influx"] == 121  # and the word that the run has ended


def test_what_waited_goes_in_parts_that_the_server_takes_and_another_trouble_is_said(tmp_path: Path) -> None:
    """Away, then without a token, then there for 4 kB at a time: each is said once, and every sample arrives."""
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    sink, made = recorder(tmp_path, "influx", f"http://127.0.0.1:{port}/write")

    def turns(first: int, last: int) -> None:
        for i in range(first, last):
            sink.write(turn(i))
            made.clock.sleep(0.1)

    turns(0, 100)
    server = Server(port, status=401)
    turns(100, 200)
    server.stop()
    server = Server(port, most_bytes=4096)
    turns(200, 600)
    sink.close()
    server.stop()
    assert made.logger.events == ["influx_not_reached", "influx_refused"]
    (tmp_path / "posted.lp").write_bytes(b"".join(server.taken))
    assert read_log(tmp_path / "posted.lp").time_s.tolist() == [turn(i).sample.time_s for i in range(600)]
    assert made.unwritten.not_sent == {}


def test_what_nobody_took_is_counted_and_no_fault_of_the_run(tmp_path: Path) -> None:
    """Nobody listens to the end: every tick is counted, the oldest at once, and the run is not called unwritten."""
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    sink, made = recorder(tmp_path, "influx", f"http://127.0.0.1:{port}/write")
    for i in range(3200):
        sink.write(turn(i))
    assert made.unwritten.not_sent == {"influx": 200}
    sink.close()
    assert made.unwritten.not_sent == {"influx": 3201}  # and the word that the run has ended
    assert not made.unwritten
    assert made.logger.events.count("not_recorded") == 1


def test_datagrams_hold_whole_lines(tmp_path: Path) -> None:
    """Over UDP every datagram is of whole points, none larger than what goes through a network in one piece."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as listener:
        listener.bind(("127.0.0.1", 0))
        listener.settimeout(10.0)
        sink, _ = recorder(tmp_path, "influx", f"udp://127.0.0.1:{listener.getsockname()[1]}")
        received = []
        for i in range(20):
            sink.write(turn(i))
            received.append(listener.recv(65536))
        sink.close()
    assert all(len(datagram) <= 1400 and datagram.endswith(b"\n") for datagram in received)
    (tmp_path / "received.lp").write_bytes(b"".join(received))
    assert read_log(tmp_path / "received.lp").speed_rad_s.tolist() == [1.5] * 20


@pytest.mark.slow
def test_a_server_that_hangs_leaves_the_run_and_its_log_alone(tmp_path: Path) -> None:
    """It takes connections and never answers: every row is in the log, and the run ends as it would have."""
    with socket.create_server(("127.0.0.1", 0)) as silent:
        place = f"http://127.0.0.1:{silent.getsockname()[1]}/write"
        ran, _ = run(tmp_path, 600.0, output={"influx": place})
    assert len(ran.log) == 1201
    assert not ran.outcome.unwritten
    assert ran.outcome.unwritten.not_sent["influx"] > 0
    assert ran.notes.events.count("not_recorded") == 1
