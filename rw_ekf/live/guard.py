"""The one place that may write a current to a wheel (docs/contract.md#safety).

Finite, clamped, slew-limited; above the speed limit only what brakes, above the temperature limit only zero. A request
that is refused becomes zero or the nearest allowed current, never a kept old one. Zero is exempt from slew. What brakes
is judged by what the speed did: a current that should, and under which the speed grew, becomes zero.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from rw_ekf.clock import Clock
from rw_ekf.driver import ACTED_THOUGH, TIMEOUT, ZERO_BY_MODE, ZERO_BY_RESET, WheelDriver
from rw_ekf.errors import DriverError
from rw_ekf.records import IssuedCommand, WheelSample
from rw_ekf.units import rad_s_from_rpm

if TYPE_CHECKING:
    from rw_ekf.settings.schema import LimitsSection

Say = Callable[[str, str], None]  # an event and its sentence

_ZERO_RETRY_S = 0.05
_CONFIRMED_WITHIN_S = 0.5
_INSTEAD = {ZERO_BY_MODE: "its mode was set to idle instead", ZERO_BY_RESET: "it was reset instead"}
_BRAKE_STEPS = 6.0
BRAKE_ACCELERATES = "brake_accelerates"


@dataclass(frozen=True)
class SafetyLimits:
    """Limits in SI; none may be exceeded by a written current."""

    current_A: float
    slew_A_per_s: float
    speed_rad_s: float
    temperature_degC: float
    silence_s: float
    safe_after_s: float | None = 5.0  # None: no silence is too long to go on after it

    @classmethod
    def of(cls, section: LimitsSection) -> SafetyLimits:
        """From the `limits` of a configuration."""
        return cls(
            section.current_A,
            section.slew_A_per_s,
            rad_s_from_rpm(section.speed_rpm),
            section.temperature_degC,
            section.silence_s,
            None if section.safe_after_s is None else max(section.safe_after_s, section.silence_s),
        )


def allowed_current(
    requested_A: float,
    previous_A: float,
    elapsed_s: float,
    speed_rad_s: float | None,
    temperature_degC: float | None,
    limits: SafetyLimits,
) -> tuple[float, str | None]:
    """Current that may be written in place of `requested_A`, and why it differs (None where it does not).

    previous_A: the last current written, elapsed_s ago; speed and temperature: the last known, None if never measured.
    """
    if not math.isfinite(requested_A):
        return 0.0, "not_finite"
    if speed_rad_s is not None and math.isnan(speed_rad_s):  # no current brakes for certain
        return 0.0, None if requested_A == 0.0 else "over_speed"
    if temperature_degC is not None and not temperature_degC <= limits.temperature_degC:
        return 0.0, None if requested_A == 0.0 else "over_temperature"
    reason = None
    current = requested_A
    if speed_rad_s is not None and not abs(speed_rad_s) <= limits.speed_rad_s and current * speed_rad_s >= 0.0:
        return 0.0, None if requested_A == 0.0 else "over_speed"
    if abs(current) > limits.current_A:
        current = math.copysign(limits.current_A, current)
        reason = "clamped"
    step = limits.slew_A_per_s * max(elapsed_s, 0.0)
    if current != 0.0 and abs(current - previous_A) > step:
        current = previous_A + math.copysign(step, current - previous_A)
        reason = "slew"
        # The start of the ramp may lie outside what is allowed now, if the limits close in on it.
        current = max(-limits.current_A, min(limits.current_A, current))
        if speed_rad_s is not None and abs(speed_rad_s) > limits.speed_rad_s and current * speed_rad_s > 0.0:
            current = 0.0
    return current, reason


class BrakeCheck:
    """Above the speed limit: whether the current that should brake does.

    While a current against the direction of motion is in force, the speed may not come to lie further above the least
    it has been under it than six steps of a reading. Where it does, the sign of the wire map is wrong, or something
    stronger than the motor drives the wheel: no current is the safe one until the speed is below the limit again.
    """

    def __init__(self, limit_rad_s: float, step_rad_s: float) -> None:
        self._limit = limit_rad_s
        self._margin = _BRAKE_STEPS * step_rad_s
        self._braking_A = 0.0
        self._least: float | None = None  # speed since the brake is on [rad/s]
        self._failed = False

    def works(self, speed_rad_s: float, current_A: float) -> bool:
        """Whether `current_A` may be written at this reading, as far as braking goes."""
        speed = abs(speed_rad_s)
        if not speed > self._limit:
            self._failed, self._least = False, None
            return True
        if self._braking_A * speed_rad_s < 0.0:
            self._least = speed if self._least is None else min(self._least, speed)
            self._failed = self._failed or speed > self._least + self._margin
        else:
            self._least = None
        if current_A * speed_rad_s < 0.0 and self._least is None:
            self._least = speed  # from here on it brakes
        return not (self._failed and current_A != 0.0)

    def written(self, current_A: float) -> None:
        """Note what was written."""
        self._braking_A = current_A


class CurrentGuard:
    """Writes currents to one wheel, and knows what was written last. No other code calls `command_current`."""

    def __init__(
        self,
        driver: WheelDriver,
        limits: SafetyLimits,
        clock: Clock,
        speed_step_rad_s: float = 0.0,
        say: Say = lambda event, text: None,
    ) -> None:
        """speed_step_rad_s: noise or resolution of a speed reading, whichever is larger. say: takes what was found."""
        self.driver = driver
        self.limits = limits
        self._brake = BrakeCheck(limits.speed_rad_s, speed_step_rad_s)
        self._clock = clock
        self._say = say
        self._zero_by: str | None = None
        self._previous_A = 0.0
        self._written_at_s = clock.monotonic()
        self._speed_rad_s: float | None = None
        self._temperature_degC: float | None = None
        self.doubtful = False  # True: the last write was not confirmed; it may be in force or not

    def write(self, requested_A: float, sample: WheelSample, hold: str | None = None) -> IssuedCommand:
        """Write what is allowed of a request made on `sample`.

        A current that nobody confirmed may be in force: it is written again only where telemetry will not say which one
        is (the driver has asked, or the next sample tells). Zero is written again in any case. hold: why nothing but
        zero may be written now, whatever is asked for. Raises DriverError when the line is lost. An unconfirmed command
        reports the current before it, which is the one that most likely still holds.
        """
        if sample.speed_rad_s is not None:
            self._speed_rad_s = sample.speed_rad_s
        if sample.temperature_degC is not None:
            self._temperature_degC = sample.temperature_degC
        self._believe_telemetry(sample.current_command_A)
        now = self._clock.monotonic()
        current, reason = allowed_current(
            requested_A,
            self._previous_A,
            now - self._written_at_s,
            self._speed_rad_s,
            self._temperature_degC,
            self.limits,
        )
        if hold is not None and requested_A != 0.0:
            current, reason = 0.0, hold
        elif sample.speed_rad_s is not None and not self._brake.works(sample.speed_rad_s, current):
            current, reason = 0.0, BRAKE_ACCELERATES
        self._brake.written(current)
        issued = self._send(current)
        if not issued.acknowledged and (current == 0.0 or sample.current_command_A is None):
            issued = self._send(current)
        self._written_at_s = now
        if current != 0.0 and _is_refused(issued):
            # The wheel answers that it will not: the old current must not stay in its place.
            refusal, issued = issued.reason, self._send(0.0)
            reason = refusal or "refused"
        elif current != 0.0 and issued.reason is not None:
            reason = issued.reason
        self.doubtful = not issued.acknowledged
        if not issued.acknowledged:
            return IssuedCommand(self._previous_A, issued.delay_s, False, issued.reason or "unconfirmed")
        self._previous_A = issued.current_A
        return IssuedCommand(issued.current_A, issued.delay_s, True, reason)

    def zero(self, within_s: float = _CONFIRMED_WITHIN_S) -> bool:
        """Write zero until the wheel confirms it or `within_s` is over; True if confirmed. Never raises."""
        end = self._clock.monotonic() + within_s
        while True:
            try:
                # Confirmed or not, the way back up starts from zero.
                self._previous_A, self._written_at_s = 0.0, self._clock.monotonic()
                self._brake.written(0.0)
                self.doubtful = not self._send(0.0).acknowledged
                if not self.doubtful:
                    return True
            except DriverError:
                self.doubtful = True
                return False
            if self._clock.monotonic() >= end:
                return False
            self._clock.sleep(_ZERO_RETRY_S)

    def _believe_telemetry(self, in_force_A: float | None) -> None:
        """Slew from what the wheel says is in force: it may have restarted, or taken what it never confirmed."""
        if in_force_A is not None and math.isfinite(in_force_A):
            self._previous_A = in_force_A

    def _send(self, current_A: float) -> IssuedCommand:
        if current_A != 0.0:
            return self.driver.command_current(current_A)
        issued = self.driver.stop_current()
        by = issued.reason if issued.reason in _INSTEAD else None
        if by is not None and by != self._zero_by:
            self._say(by, f"the wheel refused a current of zero: {_INSTEAD[by]}")
        self._zero_by = by
        return issued


def zero_and_close(
    driver: WheelDriver,
    limits: LimitsSection,
    clock: Clock,
    within_s: float = _CONFIRMED_WITHIN_S,
    say: Say = lambda event, text: None,
) -> bool:
    """Zero from outside the loop, over a line that is closed behind it, as `CurrentGuard.zero`."""
    try:
        return CurrentGuard(driver, SafetyLimits.of(limits), clock, say=say).zero(within_s)
    finally:
        driver.close()


def _is_refused(issued: IssuedCommand) -> bool:
    """Whether the wheel said that it will not have a current, and, as far as is known, has not taken it."""
    reason = issued.reason
    if reason is None:
        return not issued.acknowledged
    return reason != TIMEOUT and not reason.startswith(ACTED_THOUGH)
