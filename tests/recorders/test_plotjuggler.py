"""JSON over UDP for PlotJuggler, and the layout that draws it."""

from __future__ import annotations

import json
import socket
import threading
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest

import rw_ekf
from rw_ekf.settings.resources import config_directory
from tests.recorders.ticks import ALARM, recorder, turn, until


def curves(value: Any, path: str = "") -> dict[str, float]:
    """Numbers by their path, as PlotJuggler names them."""
    if isinstance(value, dict):
        return {name: v for key, inner in value.items() for name, v in curves(inner, f"{path}/{key}").items()}
    return {path: float(value)}


def test_the_layout_draws_what_is_sent(tmp_path: Path) -> None:
    """Each sample is one object of numbers with a timestamp in seconds; every curve of the layout is in it."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as listener:
        listener.bind(("127.0.0.1", 0))
        listener.settimeout(10.0)
        sink, made = recorder(tmp_path, "plotjuggler", f"127.0.0.1:{listener.getsockname()[1]}")
        sent = []
        for i in range(5):
            sink.write(turn(i, ALARM))
            sent.append(curves(json.loads(listener.recv(65536))))
            made.clock.sleep(0.1)
        sink.close()
    assert [round(one["/timestamp"] - sent[0]["/timestamp"], 6) for one in sent] == [0.0, 0.1, 0.2, 0.3, 0.4]
    assert sent[4]["/rw_ekf/estimate/speed_rad_s"] == 0.2
    layout = ElementTree.parse(config_directory() / "plotjuggler-layout.xml").getroot()
    drawn = [curve.attrib["name"] for curve in layout.iter("curve")]
    assert len(drawn) > 10
    assert set(drawn) <= set(sent[4])
    for splitter in layout.iter("DockSplitter"):
        assert int(splitter.attrib["count"]) == len(splitter) == len(splitter.attrib["sizes"].split(";"))


@pytest.mark.parametrize("within", ["rw_ekf", ""])
def test_a_capture_is_read_as_the_log_that_it_was_sent_beside(tmp_path: Path, within: str) -> None:
    """The samples of what was sent, a line each, under their own names; nothing of the estimates is among them.

    So is what a broker was sent, which stands one level higher.
    """
    path = tmp_path / "capture.jsonl"
    held = {"current_command_A": 0.2, "command_delay_s": 0.012}
    samples = [{"time_s": 0.1 * i, "speed_rad_s": 5.0 + i, "segment": i // 20, **held} for i in range(40)]
    reported = [{"sample": sample, "estimate": {"time_s": 0.0, "speed_rad_s": -1.0}} for sample in samples]
    path.write_text(
        "".join(json.dumps({"timestamp": 1.8e9, within: one} if within else one) + "\n" for one in reported)
    )
    log = rw_ekf.read(path)
    assert log.speed_rad_s.tolist() == [sample["speed_rad_s"] for sample in samples]
    assert log.command_delay_s.tolist() == [0.012] * 40
    assert len(set(log.segment.tolist())) == 2


def test_nobody_who_listens_is_no_fault(tmp_path: Path) -> None:
    """Nobody has the port: nothing is raised, nothing counted."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        place = f"127.0.0.1:{free.getsockname()[1]}"
    sink, made = recorder(tmp_path, "plotjuggler", place)
    for i in range(50):
        sink.write(turn(i))
    sink.close()
    assert not made.unwritten


def test_what_the_system_does_not_take_is_counted_and_no_fault_of_the_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Datagrams longer than any can be, as where there is no network: counted, said once, nothing raised."""
    sink, made = recorder(tmp_path, "plotjuggler", "127.0.0.1:9")
    monkeypatch.setattr("rw_ekf.sinks.recorders.plotjuggler.json.dumps", lambda *a, **k: "x" * 100_000)
    for i in range(5):
        sink.write(turn(i))
    sink.close()
    assert made.unwritten.not_sent == {"plotjuggler": 5}
    assert made.logger.events == ["not_recorded"]
    assert not made.unwritten


@pytest.mark.parametrize(("name", "scheme"), [("plotjuggler", ""), ("influx", "udp://")])
def test_a_name_that_nobody_knows_at_this_moment_is_looked_up_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, scheme: str
) -> None:
    """As at boot, of both that send datagrams: what is missed is counted, the waiting said once, the rest is sent."""
    monkeypatch.setattr("rw_ekf.sinks.recorders.late_place._TRY_EVERY_S", 0.01)
    look_up, tried, up = socket.getaddrinfo, [], threading.Event()

    def getaddrinfo(host: str, *more: Any, **options: Any) -> Any:
        tried.append(host)
        if not up.is_set():
            raise socket.gaierror(socket.EAI_AGAIN, "Temporary failure in name resolution")
        return look_up("127.0.0.1", *more, **options)

    monkeypatch.setattr(socket, "getaddrinfo", getaddrinfo)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as listener:
        listener.bind(("127.0.0.1", 0))
        listener.settimeout(10.0)
        sink, made = recorder(tmp_path, name, f"{scheme}ground.example:{listener.getsockname()[1]}")
        for i in range(3):
            sink.write(turn(i))
        until(lambda: len(tried) > 3)
        assert made.logger.events == ["recorder_waits", "not_recorded"]
        up.set()
        way = sink._datagrams._way if name == "plotjuggler" else sink._target._datagrams._way
        until(lambda: way.had)
        sink.write(turn(3))
        assert listener.recv(65536)
        sink.close()
    assert made.unwritten.not_sent == {name: 3}
    assert not made.unwritten
    assert made.logger.events == ["recorder_waits", "not_recorded"]


def test_a_name_that_is_none_is_bad_input(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """One sentence with the key, whatever name server this machine has."""
    from rw_ekf.errors import BadInputError

    def getaddrinfo(*given: Any, **options: Any) -> Any:
        raise socket.gaierror(socket.EAI_NONAME, "Name or service not known")

    monkeypatch.setattr(socket, "getaddrinfo", getaddrinfo)
    with pytest.raises(BadInputError, match=r"output\.plotjuggler: no\.such\.place\.invalid:9870 is no place"):
        recorder(tmp_path, "plotjuggler", "no.such.place.invalid:9870")
