"""What a line with faults makes of the messages on it: bytes in, pieces of bytes out, each so much later."""

from __future__ import annotations

from typing import NamedTuple

from rw_ekf.drivers.sim.faults import BOTH, FaultAtWork, FaultInjector


class Piece(NamedTuple):
    """Bytes that come through, so much later than on a healthy line [s]."""

    content: bytes
    late_s: float = 0.0


class LineStage:
    """Between the wheel's codec and the port. A message is what is written at once: a request, or one reply."""

    def __init__(self, faults: FaultInjector) -> None:
        self._faults = faults

    def carry(self, way: str, content: bytes, time_s: float, register: str | None = None) -> list[Piece]:
        """What arrives of a message sent at time_s [s]; register: whose reply it is."""
        pieces = [Piece(content)]
        for fault in self._faults.on_line(way, register, time_s):
            if fault.strikes(time_s):
                pieces = _struck(fault, way, pieces, time_s)
            elif way in fault.memory:  # kept by `reorder`, and now overtaken
                pieces = [*pieces, *fault.memory.pop(way)]
        return pieces

    def echo(self, content: bytes, time_s: float) -> bytes:
        """What of a request comes back as it is."""
        return content if self._faults.striking("echo", time_s) is not None else b""

    def junk(self, way: str, time_s: float) -> bytes:
        """Junk that was on the line since the last call."""
        noise = b""
        for fault in self._faults.on("flood", time_s):
            if fault.fault.way not in (way, BOTH):
                continue
            since_s = time_s - fault.memory.get((way, "at"), time_s)
            owed = fault.memory.get((way, "owed"), 0.0) + since_s * fault.fault.number
            noise += fault.random.randbytes(int(owed))
            fault.memory[way, "at"], fault.memory[way, "owed"] = time_s, owed - int(owed)
        return noise


def _struck(one: FaultAtWork, way: str, pieces: list[Piece], time_s: float) -> list[Piece]:
    """The pieces of a message behind one fault that strikes it."""
    fault = one.fault
    if fault.kind in ("drop", "silence"):
        return []
    if fault.kind == "cut":
        return [Piece(content[: fault.count], late_s) for content, late_s in pieces]
    if fault.kind == "flip":
        return [Piece(_flipped(one, content), late_s) for content, late_s in pieces]
    if fault.kind == "insert":
        junk = [one.random.randbytes(fault.count) for _ in range(2)]
        return [Piece(junk[0] + content + junk[1], late_s) for content, late_s in pieces]
    if fault.kind == "duplicate":
        return [piece for piece in pieces for _ in range(2)]
    if fault.kind == "dribble":
        return [
            Piece(content[i : i + 1], late_s + i * fault.time_s)
            for content, late_s in pieces
            for i in range(len(content))
        ]
    if fault.kind == "delay":
        return [Piece(content, late_s + fault.time_s) for content, late_s in pieces]
    if fault.kind == "reorder":
        kept, one.memory[way] = one.memory.pop(way, None), pieces
        if kept is None:
            return []
        del one.memory[way]
        return [*pieces, *kept]
    if fault.kind == "hold":
        return [Piece(content, max(late_s, _until_let_go(one, time_s))) for content, late_s in pieces]
    return pieces


def _flipped(one: FaultAtWork, content: bytes) -> bytes:
    """The bytes with some bits wrong."""
    spoilt = bytearray(content)
    for bit in one.random.sample(range(8 * len(spoilt)), min(one.fault.count, 8 * len(spoilt))):
        spoilt[bit // 8] ^= 1 << bit % 8
    return bytes(spoilt)


def _until_let_go(one: FaultAtWork, time_s: float) -> float:
    """How long bytes that come at time_s [s] are held."""
    end_s = one.fault.next_change_s(time_s)
    if one.fault.time_s > 0.0:
        began_s = one.fault.stretch_s(time_s) or 0.0
        grid_s = one.fault.time_s
        end_s = min(end_s, began_s + grid_s * (int((time_s - began_s) / grid_s) + 1))
    return end_s - time_s
