"""What a person sees of a run while it lasts: one line of a terminal that changes, elsewhere one a minute."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

from rw_ekf.clock import Clock
from rw_ekf.console import STATUS
from rw_ekf.model.state import PARAMETER_NAMES, STATE_UNITS
from rw_ekf.records import Outcome, RunState, Tick, WheelSample
from rw_ekf.units import rpm_from_rad_s

if TYPE_CHECKING:
    from rw_ekf.control.commanders import Phase

LEGEND = (
    "k motor gain [rad/s^2/A], c Coulomb [rad/s^2], b viscous [1/s], s break-away friction [rad/s^2]; "
    "15.21(3): a sigma of 3 in the last digit"
)
_SYMBOLS = (  # the most telling first: a narrow terminal shows fewer
    ("k", "motor_gain"),
    ("c", "coulomb"),
    ("b", "viscous"),
    ("s", "static"),
)
_STATES = {
    Outcome.FIRST: "begins",
    Outcome.UPDATED: "tracking",
    Outcome.MISSING: "no reply",
    Outcome.GATED: "rejected",
    Outcome.REPEATED: "repeated",
    Outcome.BACKWARD: "repeated",
    Outcome.RESEEDED: "reseeded",
}
_FIRST_LOG_S = 8.0  # without a terminal: nobody waits longer than ten seconds to see that it lives
_LONGEST_GAP_S = 60.0  # a wheel's clock that leaps by more is not time that went by


class StatusLine:
    """Shows elapsed and total time, the profile's phase, state, speed, current, estimates and alarms."""

    def __init__(
        self,
        logger: Any,
        clock: Clock,
        total_s: Callable[[], float | None],
        phase: Phase | None = None,
        *,
        every_s: float = 0.5,
        log_every_s: float = 60.0,
        label: str = "",
    ) -> None:
        """logger: takes the line a minute where there is no terminal; phase: of the profile, by its time [s].

        label: what the line begins with, where it is shown in turn with those of other wheels.
        """
        self._label = f"{label} " if label else ""
        self._logger = logger
        self._clock = clock
        self._total_s = total_s
        self._phase = phase
        self._every_s = every_s if STATUS.is_terminal else log_every_s
        self._due_s = clock.monotonic() + (0.0 if STATUS.is_terminal else min(_FIRST_LOG_S, log_every_s))
        self._elapsed_s = 0.0
        self._last: WheelSample | None = None
        self._explained = False

    def write(self, tick: Tick) -> None:
        """Show the present estimate where it is due."""
        sample = tick.sample
        if self._last is not None and sample.segment == self._last.segment:
            step_s = sample.time_s - self._last.time_s
            self._elapsed_s += step_s if 0.0 < step_s < _LONGEST_GAP_S else 0.0
        self._last = sample
        now = self._clock.monotonic()
        if now < self._due_s:
            return
        self._due_s = now + self._every_s
        if STATUS.is_terminal:
            if not self._explained:
                self._explained = True
                STATUS.say("\n".join(textwrap.wrap(LEGEND, STATUS.columns() - 1, break_on_hyphens=False)))
            STATUS.show(status_text(self._fields(tick), STATUS.columns() - 1))
        else:
            self._log(tick)

    def close(self) -> None:
        """Leave the last line where it is, and the cursor below it."""
        STATUS.leave()

    def _fields(self, tick: Tick) -> list[str]:
        """What can be shown, in the order of a line's beginning: head first, estimates last."""
        count, estimate = len(tick.alarms), tick.estimate
        state, std = estimate.state, estimate.std
        current = "" if tick.command is None else f"{1e3 * tick.command.current_A:+.1f} mA"
        return [
            self._label + elapsed_text(self._elapsed_s, self._total_s()),
            _state_word(tick),
            f"{rpm_from_rad_s(state.speed_rad_s):+.1f} rpm",
            current,
            f"{count} alarm{'s' if count > 1 else ''}" if count else "",
            "" if self._phase is None else self._phase(self._elapsed_s),
            *(f"{symbol} {concise(getattr(state, name), getattr(std, name))}" for symbol, name in _SYMBOLS),
        ]

    def _log(self, tick: Tick) -> None:
        state, std = tick.estimate.state, tick.estimate.std
        reported: dict[str, Any] = {"elapsed_s": round(self._elapsed_s, 1), "of_s": self._total_s()}
        if self._phase is not None:
            reported["phase"] = self._phase(self._elapsed_s)
        reported |= {"state": _state_word(tick), "speed_rpm": round(rpm_from_rad_s(state.speed_rad_s), 2)}
        if tick.command is not None:
            reported["current_mA"] = round(1e3 * tick.command.current_A, 1)
        for name in PARAMETER_NAMES:
            reported[name] = f"{concise(getattr(state, name), getattr(std, name))} {STATE_UNITS[name]}"
        reported["alarms"] = len(tick.alarms)
        self._logger.info("running", **{key: value for key, value in reported.items() if value is not None})


def _state_word(tick: Tick) -> str:
    """State of the run where it is not TRACKING, in capitals; else what became of the sample."""
    if tick.state is None or tick.state.state is RunState.TRACKING:
        return _STATES[tick.estimate.outcome]
    return tick.state.state.value


def status_text(fields: Sequence[str], width: int) -> str:
    """As many of the fields, the foremost first, as fit into `width` columns; the first is cut rather than left out."""
    line = ""
    for field in fields:
        longer = f"{line}  {field}" if line and field else line + field
        if len(longer) <= width:
            line = longer
        elif not line:
            return field[:width]
    return line


def elapsed_text(elapsed_s: float, total_s: float | None) -> str:
    """`12/600 s`, or `12 s` of a run without an end."""
    return f"{elapsed_s:.0f} s" if total_s is None else f"{elapsed_s:.0f}/{total_s:.0f} s"


def concise(value: float, std: float) -> str:
    """`15.21(3)`: the value to the place of sigma's first digit, and that digit."""
    if not (math.isfinite(value) and math.isfinite(std)) or std <= 0.0:
        return f"{value:.4g}"
    place = -math.floor(math.log10(std))
    if round(std * 10.0**place) >= 10:
        place -= 1
    if place <= 0:
        return f"{round(value, place):.0f}({round(std, place):.0f})"
    if place > 7:
        return f"{value:.4g}"
    return f"{value:.{place}f}({round(std * 10.0**place):d})"
