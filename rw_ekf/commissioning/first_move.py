"""The first move: which way a current turns the wheel, how strongly, and whether its readings fit together."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from rw_ekf.commissioning.commissioning_moves import hold_speed, pulses, ramp, to_rest
from rw_ekf.commissioning.contradicted_signs import (
    READ,
    UNKNOWN,
    Ratios,
    agreed,
    is_named,
    is_unsigned,
    named_ratio,
    ratios_of,
    turned_signs,
)
from rw_ekf.commissioning.dialogue import RefusedError
from rw_ekf.commissioning.guarded_wheel import Bench, OppositeError, Row
from rw_ekf.commissioning.map_copy import write_corrected_map
from rw_ekf.commissioning.motion_fit import MotionFit, fit_late_motion
from rw_ekf.commissioning.step_context import Work
from rw_ekf.numbers import plus_minus
from rw_ekf.units import rpm_from_rad_s

CAUTIOUS = 0.1  # of the speed limit: a scale that is wrong by ten leads no further than to the limit itself
_ABOVE_REST = 3.0
_PULSES, _MOST_TRIES = 6, 3
_BREAKS_AWAY = 2.5  # times the break-away current: a pulse that moves the wheel for certain
_FAR_NOISES, _FAR_STEPS, _FAR_RAD_S = 40.0, 20.0, 2.0
_SURE = 10.0  # standard deviations of the gain
_GAINS = (0.02, 5.0e4)  # rad/s^2 per ampere: from the largest flywheels to motors without one
_RAMP_AT_MOST_S, _REST_AT_MOST_S, _PULSES_AT_MOST_S = 40.0, 60.0, 120.0
_HOLD_AT_MOST_S, _HELD_S = 180.0, 3.0
_HELD_SHARE = 0.3  # of the cautious speed
_LEAST_HEADROOM = 1.5  # of the current limit over the break-away current: less shows friction only


class Moved(NamedTuple):
    """What one go of ramps and pulses showed."""

    fit: MotionFit
    ratios: Ratios
    ways: tuple[list[Row], list[Row]]  # the ramps, forward and backward

    @property
    def breakaway_A(self) -> tuple[float, float]:
        """The currents at which the wheel began to move, forward and backward."""
        forward, backward = (breakaway_of(rows, abs(self.fit.gain), max(self.fit.coulomb, 0.0)) for rows in self.ways)
        return forward, backward


def find_sign(work: Work) -> dict[str, Any]:
    """Move a little, mend the map where one sign stands alone, ask for the true speed. Raises RefusedError."""
    found = work.progress["find"]["protocol"]
    ratio = work.options.speed_ratio
    factors: dict[tuple[str, str], float] = {}
    path = found
    moved = _first_moved(work, ratio)
    turned = turned_signs(moved.fit.gain, moved.ratios)
    if turned:
        factors |= turned
        path = write_corrected_map(found, factors, work.progress.directory)
        work.dialogue.say("sign", f"{_turned_text(turned)}; moved again through {path}")
        moved = _moved(work, ratio, path, moved.ways)
        if turned_signs(moved.fit.gain, moved.ratios):
            raise RefusedError(f"{_turned_text(turned)}, and with that turned the readings still contradict each other")
    by = "the command line"
    if ratio is None:
        ratio, by = _by_tachometer(work, moved, path), "a tachometer"
    ratio, ratio_text = named_ratio(ratio)
    if ratio != 1.0:
        for name in ("speed", "angle") if moved.ratios.angle is not None else ("speed",):
            factors[name, READ] = factors.get((name, READ), 1.0) * ratio
        path = write_corrected_map(found, factors, work.progress.directory)
    gain, coulomb = ratio * moved.fit.gain, ratio * max(moved.fit.coulomb, 0.0)
    static = max(gain * min(moved.breakaway_A), coulomb)
    unit = work.progress["limits"]["unit"]
    forward_A, backward_A = moved.breakaway_A
    work.dialogue.say(
        "sign",
        f"a positive current turns the wheel forward, {plus_minus(gain, ratio * moved.fit.gain_std)} rad/s^2/{unit}; "
        f"it breaks away at about {forward_A:.2g} and {-backward_A:.2g} {unit}; by {by}, {ratio_text}",
    )
    return {
        "protocol": path,
        "map_text": "as it was found" if not factors else f"{found} with scales mended: {_factors_text(factors)}",
        "factors": [{"field": name, "access": access, "factor": value} for (name, access), value in factors.items()],
        "speed_ratio": ratio,
        "speed_ratio_by": by,
        "speed_ratio_text": ratio_text,
        "motor_gain": gain,
        "motor_gain_std": ratio * moved.fit.gain_std,
        "coulomb": max(coulomb, 1.0e-6),
        "static": max(static, 1.0e-6),
        "breakaway_A": list(moved.breakaway_A),
        "checked": _checked(moved, unit),
        "residual_rpm": rpm_from_rad_s(ratio * moved.fit.residual_rad_s),
    }


def _first_moved(work: Work, ratio: float | None) -> Moved:
    """Ramps and pulses through the map that was found, or one by which commands are taken.

    Where telemetry reports the opposite of each command, so that none counts as taken, they go through a copy in which
    the report is turned; what that shows is given as the map that was found would report it. Raises RefusedError.
    """
    try:
        return _moved(work, ratio)
    except OppositeError as error:
        opposite, found = error, work.progress["find"]["protocol"]
    for field, name in (("current_command", "echo"), ("current", "measured")):
        try:
            path = write_corrected_map(found, {(field, READ): -1.0}, work.progress.directory)
        except RefusedError:  # the map has no such field
            continue
        work.dialogue.say("sign", f"telemetry tells the opposite of each command; moved with {field} as read turned")
        try:
            moved = _moved(work, ratio, path)
        except OppositeError:  # it is the other field that confirms a command
            continue
        reported = getattr(moved.ratios, name)
        return moved._replace(ratios=moved.ratios._replace(**{name: None if reported is None else -reported}))
    raise opposite


def _moved(
    work: Work,
    ratio: float | None,
    path: str | None = None,
    ways: tuple[list[Row], list[Row]] | None = None,
) -> Moved:
    """Ramps and pulses. path: of the wire map, in place of the one found. ways: the ramps of before."""
    still, most_A = work.still, work.progress["limits"]["current_A"]
    limit_rad_s = work.speed_limit_rad_s / (ratio or 1.0)
    ceiling = max(CAUTIOUS * limit_rad_s, _ABOVE_REST * still.rest_rad_s)
    if ceiling > 0.5 * limit_rad_s:
        raise RefusedError(
            f"motion shows only above {rpm_from_rad_s(still.rest_rad_s):.3g} rpm in these readings (noise and step), "
            "too near the speed limit for a small move: give a larger --speed-limit"
        )
    with work.at_the_wheel(ceiling_rad_s=ceiling, path=path) as bench:
        if ways is None:
            ways = _broken_away(bench, most_A, still.rest_rad_s)
        away = [max(abs(row.command_A) for row in rows if math.isfinite(row.command_A)) for rows in ways]
        bench.run(to_rest(still.rest_rad_s), _REST_AT_MOST_S)
        far = min(
            0.8 * ceiling, max(_FAR_NOISES * still.noise_rad_s, _FAR_STEPS * (still.lattice_rad_s or 0.0), _FAR_RAD_S)
        )
        rows: list[Row] = []
        first_A, fit = _BREAKS_AWAY * max(away), None
        for _ in range(_MOST_TRIES):
            new = bench.run(pulses(_PULSES, first_A, most_A, far, still.rest_rad_s), _PULSES_AT_MOST_S)
            rows += new
            fit, _ = fit_late_motion(rows, still.rest_rad_s)
            if fit is not None and fit.sigmas > _SURE:
                break
            first_A = min(2.0 * first_A, most_A)
    if fit is not None and fit.sigmas > _SURE:  # else what it moved at, in readings that showed it late
        away = [breakaway_of(ramp_rows, abs(fit.gain), max(fit.coulomb, 0.0)) for ramp_rows in ways]
    if most_A < _LEAST_HEADROOM * max(away):
        raise RefusedError(
            f"the wheel breaks away at about {max(away):.2g} {work.progress['limits']['unit']}, and the current limit "
            f"is {most_A:.3g}: give --current-limit {2.0 * _LEAST_HEADROOM * max(away):.2g} or more, or look why it is "
            "so stiff"
        )
    return Moved(_believed(fit), ratios_of(rows, still.rest_rad_s), ways)


def breakaway_of(rows: Sequence[Row], gain: float, coulomb: float) -> float:
    """The current at which a wheel began to move in a ramp: its speed at the end, taken back under the known motion."""
    speed = float(np.mean([abs(row.speed_rad_s) for row in rows[-2:] if row.speed_rad_s is not None]))
    for row, following in reversed(list(itertools.pairwise(rows))):
        current_A = abs(row.command_A) if math.isfinite(row.command_A) else 0.0
        speed -= (gain * current_A - coulomb) * (following.time_s - row.time_s)
        if current_A > 0.0 and (speed <= 0.0 or gain * current_A <= coulomb):
            return current_A
    return max(abs(row.command_A) for row in rows if math.isfinite(row.command_A))


def _broken_away(bench: Bench, most_A: float, rest_rad_s: float) -> tuple[list[Row], list[Row]]:
    """Ramps until the wheel moves, forward and backward. Raises RefusedError."""
    ways = _ramp(bench, 1.0, most_A, rest_rad_s), _ramp(bench, -1.0, most_A, rest_rad_s)
    if is_unsigned(*ways):
        raise RefusedError(
            "the speed reads the same way round whichever way the current drives: it has no sign, and no friction can "
            "be told by it. Give a wire map whose speed is signed"
        )
    return ways


def _ramp(bench: Bench, side: float, most_A: float, rest_rad_s: float) -> list[Row]:
    bench.run(to_rest(rest_rad_s), _REST_AT_MOST_S)
    rows = bench.run(ramp(side, most_A, rest_rad_s), _RAMP_AT_MOST_S)
    while rows and rows[-1].speed_rad_s is None:  # readings that were missed behind the last one of the ramp
        rows.pop()
    if not any(abs(row.speed_rad_s or 0.0) > rest_rad_s for row in rows[-2:]):
        raise RefusedError(
            f"{most_A:.3g} A {'forward' if side > 0.0 else 'backward'}, the current limit, did not move the wheel: is "
            "the speed reading the wheel's, is the wheel held fast, or is the limit below what breaks it away?"
        )
    return rows


def _believed(fit: MotionFit | None) -> MotionFit:
    """The fit, where it shows a motor. Raises RefusedError."""
    if fit is None or fit.sigmas < _SURE:
        stated = "none" if fit is None else f"{plus_minus(fit.gain, fit.gain_std)} rad/s^2/A"
        raise RefusedError(
            f"pulses up to the current limit show no motion that follows from them (gain {stated}): is the speed "
            "reading the wheel's, and does the current reach the motor?"
        )
    if not _GAINS[0] < abs(fit.gain) < _GAINS[1]:
        raise RefusedError(
            f"the gain reads {fit.gain:.3g} rad/s^2/A, which no wheel has: a scale of the wire map is wrong"
        )
    return fit


def _by_tachometer(work: Work, moved: Moved, path: str) -> float:
    """True speed over reading; one that no usual mistake explains must come out at two speeds. Raises RefusedError."""
    target = max(_HELD_SHARE * CAUTIOUS * work.speed_limit_rad_s, _ABOVE_REST * work.still.rest_rad_s)
    ratio = _held(work, moved, path, target)
    if is_named(ratio):
        return ratio
    again = _held(work, moved, path, 1.4 * target)
    mean = agreed(ratio, again)
    if mean is None:
        raise RefusedError(
            f"the tachometer says {ratio:.4g} times the reading at one speed and {again:.4g} times at another: is the "
            "speed reading the wheel's?"
        )
    return mean


def _held(work: Work, moved: Moved, path: str, target: float) -> float:
    """What a person reads from a tachometer over what the wheel reports, at a steady speed. Raises RefusedError."""
    poll = work.dialogue.tachometer(
        f"the wheel reads {rpm_from_rad_s(target):.4g} rpm and is held there: what does a tachometer say? [rpm; Enter: "
        "nobody knows]"
    )
    if poll is None:
        raise RefusedError(UNKNOWN)
    answer: list[float | str | None] = [None]

    def answered() -> bool:
        answer[0] = poll()
        return answer[0] is not None

    most_A = work.progress["limits"]["current_A"]
    with work.at_the_wheel(ceiling_rad_s=2.0 * target, path=path) as bench:
        move = hold_speed(target, moved.fit.gain, max(moved.fit.coulomb, 0.0), most_A, answered, _HOLD_AT_MOST_S)
        rows = bench.run(move, _HOLD_AT_MOST_S)
        bench.run(to_rest(work.still.rest_rad_s, 0.5 * most_A), _REST_AT_MOST_S)
    last_s = rows[-1].time_s if rows else 0.0
    held = [row.speed_rad_s for row in rows if row.speed_rad_s is not None and row.time_s > last_s - _HELD_S]
    reported = answer[0]
    if not isinstance(reported, float) or reported <= 0.0 or not held:
        raise RefusedError(UNKNOWN)
    return abs(reported / rpm_from_rad_s(float(np.mean(held))))


def _checked(moved: Moved, unit: str) -> list[str]:
    """What was held against what, in sentences, and what could not be."""
    ratios = moved.ratios
    reported = [f"speed against current: the gain is {moved.fit.sigmas:.0f} standard deviations from zero"]
    for name, ratio in (
        ("measured current over command", ratios.measured),
        ("command as telemetry tells it, over command", ratios.echo),
        ("rate of the angle over speed", ratios.angle),
    ):
        reported.append(f"{name}: {'not in the telemetry' if ratio is None else f'{ratio:.3g}'}")
    if ratios.measured is None:
        reported.append(f"nothing on the line bears out that the current is in {unit}")
    return reported


def _turned_text(turned: dict[tuple[str, str], float]) -> str:
    names = ", ".join(f"{name} ({access})" for name, access in turned)
    choice = " (or those of the currents instead: what is forward is yours to say)" if ("speed", READ) in turned else ""
    return f"the sign of {names} is turned{choice}"


def _factors_text(factors: dict[tuple[str, str], float]) -> str:
    return ", ".join(f"{name} ({access}) times {factor:.6g}" for (name, access), factor in factors.items())
