"""The one place that may write a current to a wheel (docs/contract.md#safety).

Finite, clamped, slew-limited; above the speed limit only what brakes, above the temperature limit only zero. A request
that is refused becomes zero or the nearest allowed current, never a kept old one. Zero is exempt from slew. What brakes
is judged by what the speed did: a current that should, and under which the speed grew, becomes zero.

Whatever telemetry says, what is written lies between zero, what was written last, and what is requested. A zero that is
acknowledged is not yet one that is in force: it is read back, and seen in the motion, or else enforced by other
registers (`stand_down`, and while nothing but zero is written).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple

from rw_ekf.clock import Clock
from rw_ekf.driver import ZERO_BY_MODE, ZERO_BY_RESET, WheelDriver
from rw_ekf.errors import DriverError
from rw_ekf.live.command_acceptance import Heeding, is_refused
from rw_ekf.live.zero_in_force import COURSE, Slowing, ZeroSight
from rw_ekf.records import IssuedCommand, WheelSample
from rw_ekf.units import rad_s_from_rpm

if TYPE_CHECKING:
    from rw_ekf.settings.schema import LimitsSection

Say = Callable[[str, str], None]  # an event and its sentence

_ZERO_RETRY_S = 0.05
_CONFIRMED_WITHIN_S = 0.5
STAND_DOWN_S = 2.0  # as long a wheel takes that does not answer: tried twice, the second time for a second
_INSTEAD = {ZERO_BY_MODE: "its mode was set to idle instead", ZERO_BY_RESET: "it was reset instead"}
_WAYS = ("", ZERO_BY_MODE, ZERO_BY_RESET)  # to zero, the gentlest first
_TRIES = 3  # of another register: three in a row are lost once in 46 on a line that loses 15 % each way
_WATCHED_S = 0.6  # a zero before it is called confirmed: a wheel under 0.1 A changes its speed by some 8 rpm in it
_LOOK_EVERY_S = 0.1
_LEAST_LOOKS, _MOST_LOOKS = 3, 15  # readings; tries, where some are lost
NOT_IN_FORCE, NOT_REPORTED = "zero_not_in_force", "zero_not_told"
LIMIT_LOWERED = "speed_limit_lowered"
_STATED_BELOW = 0.9  # share of the speed limit; from 1 on it counts as whole again
_BRAKE_STEPS = 6.0
_OTHER_MAY = 1.15  # of the speed limit, by charge: what its own errors may come to on a healthy wheel near the limit
_USUAL_STEP_RAD_S = rad_s_from_rpm(1.0)  # of a reading, where no configuration says it
BRAKE_ACCELERATES = "brake_accelerates"


@dataclass(frozen=True)
class SafetyLimits:
    """Limits in SI; none may be exceeded by a written current."""

    current_A: float
    slew_A_per_s: float
    speed_rad_s: float
    temperature_degC: float
    silence_s: float
    safe_after_s: float | None = 5.0  # None: no silence is too long to continue after it

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


class SpeedLimit(NamedTuple):
    """What else is held against the speed limit, besides the reading."""

    other_rad_s: float | None = None  # the speed by the charge that was written
    share: float = 1.0  # of the limit that counts for readings: below 1 where the gain is smaller than it should be


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
        self.speed_limit: Callable[[], SpeedLimit] = SpeedLimit
        self._brake = BrakeCheck(limits.speed_rad_s, speed_step_rad_s)
        self._clock = clock
        self._say = say
        self._zero_by: str | None = None
        self.slowing: Slowing = lambda speed_rad_s: None
        self._sight = ZeroSight(limits.current_A, speed_step_rad_s, lambda at: self.slowing(at))  # noqa: PLW0108
        self._way = 0  # of _WAYS, that was tried last
        self._is_lowered = False
        self._written_A = 0.0  # the last that went out
        self._previous_A = 0.0  # that is in force, as far as is known
        self._written_at_s = clock.monotonic()
        self._speed_rad_s: float | None = None
        self._temperature_degC: float | None = None
        self._heeding = Heeding(limits.silence_s)
        self._let_go_again_s = -math.inf  # in the place of a zero that nobody confirms
        self.doubtful = False  # True: the last write was not confirmed; it may be in force or not

    def write(self, requested_A: float, sample: WheelSample, hold: str | None = None) -> IssuedCommand:
        """Write what is allowed of a request made on `sample`.

        A current that nobody confirmed may be in force: it is written again only where telemetry will not say which one
        is (the driver has queried, or the next sample reports it). Zero is written again in any case. hold: why nothing
        but zero may be written now, whatever is requested. Raises DriverError when the line is lost. An unconfirmed
        command reports the current before it, which is the one that most likely still holds.
        """
        if sample.speed_rad_s is not None:
            self._speed_rad_s = sample.speed_rad_s
        if sample.temperature_degC is not None:
            self._temperature_degC = sample.temperature_degC
        now = self._clock.monotonic()
        current, reason = self._allowed(requested_A, self._ramp_start_A(sample.current_command_A), now)
        if hold is not None and requested_A != 0.0:
            current, reason = 0.0, hold
        elif sample.speed_rad_s is not None and not self._brake.works(sample.speed_rad_s, current):
            current, reason = 0.0, BRAKE_ACCELERATES
        elif current != 0.0 and self._heeding.is_over(now):  # whatever it carries, it must not keep
            current, reason = 0.0, self._heeding.why
        self._brake.written(current)
        self._look(sample, current, held=hold is not None)
        issued = self._send(current)
        if not issued.acknowledged and (current == 0.0 or sample.current_command_A is None):
            issued = self._send(current)
        self._written_at_s = now
        unheeded = self._heeding.is_over(now)
        self._heeding.note(current, issued, now)
        heeded = not unheeded and self._heeding.why is None
        if current != 0.0 and is_refused(issued):
            # The wheel answers that it will not: the old current must not stay in its place.
            refusal, issued = issued.reason, self._send(0.0)
            reason = refusal or "refused"
        elif current != 0.0 and issued.reason is not None:
            reason = issued.reason
        if not issued.acknowledged and self._heeding.is_over(now) and now >= self._let_go_again_s:
            self._let_go_again_s = now + self.limits.silence_s
            self._previous_A = 0.0 if self._stop(ZERO_BY_MODE).acknowledged else self._previous_A
        self.doubtful = not issued.acknowledged
        if not issued.acknowledged:
            return IssuedCommand(self._previous_A, issued.delay_s, False, issued.reason or "unconfirmed", heeded)
        self._previous_A = issued.current_A
        return IssuedCommand(issued.current_A, issued.delay_s, True, reason, heeded)

    def zero(self, within_s: float = _CONFIRMED_WITHIN_S) -> bool:
        """Write zero until the wheel confirms it or `within_s` is over; True if confirmed. Never raises."""
        end = self._clock.monotonic() + within_s
        while True:
            try:
                # Confirmed or not, the way back up starts from zero.
                self._previous_A, self._written_at_s = 0.0, self._clock.monotonic()
                self._brake.written(0.0)
                issued = self._send(0.0)
                self.doubtful = not (issued.acknowledged and issued.current_A == 0.0)
                if not self.doubtful:
                    return True
            except DriverError:
                self.doubtful = True
                return False
            if self._clock.monotonic() >= end:
                return False
            self._clock.sleep(_ZERO_RETRY_S)

    def stand_down(self, within_s: float = _CONFIRMED_WITHIN_S) -> bool:
        """Zero, True only if the wheel confirmed it and the readings behind it show nothing else. Never raises.

        Where they do, idle mode is tried, then a reset; where telemetry reports no current, idle mode in any case, for
        no motion distinguishes a small current from none, and a wheel that has no such mode must slow down as its
        friction has it. Takes 0.6 s of readings, and so much again for each way.
        """
        is_unreported = False  # it reports no current, and nothing spoke against the zero
        try:
            for way in range(len(_WAYS)):
                done = self.zero(within_s) if way == 0 else any(self._let_go(way) for _ in range(_TRIES))
                seen = done and self._is_seen(briefly=way == 0)
                if seen and (way > 0 or not self._sight.is_unreported):
                    return True
                against = self._sight.against or self._sight.goes_on
                if against is not None:
                    self._say(NOT_IN_FORCE, f"the wheel acknowledged a current of zero, but {against}")
                elif is_unreported and not done:
                    return self._rests()
                elif not seen and (done or way > 0):  # no readings, or no answer: no other register helps that
                    return False
                is_unreported = seen
        except DriverError:
            pass
        return False

    def _rests(self) -> bool:
        """Whether a wheel that reports no current, with no idle mode, comes to rest by its motion; else a log entry."""
        if self._is_seen() and self._sight.rests:
            return True
        unreported = (
            "telemetry tells none, the wheel turns, and how it slows down does not exclude that a smaller one is left "
            "on; it takes no idle mode either"
        )
        against = self._sight.against or self._sight.goes_on or unreported
        self._say(NOT_REPORTED, f"the wheel acknowledged a current of zero, but {against}")
        return False

    def _allowed(self, requested_A: float, start_A: float, now: float) -> tuple[float, str | None]:
        """What may be written by every speed that the wheel may have."""
        bound = self.speed_limit()
        self._tell(bound.share)
        limits = replace(self.limits, speed_rad_s=self.limits.speed_rad_s * min(bound.share, 1.0))
        elapsed_s, heat = now - self._written_at_s, self._temperature_degC
        current, reason = allowed_current(requested_A, start_A, elapsed_s, self._speed_rad_s, heat, limits)
        other = bound.other_rad_s
        if other is not None and abs(other) > _OTHER_MAY * self.limits.speed_rad_s and current * other > 0.0:
            return 0.0, "over_speed"
        return current, reason

    def _tell(self, share: float) -> None:
        """Say it once where not all of the speed limit counts, whatever the reason for a current is then."""
        if share < _STATED_BELOW and not self._is_lowered:
            self._say(
                LIMIT_LOWERED,
                "the currents move the speed readings less than expected, or than they did in this run: the scale of "
                f"the readings may have become smaller, so {share:.0%} of limits.speed_rpm count",
            )
        self._is_lowered = share < (1.0 if self._is_lowered else _STATED_BELOW)

    def _ramp_start_A(self, reported_A: float | None) -> float:
        """Where the slew begins: what is in force as telemetry has it, but between zero and what was written last.

        A wheel that restarted carries zero; one that never confirmed the last command may carry that or the one before.
        """
        start = self._previous_A if reported_A is None or not math.isfinite(reported_A) else reported_A
        return min(max(start, min(0.0, self._written_A)), max(0.0, self._written_A))

    def _look(self, sample: WheelSample, current_A: float, *, held: bool) -> None:
        """While nothing but zero is written: whether it is in force. Raises DriverError when the line is lost.

        held: nothing else may be. A profile may let a wheel coast that hardly slows down.
        """
        if current_A != 0.0 or self._written_A != 0.0 or self.doubtful:
            self._sight.begin()
            self._way = 0
            return
        self._sight.add(sample)
        against = self._sight.against or (self._sight.goes_on if held else None)
        if against is not None and self._way + 1 < len(_WAYS):  # each way once: a wheel is not reset for ever
            self._say(NOT_IN_FORCE, f"the wheel acknowledged a current of zero, but {against}")
            self._way += 1
            self._let_go(self._way)

    def _let_go(self, way: int) -> bool:
        """Enforce zero by another register; whether the wheel took it."""
        self._sight.begin()
        return self._stop(_WAYS[way]).acknowledged

    def _stop(self, *by: str) -> IssuedCommand:
        return self.driver.stop_current(*by)

    def _is_seen(self, *, briefly: bool = False) -> bool:
        """Whether the next readings are those of a wheel without a current: of half a second, or until it slows.

        briefly: no longer than that; whether it slows is seen later.
        """
        self._sight.begin()
        end = self._clock.monotonic() + _WATCHED_S
        for looks in range(1, COURSE + _MOST_LOOKS + 1):
            sample = self.driver.read(_LOOK_EVERY_S)
            if sample is not None:
                self._sight.add(sample)
            enough = self._clock.monotonic() >= end and self._sight.readings >= _LEAST_LOOKS
            open_still = self._sight.is_open and self._sight.goes_on is None and not briefly
            if (enough or looks >= _MOST_LOOKS) and not open_still:
                break
            self._clock.sleep(_LOOK_EVERY_S)
        seen = self._sight.against is None and self._sight.goes_on is None and (briefly or not self._sight.is_open)
        return self._sight.readings >= _LEAST_LOOKS and seen

    def _send(self, current_A: float) -> IssuedCommand:
        self._written_A = current_A
        if current_A != 0.0:
            return self.driver.command_current(current_A)
        issued = self._stop()
        if self._way > 0:  # such a zero was not in force, and takes the wheel out of idle mode again
            idle = self._stop(ZERO_BY_MODE)
            return idle if idle.acknowledged else issued
        by = issued.reason if issued.reason in _INSTEAD else None
        if by is not None and by != self._zero_by:
            self._say(by, f"the wheel refused a current of zero: {_INSTEAD[by]}")
        self._zero_by = by
        return issued


def zero_each(
    wheels: Sequence[tuple[Callable[[WheelDriver | None], WheelDriver], LimitsSection]],
    clock: Clock,
    within_s: float = _CONFIRMED_WITHIN_S,
    say: Say = lambda event, text: None,
) -> list[bool]:
    """Zero from outside the loop to each wheel of a line; whether each confirmed it, as `CurrentGuard.stand_down`.

    wheels: what opens each, and its limits; the line is closed behind it. Zero goes to all of them before any is waited
    for. Raises DriverError where the line cannot be opened.
    """
    for open_wheel, limits in wheels if len(wheels) > 1 else ():
        with closing(open_wheel(None)) as driver:
            CurrentGuard(driver, SafetyLimits.of(limits), clock, _USUAL_STEP_RAD_S).zero(within_s=0.0)
    confirmed = []
    for open_wheel, limits in wheels:
        with closing(open_wheel(None)) as driver:
            guard = CurrentGuard(driver, SafetyLimits.of(limits), clock, _USUAL_STEP_RAD_S, say)
            confirmed.append(guard.stand_down(within_s))
    return confirmed
