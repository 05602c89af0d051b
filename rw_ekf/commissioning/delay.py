"""How late a command acts, by pulses in which the wheel continues to turn one way; how often readings are new."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import Any

import numpy as np

from rw_ekf.commissioning.commissioning_moves import to_rest, toggled
from rw_ekf.commissioning.dialogue import RefusedError
from rw_ekf.commissioning.guarded_wheel import Row
from rw_ekf.commissioning.motion_fit import fit_late_motion
from rw_ekf.commissioning.step_context import Work
from rw_ekf.numbers import plus_minus
from rw_ekf.units import rpm_from_rad_s

_FASTEST_HZ = 40.0
_TURNS_OF_REPLIES = 0.4  # of a turn of the loop that a reply may take
_SHARE_OF_LIMIT, _AROUND_RAD_S = 0.25, 40.0
_MOST_SHARE = 0.8  # of the current limit
_HALF_S, _LASTS_S, _AT_MOST_S, _REST_AT_MOST_S = 0.6, 15.0, 60.0, 90.0


def find_delay(work: Work) -> dict[str, Any]:
    """Drive pulses; what they show. Raises RefusedError where the current limit leaves nothing beside friction."""
    still, sign, limits = work.still, work.progress["sign"], work.progress["limits"]
    gain, coulomb, most_A = sign["motor_gain"], sign["coulomb"], _MOST_SHARE * limits["current_A"]
    around = max(min(_SHARE_OF_LIMIT * work.speed_limit_rad_s, _AROUND_RAD_S), 4.0 * still.rest_rad_s)
    change = min(gain * most_A - coulomb, (around - 1.5 * still.rest_rad_s) / _HALF_S)
    if change <= 0.0:
        raise RefusedError(
            f"the current limit, {limits['current_A']:.3g}, hardly overcomes friction: give a larger one"
        )
    rate_hz = min(_FASTEST_HZ, _TURNS_OF_REPLIES / (1e-3 * still.read_ms))
    with work.at_the_wheel(rate_hz=rate_hz, ceiling_rad_s=3.0 * around) as bench:
        rows = bench.run(toggled(around, change, gain, coulomb, _HALF_S, _LASTS_S), _AT_MOST_S)
        bench.run(to_rest(still.rest_rad_s, 0.5 * limits["current_A"]), _REST_AT_MOST_S)
    fit, delay = fit_late_motion(rows, still.rest_rad_s)
    line_ms = 1e3 * float(np.median([row.delay_s for row in rows]))
    every_ms = 1e3 * _new_every_s(rows)
    text = (
        "the pulses do not show how late a command acts"
        if delay is None
        else f"a command acts {plus_minus(1e3 * delay.delay_s, 1e3 * delay.std_s)} ms later than the line takes "
        f"({line_ms:.0f} ms after the reading)"
    )
    text += f"; at {rate_hz:.3g} Hz a reading is new every {every_ms:.3g} ms"
    work.dialogue.say("delay", text)
    return {
        "rate_hz": rate_hz,
        "line_ms": line_ms,
        "beyond_line_ms": None if delay is None else 1e3 * delay.delay_s,
        "beyond_line_std_ms": None if delay is None else 1e3 * delay.std_s,
        "new_every_ms": every_ms,
        "noise_moving_rpm": None if fit is None else rpm_from_rad_s(fit.residual_rad_s),
        "text": text,
    }


def _new_every_s(rows: Sequence[Row]) -> float:
    """Median time between readings that differ: how often the wheel measures, as far as it was polled so often."""
    reported = [(row.time_s, row.speed_rad_s) for row in rows if row.speed_rad_s is not None]
    changes = [now[0] for last, now in itertools.pairwise(reported) if now[1] != last[1]]
    return float(np.median(np.diff(changes))) if len(changes) > 2 else float("nan")
