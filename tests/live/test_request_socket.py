"""The request socket: one client, whatever it sends and however it behaves; the file from start to end."""

from __future__ import annotations

import contextlib
import itertools
import json
import os
import socket
import stat
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from rw_ekf.clock import VirtualClock
from rw_ekf.errors import BadInputError
from rw_ekf.live import request_socket
from rw_ekf.live.request_lines import LineBuffer
from rw_ekf.live.request_socket import RequestSocket, RequestTerms
from rw_ekf.records import IssuedCommand, Tick
from tests.control.compensation.turns import turn

INERTIA = 2.0e-3
TURNS = 200


class Rig:
    """A socket in this process on a virtual clock, and its turns."""

    def __init__(self, directory: Path) -> None:
        self.path = directory / "request.sock"
        self.clock = VirtualClock()
        self.stated: list[str] = []
        self.socket = RequestSocket(
            self.path, RequestTerms(INERTIA, 0.5, 1.0), self.clock, lambda event, **_: self.stated.append(event)
        )
        self.socket.most_Nm = 1.0
        self.taken_bytes: list[int] = []  # of a turn, piece by piece
        self.most_pieces = self.most_bytes = 0  # that one turn took: what its time is in proportion to
        self.clients: list[socket.socket] = []

    def client(self) -> socket.socket:
        """Someone who connects."""
        made = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        made.settimeout(10.0)
        made.connect(str(self.path))
        self.clients.append(made)
        return made

    def end(self) -> None:
        """Nothing is left open."""
        self.socket.close()
        for client in self.clients:
            client.close()

    def turn(self) -> float:
        """One turn of the loop; the acceleration that is asked for."""
        tick = turn(self.clock.monotonic())
        self.taken_bytes.clear()
        wanted = self.socket.request_rad_s2(tick)
        self.socket.write(Tick(tick.sample, tick.estimate, IssuedCommand(0.02), state=tick.state))
        self.most_pieces = max(self.most_pieces, len(self.taken_bytes))
        self.most_bytes = max(self.most_bytes, sum(self.taken_bytes))
        self.clock.sleep(0.1)
        return wanted


@pytest.fixture
def rig(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Rig]:
    """A rig whose socket is closed behind the test."""
    made = Rig(tmp_path)
    take = LineBuffer.take

    def counted(buffer: LineBuffer, chunk: bytes) -> list[bytes]:
        made.taken_bytes.append(len(chunk))
        return take(buffer, chunk)

    monkeypatch.setattr(LineBuffer, "take", counted)
    yield made
    made.end()


def lines(client: socket.socket) -> list[dict[str, Any]]:
    """Whole lines that have come."""
    text = b""
    client.setblocking(False)
    with contextlib.suppress(BlockingIOError):
        while chunk := client.recv(65536):
            text += chunk
    return [json.loads(line) for line in text.split(b"\n")[:-1]]


def test_a_torque_becomes_an_acceleration_and_each_turn_an_answer(rig: Rig) -> None:
    """N m over the wheel's inertia; the answer says what was taken, of what age, and what went out."""
    client = rig.client()
    client.sendall(b'{"torque_Nm": 1e-3}\n')
    assert rig.turn() == pytest.approx(0.5)
    assert rig.turn() == pytest.approx(0.5)
    first, second = lines(client)
    assert first["torque_Nm"] == 1e-3
    assert first["current_A"] == 0.02
    assert first["state"] == "TRACKING"
    assert first["speed_rpm"] == pytest.approx(95.49, abs=0.01)
    assert first["compensating"] is False
    assert (first["age_s"], second["age_s"]) == (0.0, pytest.approx(0.1))


def test_a_request_that_is_not_repeated_fades_to_zero(rig: Rig) -> None:
    """Held for stale_s, gone stale_s + fade_s later, also where the client has left at once."""
    client = rig.client()
    client.sendall(b'{"torque_Nm": 1e-3}\n')
    client.close()
    wanted = [rig.turn() for _ in range(20)]
    assert wanted[:5] == [pytest.approx(0.5)] * 5
    assert all(b <= a for a, b in itertools.pairwise(wanted))
    assert wanted[15:] == [0.0] * 5


def test_more_than_the_wheel_has_is_taken_as_the_most_it_has(rig: Rig) -> None:
    """A huge number is finite, and asks for all that the largest current gives."""
    client = rig.client()
    client.sendall(b'{"torque_Nm": -1e300}\n')
    assert rig.turn() == -1.0 / INERTIA
    assert lines(client)[-1]["torque_Nm"] == -1.0


def test_a_second_controller_is_refused_while_the_first_asks(rig: Rig) -> None:
    """It is told so and closed; the first goes on. Once the first asks for nothing, the next one may."""
    first, second = rig.client(), None
    first.sendall(b'{"torque_Nm": 1e-3}\n')
    rig.turn()
    second = rig.client()
    second.sendall(b'{"torque_Nm": -5e-3}\n')
    assert rig.turn() == pytest.approx(0.5)
    assert "another controller" in lines(second)[0]["error"]
    assert rig.socket.counts["refused_clients"] == 1
    for _ in range(8):
        rig.turn()  # the first says nothing any more
    third = rig.client()
    third.sendall(b'{"torque_Nm": 2e-3}\n')
    assert rig.turn() == pytest.approx(1.0)
    first.sendall(b'{"torque_Nm": 1e-3}\n') if _is_open(first) else None
    assert rig.turn() == pytest.approx(1.0)


def _is_open(client: socket.socket) -> bool:
    client.setblocking(False)
    try:
        while client.recv(65536):
            pass
    except BlockingIOError:
        return True
    return False


@pytest.mark.parametrize(
    "sent",
    [
        b"\n",
        b"garbage\n",
        b'{"torque_Nm": NaN}\n',
        b'{"torque_Nm": 1e999}\n',
        b"\xff" * 100 + b"\n",
        b"[" * 4000 + b"\n",
    ],
)
def test_what_is_no_request_changes_nothing_and_is_answered(rig: Rig, sent: bytes) -> None:
    """The request before it holds on; the answer says what was wrong, once."""
    client = rig.client()
    client.sendall(b'{"torque_Nm": 1e-3}\n')
    rig.turn()
    client.sendall(sent)
    assert rig.turn() == pytest.approx(0.5)
    rig.turn()
    errors = [line["error"] for line in lines(client)]
    assert errors[0] is errors[2] is None
    assert (errors[1] is None) == (sent == b"\n")


def test_half_lines_are_put_together(rig: Rig) -> None:
    """A request of single bytes, one a turn, is heard when its line is whole, and not before."""
    client = rig.client()
    text = b'{"torque_Nm": 1e-3}\n'
    wanted = []
    for i in range(len(text)):
        client.sendall(text[i : i + 1])
        wanted.append(rig.turn())
    assert wanted[:-1] == [0.0] * (len(text) - 1)
    assert wanted[-1] == pytest.approx(0.5)


def _flood(path: Path, content: bytes, over: threading.Event, sent: list[int]) -> None:
    """Send as fast as the system takes it, and never read."""
    with contextlib.suppress(OSError), socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as client:
        client.connect(str(path))
        client.settimeout(0.05)
        while not over.is_set():
            try:
                sent[0] += client.send(content)
            except TimeoutError:
                continue


@pytest.mark.parametrize(
    "content",
    [b'{"torque_Nm": 1e-3}\n' * 5000, b"\n" * 100_000, b"x" * 100_000, b'{"torque_Nm": NaN}\n' * 5000],
    ids=["requests", "empty lines", "no line at all", "NaN"],
)
def test_a_flood_that_is_never_read_does_not_delay_a_turn(rig: Rig, content: bytes) -> None:
    """Two hundred turns under megabytes from a client that reads nothing: each takes a bounded piece; memory is too."""
    over, sent = threading.Event(), [0]
    flood = threading.Thread(target=_flood, args=(rig.path, content, over, sent), daemon=True)
    flood.start()
    try:
        wanted = [rig.turn() for _ in range(TURNS)]
        while sent[0] < 2_000_000:  # however slowly the other thread is let run
            wanted.append(rig.turn())
    finally:
        over.set()
        flood.join(10.0)
    most = 0.5 if content.startswith(b'{"torque_Nm": 1') else 0.0
    assert max(wanted) == pytest.approx(most)
    assert min(wanted) >= 0.0
    assert rig.most_pieces <= request_socket._READS
    assert rig.most_bytes <= request_socket._READS * request_socket._CHUNK_BYTES
    assert len(rig.socket._buffer._rest) <= 4096
    assert len(rig.socket._unsent) < 1000


def test_a_client_that_never_reads_misses_answers_and_is_still_obeyed(rig: Rig) -> None:
    """Its buffer is full after some hundred turns: then whole answers are left out; what it reads later is whole."""
    client = rig.client()
    for i in range(3000):
        client.sendall(b'{"torque_Nm": 1e-3}\n') if i % 4 == 0 else None
        assert rig.turn() == pytest.approx(0.5)
    missed = rig.socket.counts["unread_answers"]
    assert missed > 100
    got = lines(client)
    assert 100 < len(got) < 3000
    for _ in range(3):
        rig.turn()
    assert lines(client)[-1]["time_s"] == pytest.approx(300.2)


def test_a_storm_of_connections_does_not_delay_a_turn(rig: Rig) -> None:
    """Hundreds that come and go, some mid-line, while one asks: it is obeyed in every turn."""
    first = rig.client()
    for _ in range(TURNS):
        first.sendall(b'{"torque_Nm": 1e-3}\n')
        for _ in range(3):
            with contextlib.suppress(OSError), rig.client() as other:
                other.sendall(b'{"torque_Nm": 7')
        assert rig.turn() == pytest.approx(0.5)
    assert rig.socket.counts["refused_clients"] == 3 * TURNS
    assert rig.most_pieces <= request_socket._READS
    assert rig.most_bytes <= request_socket._READS * request_socket._CHUNK_BYTES
    assert len(rig.stated) <= 10  # the rest is counted


def test_the_file_is_for_its_owner_and_goes_with_the_run(tmp_path: Path) -> None:
    """Mode 0600 whatever the umask, from the first moment; removed at the end, unless it is another's by then."""
    before = os.umask(0)
    try:
        rig = Rig(tmp_path)
    finally:
        os.umask(before)
    assert stat.S_IMODE(rig.path.stat().st_mode) == 0o600
    rig.socket.close()
    assert not rig.path.exists()
    rig = Rig(tmp_path)
    rig.path.unlink()
    other = Rig(tmp_path)
    rig.socket.close()
    assert other.path.exists()
    other.socket.close()


def test_the_file_of_a_process_that_died_is_taken_over(tmp_path: Path) -> None:
    """Nobody listens there: it is replaced. Somebody does, or it is no socket: a sentence, and nothing is touched."""
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as dead:
        dead.bind(str(tmp_path / "request.sock"))
    rig = Rig(tmp_path)
    with pytest.raises(BadInputError, match="another process listens"):
        Rig(tmp_path)
    rig.turn()
    assert rig.path.exists()
    rig.socket.close()
    rig.path.write_text("a person's file")
    with pytest.raises(BadInputError, match="something else is there"):
        Rig(tmp_path)
    assert rig.path.read_text() == "a person's file"


@pytest.mark.parametrize("place", ["missing/request.sock", "x" * 120], ids=["no directory", "too long"])
def test_a_place_where_there_can_be_none_is_a_sentence(tmp_path: Path, place: str) -> None:
    """No directory, or a path longer than the system takes."""
    with pytest.raises(BadInputError, match=r"compensation\.socket"):
        RequestSocket(tmp_path / place, RequestTerms(INERTIA, 0.5, 1.0), VirtualClock(), lambda event, **_: None)
