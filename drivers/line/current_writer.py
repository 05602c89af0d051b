"""Currents as register writes: what was refused or not answered is read back, a refused zero is enforced otherwise."""

from __future__ import annotations

import math
from typing import NamedTuple

from rw_ekf.clock import Clock
from rw_ekf.driver import ACTED_THOUGH, OPPOSITE, TIMEOUT, ZERO_BY_MODE, ZERO_BY_RESET
from rw_ekf.drivers.line.line import Exchange, Line
from rw_ekf.drivers.line.registers import decode_register, encode_register, is_plausible, rounded_si, telling_register
from rw_ekf.drivers.line.wire_layout import Field, Register
from rw_ekf.drivers.line.wire_map import STATUS_OK, WireMap
from rw_ekf.errors import DriverError

MODE, RESET = "mode", "reset"  # registers that let go of the current
_REGISTERS = {ZERO_BY_MODE: MODE, ZERO_BY_RESET: RESET}
IDLE = 0.0  # the mode without one
_F32_PART = 1.0e-6  # of a value: above what 24 bits of it, and a scale, lose
RESET_EVERY_S = 5.0  # a wheel is not kept from coming up by resetting it again and again


class Written(NamedTuple):
    """What became of a write; current_A is in force where acknowledged, since the wheel had received_s [s, host]."""

    current_A: float
    received_s: float
    acknowledged: bool = True
    reason: str | None = None


class CurrentWriter:
    """Writes the current of one wheel. Raises DriverError for a current the wire cannot carry, or a lost line."""

    def __init__(self, line: Line, wire_map: WireMap, host: Clock) -> None:
        self._line = line
        self._map = wire_map
        self._host = host
        self._telling = telling_register(wire_map)
        reported_by = None if self._telling is None else self._telling.field("current_command")
        self._reported_by = reported_by if reported_by is not None else wire_map.current_command.fields[0]
        self._reset_again_s = host.monotonic()
        self._sent_A = 0.0  # the last that was written

    @property
    def drives(self) -> bool:
        """Whether the last current that was written is not zero."""
        return self._sent_A != 0.0

    def command(self, current_A: float) -> Written:
        """Write a current [A] as `SerialWheel.command_current` says."""
        register = self._map.current_command
        field = register.fields[0]
        current_A = _toward_zero(field, current_A)
        try:
            data = encode_register(register, {"current_command": current_A})
        except ValueError as error:
            raise DriverError(f"{self._line.name}: {error}. Set limits.current_A to what the wheel takes") from error
        exchange, reason = self._write(register, data)
        before_A, sent_A = self._sent_A, rounded_si(field, current_A)
        self._sent_A = sent_A
        received_s = exchange.received_by_wheel_s
        if reason is None:
            return Written(sent_A, received_s)
        reported_A = self._reported_A()
        if reported_A is None:
            return Written(sent_A, received_s, False, reason)
        may_A = max(_step_A(field, sent_A), _step_A(self._reported_by, sent_A))
        if abs(reported_A - sent_A) <= may_A:
            return Written(sent_A, received_s, reason=None if reason == TIMEOUT else ACTED_THOUGH + reason)
        if (
            abs(reported_A + sent_A) <= may_A < abs(reported_A - before_A)
        ):  # and it is not the one from before that holds on
            return Written(reported_A, received_s, reason=OPPOSITE)
        return Written(reported_A, received_s, reason=reason)

    def stop(self, by: str | None = None) -> Written:
        """Write zero, or let go of the current as `SerialWheel.stop_current` says."""
        if by is not None:
            done = self._let_go(_REGISTERS[by])
            return Written(
                0.0, self._host.monotonic() if done is None else done.received_by_wheel_s, done is not None, by
            )
        zero = self.command(0.0)
        if zero.acknowledged and zero.reason == TIMEOUT:  # telemetry says another: lost on its way, perhaps
            zero = self.command(0.0)
        if zero.acknowledged and zero.current_A == 0.0:
            return zero
        if zero.reason != TIMEOUT or zero.acknowledged:
            for reason, name in _REGISTERS.items():
                if name == RESET and zero.reason == TIMEOUT:  # a line that loses much is no reason for one
                    break
                done = self._let_go(name)
                if done is not None:
                    return Written(0.0, done.received_by_wheel_s, reason=reason)
        return Written(0.0, zero.received_s, False, zero.reason)

    def _write(self, register: Register, data: bytes) -> tuple[Exchange, str | None]:
        """Write a register; why it may not have acted, None where the wheel says that it did."""
        exchange = self._line.request(register.id, data, reply_bytes=1)
        if exchange.data is None:
            return exchange, TIMEOUT
        status = exchange.data[0]
        return exchange, None if status == STATUS_OK else self._map.status_name(status)

    def _reported_A(self) -> float | None:
        """The command in force by telemetry; None where the wheel does not report it, or does not answer."""
        if self._telling is None:
            return None
        data = self._line.request(self._telling.id, b"", self._telling.size).data
        values = None if data is None else decode_register(self._telling, data)
        return values["current_command"] if values is not None and is_plausible(self._telling, values) else None

    def _let_go(self, name: str) -> Exchange | None:
        """Let go of the current by another register; None where there is none, or it does not help."""
        register = self._map.register(name)
        now_s = self._host.monotonic()
        if register is None or register.access != "write" or (name == RESET and now_s < self._reset_again_s):
            return None
        try:
            data = encode_register(register, {MODE: IDLE} if name == MODE else {})
        except ValueError:  # the map has fields there that nobody here knows
            return None
        if name == RESET:
            self._reset_again_s = now_s + RESET_EVERY_S
        exchange, reason = self._write(register, data)
        return exchange if reason is None or self._reported_A() == 0.0 else None


def _toward_zero(field: Field, current_A: float) -> float:
    """The current itself, or one count less where rounding on the wire would carry it beyond: a limit is a limit."""
    if not math.isfinite(current_A) or field.is_float:  # that rounds by less than any limit is known
        return current_A
    try:
        sent_A = rounded_si(field, current_A)
    except ValueError:
        return current_A
    count_A = abs(field.si_per_count)
    return sent_A - math.copysign(count_A, sent_A) if abs(sent_A) - abs(current_A) > 1e-6 * count_A else current_A


def _step_A(field: Field, current_A: float) -> float:
    """By how much a current can be another than was meant, for its digits alone [A]."""
    return _F32_PART * abs(current_A) if field.is_float else 0.5 * field.si_per_count
