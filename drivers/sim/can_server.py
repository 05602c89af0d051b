"""The electronics of a wheel on a CAN bus, behind an slcan adapter: telemetry unrequested, currents by message."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from rw_ekf.drivers.can import slcan
from rw_ekf.drivers.can.can_file import FLAG_BITS, Sent
from rw_ekf.drivers.can.can_frames import CanFrame
from rw_ekf.drivers.can.can_protocol import CanMap
from rw_ekf.drivers.line.framing import Frame
from rw_ekf.drivers.line.registers import encode_saturated
from rw_ekf.drivers.line.wire_layout import Register
from rw_ekf.drivers.sim.register_server import RegisterServer, Reply


class CanServer(RegisterServer):
    """It sends each message at its period while the channel is open, and takes what the map has sent to it."""

    wire_map: CanMap

    def __init__(self, *args: Any, **options: Any) -> None:
        super().__init__(*args, **options)
        self._layout = self.wire_map.layout
        self._open = False
        self._enabled = self._layout.file.enable is None
        self._alive = dict.fromkeys(self._layout.codecs, 0)
        watchdog_ms = self._layout.file.command.watchdog_ms
        self.watchdog_s = None if watchdog_ms is None else 1e-3 * watchdog_ms
        cycle = self._layout.file.cycle
        reported = dict.fromkeys(m for r in self.wire_map.readable() for m in self._layout.messages_of(r.name))
        groups = [cycle.messages, *((name,) for name in reported if name not in cycle.messages)]
        self._due = dict.fromkeys(groups, self.plant.time_s)
        if cycle.request is not None:
            del self._due[cycle.messages]

    def handle(self, received: bytes, time_s: float) -> list[Reply]:
        """What the adapter and the wheel say to lines whose last byte arrived at `time_s`."""
        self.advance_to(time_s)
        lines = slcan.decode(self._rest + received)
        self._rest = lines.rest
        self.damaged += lines.damaged
        replies = [Reply(self._adapter(text, time_s)) for text in lines.commands]
        for frame in lines.frames:
            if self._open:
                replies += [Reply(slcan.CR), *self.hear(frame, time_s)]
            else:
                replies.append(Reply(slcan.BELL))
        return replies

    def hear(self, frame: CanFrame, time_s: float) -> list[Reply]:
        """A frame on the bus: done where it is one of the map's, and answered where it is a request."""
        cycle = self._layout.file.cycle
        if frame.remote:
            first = self._layout.codecs[cycle.messages[0]]
            wanted = cycle.request == "remote" and (frame.id, frame.extended) == (first.id, first.extended)
            return self._cycle(cycle.messages, time_s) if wanted else []
        for name, codec in self._layout.codecs.items():
            if (codec.id, codec.extended) == (frame.id, frame.extended):
                unpacked = codec.unpack(frame)
                if unpacked is None:
                    self.damaged += 1
                elif isinstance(cycle.request, Sent) and name == cycle.request.message:
                    return self._cycle(cycle.messages, time_s)
                else:
                    self._obey(name, unpacked[0], unpacked[1] or 0)
        return []

    def unsolicited(self, time_s: float) -> list[Reply]:
        """What is due to be sent."""
        found: list[Reply] = []
        for group, due_s in self._due.items():
            if due_s > time_s:
                continue
            period_s = 1e-3 * self._layout.care(group[0]).period_ms
            self._due[group] = due_s + period_s * (math.floor((time_s - due_s) / period_s) + 1.0)
            if self._open:
                self.advance_to(time_s)
                found += self._cycle(group, time_s)
        return found

    def next_unsolicited_s(self, time_s: float) -> float:
        """When that is next."""
        return min(self._due.values(), default=math.inf) if self._open else math.inf

    def restart(self) -> None:
        """Start anew; counts too."""
        super().restart()
        self._alive = dict.fromkeys(self._alive, 0)
        self._enabled = self._layout.file.enable is None

    # --- what is heard ----------------------------------------------------------------------------------------------

    def _adapter(self, text: str, time_s: float) -> bytes:
        """The adapter's answer to a line that is no frame."""
        if text in ("O", "L", "C"):
            self._open = text != "C"
            for group in self._due:
                self._due[group] = max(self._due[group], time_s)
            return slcan.CR
        if text[0] == "S" and text[1:].isdigit() and int(text[1:]) in slcan.BIT_RATES.values():
            return slcan.BELL if self._open else slcan.CR
        return slcan.BELL

    def _obey(self, message: str, numbers: Mapping[str, float], alive: int) -> None:
        """Do what a message commands; the watch sees it as the write of a register."""
        file = self._layout.file
        for name, sent in (("mode", file.idle), ("reset", file.reset)):
            if sent is not None and sent.message == message and _matches(sent, numbers):
                self._write_of(name, (0,), alive)
                return
        if file.enable is not None and file.enable.message == message and _matches(file.enable, numbers):
            self._enabled = True
        if message == self._layout.command.message and all(numbers[k] == v for k, v in file.command.constants.items()):
            self._write_of("current_command", (numbers[self._layout.command.signal],), alive)

    def _write_of(self, name: str, numbers: tuple[float, ...], alive: int) -> None:
        register = self.wire_map.register(name)
        assert register is not None
        frame = Frame(alive, register.id, register.packing.pack(*numbers))
        self._watch(frame)
        if name == "current_command" and not self._enabled and numbers[0] != 0.0:
            return
        self._write_status(frame, register)

    # --- what is reported -------------------------------------------------------------------------------------------

    def _cycle(self, messages: tuple[str, ...], time_s: float) -> list[Reply]:
        """Frames of messages that belong to one moment."""
        numbers: dict[str, dict[str, float]] = {message: {} for message in messages}
        names: dict[str, Register] = {}
        for register in self.wire_map.readable():
            sources = self._layout.sources[register.name]
            if not any(source.message in numbers for source in sources.values()):
                continue
            reported = self._spoilt.telemetry(register, self._telemetry(register), time_s)
            data = encode_saturated(register, reported)
            counts = dict(zip((f.name for f in register.fields), register.packing.unpack(data), strict=True))
            for field, source in sources.items():
                if source.message in numbers:
                    names.setdefault(source.message, register)
                    number = counts[field] if field in counts else int(bool(int(counts["flags"]) & FLAG_BITS[field]))
                    numbers[source.message][source.signal] = number
        replies = []
        for message in messages:
            self._alive[message] += 1
            replies.append(self._reply(message, numbers[message], names[message], time_s))
        return replies

    def _reply(self, message: str, numbers: Mapping[str, float], register: Register, time_s: float) -> Reply:
        """One frame, or what faults make of it: an old count, another identifier, a byte too few, the same again."""
        codec = self._layout.codecs[message]
        data = codec.pack(numbers, self._alive[message]).data
        spoilt = self._spoilt.reply(Frame(self._alive[message], register.id, data), register, data, time_s)
        if spoilt.seq & 0xFF != self._alive[message] & 0xFF and spoilt.data == data:
            data = codec.pack(numbers, spoilt.seq).data
        elif spoilt.data != data:
            data = spoilt.data if len(spoilt.data) <= len(data) else data[:-1]
        number = codec.id if spoilt.id == register.id else codec.id + 1
        return Reply(slcan.encode(CanFrame(number, data, codec.extended)), register.name)


def _matches(sent: Sent, numbers: Mapping[str, float]) -> bool:
    return all(numbers[name] == number for name, number in sent.signals.items())
