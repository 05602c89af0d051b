"""What is wrong between a CAN map and its messages: each finding with its place."""

from __future__ import annotations

from typing import Any

from pydantic import ValidationError

from rw_ekf.checking.section import Mistake
from rw_ekf.checking.yaml_loader import PathTuple
from rw_ekf.drivers.can.can_database import unit_of
from rw_ekf.drivers.can.can_file import FLAG_BITS, CanFile, CommandKeys, FrameCare, Reported, Sent
from rw_ekf.drivers.line.wire_layout import Field

_WHOLE = {False: "u64", True: "i64"}
_FLOATS = {32: "f32", 64: "f64"}
_LONGEST_BYTES = 8


def used_messages(file: CanFile) -> list[str]:
    """The messages that a map speaks of."""
    sent = [s.message for s in (file.enable, file.idle, file.reset, file.cycle.request) if isinstance(s, Sent)]
    reported = [reported.signal.split(".")[0] for reported in file.telemetry.values()]
    return list(dict.fromkeys([*file.cycle.messages, *reported, file.command.signal.split(".")[0], *sent]))


def signal_field(name: str, reported: Reported | CommandKeys, database: Any) -> Field:
    """A signal as a register's field. Raises ValidationError: its unit does not fit; KeyError: a float of 16 bits."""
    message, signal_name = reported.signal.split(".")
    signal = database.get_message_by_name(message).get_signal_by_name(signal_name)
    field = Field(
        name=name,
        type=_FLOATS[signal.length] if signal.is_float else _WHOLE[signal.is_signed],
        unit=reported.unit if reported.unit is not None else unit_of(signal),
        scale=float(signal.scale),
        offset=float(signal.offset),
    )
    if not signal.is_float:
        half = 1 << (signal.length - 1)
        field.carry_only(*((-half, half - 1) if signal.is_signed else (0, 2 * half - 1)))
    return field


class MapCheck:
    """Holds a file against a database of messages."""

    def __init__(self, file: CanFile, database: Any) -> None:
        self._file = file
        self._database = database
        self._known = {message.name: message for message in database.messages}
        self._found: list[Mistake] = []

    def findings(self) -> list[Mistake]:
        """Every mistake: its path in the file, and the words behind the key."""
        file = self._file
        for name, reported in file.telemetry.items():
            self._value(("telemetry", name), name, reported)
        for index, name in enumerate(file.cycle.messages):
            self._message(("cycle", "messages", index), name)
        self._value(("command", "signal"), "current_command", file.command)
        for text, number in file.command.constants.items():
            self._number(("command", "constants", text), file.command.signal.split(".")[0], text, number)
        request = file.cycle.request
        for path, sent in (
            (("enable",), file.enable),
            (("idle",), file.idle),
            (("reset",), file.reset),
            (("cycle", "request"), request if isinstance(request, Sent) else None),
        ):
            if sent is not None and self._message((*path, "message"), sent.message):
                for text, number in sent.signals.items():
                    self._number((*path, "signals", text), sent.message, text, number)
        for name, care in file.frames.items():
            if self._message(("frames", name), name):
                self._care(name, care)
        self._together()
        return self._found

    def _add(self, path: PathTuple, words: str) -> None:
        self._found.append((path, words))

    def _message(self, path: PathTuple, name: str) -> bool:
        """Whether there is such a message, and it can be spoken."""
        if name not in self._known:
            self._add(
                path, f"is {name}: there is no such message; there are: {', '.join(sorted(self._known)) or 'none'}"
            )
            return False
        message = self._known[name]
        if message.is_multiplexed() or message.is_fd or message.length > _LONGEST_BYTES:
            self._add(path, f"is {name}: messages that are multiplexed or longer than 8 bytes are not spoken")
        return True

    def _signal(self, path: PathTuple, message: str, name: str) -> bool:
        """Whether a message has such a signal."""
        if not self._message(path, message):
            return False
        names = [signal.name for signal in self._known[message].signals]
        if name not in names:
            self._add(path, f"is {name}: message {message} has no such signal; it has: {', '.join(names) or 'none'}")
        return name in names

    def _number(self, path: PathTuple, message: str, name: str, number: int) -> None:
        """A number that a signal must be able to carry."""
        if not self._signal(path, message, name):
            return
        signal = self._known[message].get_signal_by_name(name)
        least = -(1 << (signal.length - 1)) if signal.is_signed else 0
        if not signal.is_float and not least <= number < least + (1 << signal.length):
            self._add(path, f"is {number}: signal {name} has {signal.length} bits")

    def _value(self, path: PathTuple, name: str, reported: Reported | CommandKeys) -> None:
        """A signal that is a quantity of the program."""
        if not self._signal(path, *reported.signal.split(".")) or name in FLAG_BITS:
            return
        try:
            signal_field(name, reported, self._database)
        except ValidationError as error:
            self._add(path, f"{error.errors()[0]['msg']}: give it beside the signal, as unit")
        except KeyError:
            self._add(path, f"is {reported.signal}: a float has 32 or 64 bits")

    def _care(self, name: str, care: FrameCare) -> None:
        """Counter and checksum of a message."""
        signals = {signal.name: signal for signal in self._known[name].signals}
        for key in ("alive", "checksum"):
            text = getattr(care, key)
            if text is None or not self._signal(("frames", name, key), name, text):
                continue
            signal = signals[text]
            if signal.is_float or signal.is_signed or signal.length < 2:
                self._add(("frames", name, key), f"is {text}: it must be an unsigned number of at least 2 bits")
        summed = signals.get(care.checksum or "")
        if summed is not None:
            first_bit = 0 if summed.byte_order == "little_endian" else 7
            if summed.length != 8 or summed.start % 8 != first_bit:
                self._add(("frames", name, "checksum"), f"is {care.checksum}: it must be one whole byte")

    def _together(self) -> None:
        """What the parts must be to each other."""
        file = self._file
        used = [self._known[name] for name in used_messages(file) if name in self._known]
        places = [(message.frame_id, message.is_extended_frame) for message in used]
        for message, place in zip(used, places, strict=True):
            if places.count(place) > 1:
                self._add(("telemetry",), f"uses {message.name}, whose identifier another message has too")
        telling = {reported.signal.split(".")[0] for reported in file.telemetry.values()} | set(file.cycle.messages)
        if file.command.signal.split(".")[0] in telling:
            self._add(("command", "signal"), "is in a message of telemetry: nobody could tell who sent it")
        moment = ["uptime", file.command.confirmed_by or "current_command"]
        for name in moment:
            reported = file.telemetry.get(name)
            if reported is not None and reported.signal.split(".")[0] not in file.cycle.messages:
                self._add(("telemetry", name), "must be in a message of the cycle: it is of the moment of a reading")
        shared = [m for m in file.cycle.messages if file.frames.get(m, FrameCare()).alive is None]
        if file.cycle.same_alive and shared:
            self._add(("cycle", "same_alive"), f"needs frames.{shared[0]}.alive: without a count none is the same")
