"""The wheel's electronics: answers the wire protocol over a plant. Bytes in, bytes out, at a time it is given.

Written against the wire map alone, as the driver is, so that a map of another wheel is served as well.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

from rw_ekf.drivers.line.framing import Frame
from rw_ekf.drivers.line.registers import decode_register, encode_saturated
from rw_ekf.drivers.line.wire_layout import Register
from rw_ekf.drivers.line.wire_map import WireMap
from rw_ekf.drivers.sim.faults import FaultInjector
from rw_ekf.drivers.sim.plant_runner import PlantRunner
from rw_ekf.drivers.sim.wheel_faults import WheelFaults

IDLE, CURRENT, SPEED = 0, 1, 2  # modes
OK, UNKNOWN_ID, WRONG_LENGTH, OUT_OF_RANGE, REFUSED = range(5)  # statuses of a reply to a write
FLAG_FAULT, FLAG_LIMITED, FLAG_OVER_TEMPERATURE, FLAG_RESET = 1, 2, 4, 8

WHEEL_TYPE, WHEEL_VERSION = 6, 1
SPEED_LOOP_S = 0.010  # speed mode closes its loop inside the wheel at 100 Hz [CK13 4]
SPEED_GAIN_A_S_RAD, SPEED_INTEGRAL_A_RAD = 0.06, 0.12
OVER_TEMPERATURE_DEGC = 70.0
VACUUM_PA = 100.0
BUS_V = 28.0


class Reply(NamedTuple):
    """A frame to send, and of which register it is."""

    content: bytes
    register: str | None = None


class RegisterServer:
    """One simulated wheel behind its registers.

    faults: of these electronics, and of the line that serves them. watch: sees every good frame that comes.
    max_current_A: beyond it a command has status 3 (default: the wire's).
    """

    hottest_degC = OVER_TEMPERATURE_DEGC  # above it says so

    def __init__(
        self,
        wire_map: WireMap,
        plant: PlantRunner,
        *,
        serial_number: int = 1,
        max_current_A: float | None = None,
        first_uptime_s: float = 0.0,
        faults: FaultInjector | None = None,
        watch: Callable[[Frame], object] = lambda frame: None,
    ) -> None:
        self.wire_map = wire_map
        self.plant = plant
        self.watchdog_s: float | None = None  # it lets go of a current that is not repeated so soon
        self._commanded_s = plant.time_s
        self.faults = faults if faults is not None else FaultInjector()
        self._spoilt = WheelFaults(self.faults)
        self._watch = watch
        self.fault = False  # a wheel with a fault takes only a reset and a zero current
        self.damaged = 0
        self.mode = IDLE
        self.command_A = 0.0
        self.speed_reference_rad_s = 0.0
        self._serial_number = serial_number
        self._max_current_A = max_current_A if max_current_A is not None else wire_map.current_range_A[1]
        self._uptime_zero_s = plant.time_s - first_uptime_s
        self._flags = FLAG_RESET
        self._integral_A = 0.0
        self._loop_due_s = plant.time_s
        self._rest = b""
        self._codec = wire_map.codec()

    def handle(self, received: bytes, time_s: float) -> list[Reply]:
        """Replies to bytes whose last one arrived at `time_s` of the plant's clock. Damaged frames get none."""
        self.advance_to(time_s)
        if self._spoilt.is_dead(time_s):
            self._rest = b""
            return []
        decoded = self._codec.requests(self._rest + received)
        self._rest = decoded.rest
        self.damaged += decoded.damaged
        replies: list[Reply] = []
        for frame in decoded.frames:
            self._watch(frame)
            register = self.wire_map.register_of_id(frame.id)
            data = self._answer(frame, register)
            if data is not None:
                answer = self._spoilt.reply(frame, register, data, time_s)
                content = self._codec.reply(answer)
                if content:
                    replies.append(Reply(content, register.name if register else None))
        return replies

    def advance_to(self, time_s: float) -> None:
        """Let the wheel run; in speed mode its own loop commands the current, unheard it lets go by its watchdog."""
        if self.watchdog_s is not None and self.command_A != 0.0 and self._commanded_s + self.watchdog_s <= time_s:
            self.plant.advance_to(self._commanded_s + self.watchdog_s)
            self._drive(0.0)
        while self.mode == SPEED and self._loop_due_s <= time_s:
            self.plant.advance_to(self._loop_due_s)
            self._close_speed_loop()
            self._loop_due_s += SPEED_LOOP_S
        self.plant.advance_to(time_s)
        self._spoilt.happen(self, time_s)

    def unsolicited(self, time_s: float) -> list[Reply]:
        """What the wheel says at `time_s` unprompted: nothing, on a line of registers."""
        return []

    def next_unsolicited_s(self, time_s: float) -> float:
        """When it next does; infinity: never."""
        return math.inf

    def jump_clock(self, by_s: float) -> None:
        """The uptime continues from another value."""
        self._uptime_zero_s -= by_s

    def restart(self) -> None:
        """The electronics restart: idle, no current, uptime from zero, the flag that says so. The wheel turns on."""
        self.mode, self.command_A, self.speed_reference_rad_s = IDLE, 0.0, 0.0
        self.fault = False
        self.plant.clear_commands()
        self._flags = FLAG_RESET
        self._uptime_zero_s = self.plant.time_s

    # --- requests -----------------------------------------------------------------------------------------------

    def _answer(self, frame: Frame, register: Register | None) -> bytes | None:
        """The data of the reply to one good frame; None where the protocol gives none."""
        if self.wire_map.is_write_id(frame.id):
            return bytes((self._write_status(frame, register),))
        if register is None or frame.data:
            return None
        reported = self._spoilt.telemetry(register, self._telemetry(register), self.plant.time_s)
        return encode_saturated(register, reported)

    def _write_status(self, frame: Frame, register: Register | None) -> int:
        """Do a write, unless a fault refuses it; the status of its reply."""
        if register is None:
            return UNKNOWN_ID
        refusal = self._spoilt.refusal(register.name, self.plant.time_s)
        if refusal is not None and not refusal.acts:
            return refusal.status
        done = self._write(register, frame.data)
        if done == OK:
            self._commanded_s = self.plant.time_s
        return done if refusal is None else refusal.status

    def _write(self, register: Register, data: bytes) -> int:
        """Do what a write commands; the status of its reply."""
        if len(data) != register.size:
            return WRONG_LENGTH
        values = decode_register(register, data)
        if any(
            field.constant is not None and values[field.name] != field.to_si(field.constant)
            for field in register.fields
        ):
            return OUT_OF_RANGE
        if register.name == "reset":
            self.restart()
            return OK
        value = next(iter(values.values()), float(IDLE))
        if register.name == "current_command":
            return self._command_current(value)
        if self.fault:
            return REFUSED
        if register.name == "speed_reference":
            self.speed_reference_rad_s = value
            self._enter(SPEED)
        elif register.name == "mode":
            if value not in {IDLE, CURRENT, SPEED}:
                return OUT_OF_RANGE
            self._enter(int(value))
        return OK

    def _command_current(self, current_A: float) -> int:
        """Enter current mode with this current, held until the next."""
        if abs(current_A) > self._max_current_A + 1.0e-12:
            return OUT_OF_RANGE
        if self.fault and current_A != 0.0:
            return REFUSED
        self.mode = CURRENT
        self._drive(self._spoilt.in_force(current_A, self.plant.time_s))
        return OK

    def _enter(self, mode: int) -> None:
        """Change the mode; entering speed mode starts its loop afresh, every other change starts without current."""
        if mode == SPEED and self.mode != SPEED:
            self._integral_A, self._loop_due_s = 0.0, self.plant.time_s
        elif mode != self.mode:
            self._drive(0.0)
        self.mode = mode

    def _drive(self, current_A: float) -> None:
        """Let a current take force now."""
        self.command_A = current_A
        self.plant.command(current_A)
        self.plant.advance_to(self.plant.time_s)

    def _close_speed_loop(self) -> None:
        """One step of the proportional and integral control of speed mode, with the integral held at the limit."""
        error = self.speed_reference_rad_s - self.plant.speed_rad_s
        wanted_A = SPEED_GAIN_A_S_RAD * error + self._integral_A
        current_A = min(max(wanted_A, -self._max_current_A), self._max_current_A)
        if current_A == wanted_A:
            self._integral_A += SPEED_INTEGRAL_A_RAD * error * SPEED_LOOP_S
            self._flags &= ~FLAG_LIMITED
        else:
            self._flags |= FLAG_LIMITED
        self._drive(current_A)

    # --- telemetry ----------------------------------------------------------------------------------------------

    def _telemetry(self, register: Register) -> dict[str, float]:
        """SI values of what the register may carry, at the plant's time."""
        plant = self.plant
        values = {
            "current": self.plant.flowing_A,
            "current_command": self.command_A,
            "speed_reference": self.speed_reference_rad_s,
            "temperature": plant.state.temperature_degC,
            "pressure": VACUUM_PA,
            "bus_voltage": BUS_V,
            "angle": plant.state.angle_rad,
            "uptime": plant.time_s - self._uptime_zero_s,
            "mode": float(self.mode),
            "type": float(WHEEL_TYPE),
            "version": float(WHEEL_VERSION),
            "serial_number": float(self._serial_number),
        }
        if register.field("speed"):
            values["speed"] = plant.read_speed()
        if register.field("flags"):
            values["flags"] = float(self._take_flags())
        return values

    def _take_flags(self) -> int:
        """The status flags; reading them clears "reset since last read"."""
        hot = self.plant.state.temperature_degC > self.hottest_degC
        flags = self._flags | (FLAG_FAULT if self.fault else 0) | (FLAG_OVER_TEMPERATURE if hot else 0)
        self._flags &= ~FLAG_RESET
        return flags
