"""Lines of text in the place of frames: what queries a register, and what its answer says.

    line    [prompt] text [*checksum] end

A line counts when its end has come, whole; one that says nothing of the map is damaged. Numbers are kept as they were
printed, eight bytes each, which a frame's data holds in the order of the register's fields. A line bears no number of
its request: an answer is one of the request in flight if it has the form of its reply, and ascii_link.py sees that no
older one can come.
"""

from __future__ import annotations

import re
from collections import Counter, deque
from collections.abc import Callable, Mapping
from functools import reduce
from operator import xor

from rw_ekf.drivers.line.ascii_layout import TERMINATORS, AsciiRegister
from rw_ekf.drivers.line.ascii_protocol import AsciiMap
from rw_ekf.drivers.line.ascii_template import ADDRESS, LONGEST_LINE, Template
from rw_ekf.drivers.line.framing import CRCS, Decoded, Frame, crc16
from rw_ekf.drivers.line.wire_map import STATUS_OK

_CUT = b"\x00"  # before the rest of a line that is too long: none such holds
_ENDS = re.compile(rb"[\r\n]+")
_ODD = re.compile(rb"[^\x09\x20-\x7f]")  # no line holds such a byte
STARTUP_ID = 0x100  # and the number of the line; beyond all registers
_NOT_OURS = Frame(-1, -1, b"")  # a good line, but no answer to the query
_NOTHING = Frame(-2, -1, b"")  # a line that the map knows to say nothing


def checksum_of(content: bytes, kind: str) -> str:
    """What stands behind the *. xor: in two hexadecimal digits, without a $ or ! at the beginning (NMEA 0183)."""
    if kind in CRCS:
        return f"{crc16(content, kind):04X}"
    if kind == "xor-decimal":  # RepRap G-code, ODrive
        return f"{reduce(xor, content, 0)}"
    return f"{reduce(xor, content.lstrip(b'$!'), 0):02X}"


class AsciiCodec:
    """One end of a line. It remembers what was requested or heard last, for a line says less than a frame."""

    def __init__(self, wire_map: AsciiMap, forms: Mapping[int, int] | None = None) -> None:
        """forms: by id of a register a number for the form of its answers, by which `heard` counts them."""
        self._map = wire_map
        self._forms = forms if forms is not None else {register.id: register.id for register in wire_map.registers}
        self._framing = wire_map.framing
        address = self._framing.address
        self._address = {} if address is None else {ADDRESS: float(address)}
        self._line_end = TERMINATORS[self._framing.terminator]
        self._prompt = self._framing.prompt.strip().encode()
        self.overhead_bytes = 0  # of the last reply; what is left of it beside its numbers' own bytes
        self.refused: str | None = None  # the line by which the last request was refused
        self.may_be_refused = False  # a line that nothing answers was sent, and no answer to anything has come since
        self.refused_line: str | None = None  # the line by which it was refused, and the map's number for that
        self.refused_status = STATUS_OK
        self.heard: Counter[int] = Counter()  # lines by form; the same line again is not counted
        self.has_restarted = False  # as the wheel reported
        self.odd = ""  # the last line that says nothing of the map
        self._wanted: tuple[int, AsciiRegister | None, str] = (0, None, "")
        self._last = ""
        self._sent: deque[str] = deque(maxlen=4)  # whose echoes may come
        self._written: dict[int, bytes] = {}  # what was written last, at the wheel's end

    # --- this end -----------------------------------------------------------------------------------------------

    def request(self, seq: int, register_id: int, data: bytes) -> bytes:
        """The line of a query or a command."""
        register = self._register(register_id)
        assert register is not None
        text = register._asks.printed(self._address | (_numbers(register, data) if data else {}))
        return self.plain(text, seq, register)

    def startup(self, line: str) -> bytes:
        """A line of the start; no answer to it is of any meaning but a refusal."""
        return self.plain(self._map.line(line).printed(self._address))

    def plain(self, text: str, seq: int = 0, register: AsciiRegister | None = None) -> bytes:
        """A line that is sent as it stands; without a register no answer to it is of any meaning but a refusal."""
        self._wanted = (seq, register, text)
        self._sent.append(text)
        self.refused = None
        return self._line(text, self._line_end)

    def expect_refusal(self) -> None:
        """A line goes out that nothing answers but a refusal."""
        self.may_be_refused, self.refused_line = True, None

    def replies(self, buffer: bytes) -> Decoded:
        """Frames of what came back; one that answers the last request has its seq and id."""
        return self._decoded(buffer, self._replied)

    def _replied(self, text: str) -> Frame | None:
        """The frame of a line; None where the map has none such."""
        seq, register, wanted = self._wanted
        if self._is_known(text):
            return _NOTHING
        numbers = None if register is None else self._read(register._answers, text)
        if register is not None and numbers is not None:
            self._count(register, text)
            self.may_be_refused = False
            self.overhead_bytes = len(text) + 2 - 8 * len(register.fields)
            if register.access == "read":
                return Frame(seq, register.id, _data(register, numbers))
            sent = register._asks.read(wanted) or {}
            same = all(numbers[name] == sent[name] for name in numbers)
            return Frame(seq, register.id, bytes((STATUS_OK,))) if same else _NOT_OURS
        for status, line in self._map.refused.items():
            if self._read(self._map.line(line), text) is not None:
                if self.may_be_refused:
                    self.may_be_refused, self.refused_line, self.refused_status = False, text, status
                    return _NOT_OURS
                self.refused = text
                write = register is not None and register.access == "write"
                return Frame(seq, register.id, bytes((status,))) if write and register else _NOT_OURS
        if text in self._sent and self._framing.echoes:
            return _NOTHING
        if text in self._sent or register is None:
            return _NOT_OURS  # an echo; what answers a line of the start
        for other in self._map.registers:
            if other._answers is not None and other._answers.read(text) is not None:
                if self._read(other._answers, text) is not None:
                    self._count(other, text)
                return _NOT_OURS  # the answer to a request that was given up, or another wheel's
        return None

    def _count(self, register: AsciiRegister, text: str) -> None:
        """Count an answer by its form."""
        self.heard[self._forms[register.id]] += text != self._last
        self._last = text

    # --- the wheel's end ----------------------------------------------------------------------------------------

    def requests(self, buffer: bytes) -> Decoded:
        """Frames at the wheel's end."""
        return self._decoded(buffer, self._requested)

    def _requested(self, text: str) -> Frame | None:
        self._wanted = (0, None, text)
        for index, line in enumerate(self._map.startup):
            if self._map.line(line).printed(self._address) == text:
                return Frame(0, STARTUP_ID + index, b"")
        for register in self._map.registers:
            numbers = self._read(register._asks, text)
            if numbers is not None:
                self._written[register.id] = _data(register, numbers) if register.access == "write" else b""
                return Frame(0, register.id, self._written[register.id])
        return None

    def reply(self, answer: Frame) -> bytes:
        """What answers, with echo and prompt; a write's data is its status; a byte too many is a value too many."""
        register = self._register(answer.id)
        text = None
        if register is not None and register.access == "read":
            assert register._answers is not None
            data = answer.data[: register.size].ljust(register.size, b"\0")
            text = register._answers.printed(self._address | _numbers(register, data))
            text += " 0" * (len(answer.data) > register.size)
        elif answer.data not in (b"", bytes((STATUS_OK,))):
            refused = self._map.refused
            line = refused.get(answer.data[0], next(iter(refused.values()), None))
            text = None if line is None else self._map.line(line).printed(self._address)
        elif register is not None and register._answers is not None:
            written = _numbers(register, self._written.get(register.id, bytes(register.size)))
            text = register._answers.printed(self._address | written)
        around = self._line(self._wanted[2], self._line_end) if self._framing.echoes else b"", self._prompt
        return (b"" if text is None else self._line(text, self._line_end)).join(around)

    def stated(self, text: str) -> bytes:
        """A line of the wheel's own."""
        return self._line(self._map.line(text).printed(self._address), self._line_end)

    # --- lines --------------------------------------------------------------------------------------------------

    def _read(self, template: Template | None, text: str) -> dict[str, float] | None:
        """The numbers of a line; None where it is another line, or another wheel's."""
        numbers = None if template is None else template.read(text)
        if numbers is None or numbers.get(ADDRESS) != self._address.get(ADDRESS, numbers.get(ADDRESS)):
            return None
        return {name: number for name, number in numbers.items() if name != ADDRESS}

    def _register(self, register_id: int) -> AsciiRegister | None:
        register = self._map.register_of_id(register_id)
        return register if isinstance(register, AsciiRegister) else None

    def _line(self, text: str, end: bytes) -> bytes:
        content = text.encode()
        if self._framing.has_checksum:
            content += b"*" + checksum_of(content, self._framing.checksum).encode()
        return content + end

    def _decoded(self, buffer: bytes, meaning: Callable[[str], Frame | None]) -> Decoded:
        """Every whole line of a buffer by its meaning; what is left is bounded, and marked where it is cut."""
        *lines, rest = _ENDS.split(buffer)
        frames: list[Frame] = []
        damaged = 0
        for content in lines:
            text = self._text(content)
            if text == "":
                continue
            frame = None if text is None else meaning(text)
            if frame is None:
                self.odd = content.decode("ascii", "backslashreplace").strip()
                damaged += 1
            elif frame is not _NOTHING:
                frames.append(frame)
        if len(rest) > LONGEST_LINE:
            rest = _CUT
            damaged += 1
        return Decoded(tuple(frames), damaged, b"" if self._prompt and rest.strip() == self._prompt else rest)

    def _is_known(self, text: str) -> bool:
        """Whether a line is one of those that need no answer; it may be that the wheel has restarted."""
        restarted = self._map.restarted
        if restarted is not None and self._read(self._map.line(restarted), text) is not None:
            self.has_restarted = True
            return True
        return any(self._map.line(line).read(text) is not None for line in self._map.ignored)

    def _text(self, content: bytes) -> str | None:
        """A line without what is around it; None where it is damaged, empty where there is nothing."""
        content = content.strip(b" \t\r\n")
        while self._prompt and content.startswith(self._prompt):
            content = content[len(self._prompt) :].lstrip()
        if len(content) > LONGEST_LINE or _ODD.search(content):
            return None
        if not content or not self._framing.has_checksum:
            return content.decode()
        content, star, found = content.rpartition(b"*")
        right = checksum_of(content, self._framing.checksum)
        same = star and found.isalnum() and found.upper().zfill(len(right)) == right.encode()
        return content.strip().decode() if same else None


def _numbers(register: AsciiRegister, data: bytes) -> dict[str, float]:
    """The numbers that a register's data holds, by field."""
    return dict(zip((field.name for field in register.fields), register.packing.unpack(data), strict=True))


def _data(register: AsciiRegister, numbers: dict[str, float]) -> bytes:
    """The data of a register."""
    return register.packing.pack(*(numbers[field.name] for field in register.fields))
