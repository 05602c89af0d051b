"""A log that is not what it is taken for: one sentence with the line of the column map that mends it.

Tested once on every log that is replayed, fitted or diagnosed; nothing is concluded from one that is misread. Columns
that betray themselves are found in reading (`rw_ekf.logs.odd_columns`); here is what only the motion shows. Each
mistake is a hypothesis: read in the other way, equation 7 of docs/identification.md holds over windows, with a gain and
a friction above zero; as it stands, it does not. So nothing is tested on a log that the equation explains.
"""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from rw_ekf.course.course import Course
from rw_ekf.identify.other_reading import (
    BETTER,
    EXPLAINED,
    GAIN_COUNTS,
    LEFT_OVER,
    Reading,
    between_rests,
    between_steps,
    exchanged,
    is_set_point,
    signed_by,
)
from rw_ekf.identify.record_scale import (
    COULOMB_BAND,
    GAIN_BAND,
    WindowSums,
    speed_noise_of,
    window_sums,
)
from rw_ekf.identify.units_guess import SPEED_SLIPS, TIME_SLIPS, Slip, Slips, question_of_units
from rw_ekf.logs.column_map import Source
from rw_ekf.logs.odd_columns import clock_sentence
from rw_ekf.logs.wheel_log import WheelLog
from rw_ekf.model.state import CK13_STATISTICAL, FrictionParameters
from rw_ekf.units import RAD_S_PER_RPM

MISREAD = "the log is misread"  # with which a warning about it begins
_SLOWEST_S = 5.0  # a row: logs of machines have 1 to 2,000 a second
_USUAL_PERIOD_S = 0.03
_HALF_HOUR_S = 1800.0
_SAME_ANGLE = 0.05  # interquartile range of angle over what the speed makes of it, and how near a usual factor
_CIRCLE_DEG = (350.0, 360.0001)
_CURRENTS = ("current_A", "current_command_A")
# Of the changes of speed over windows: 77 logs that are read rightly leave at most 0.23 (those whose readings are
# filtered or late), wrong columns and wrong rows 0.17 to 1. 30 % less or more changes none of the 77.
_UNEXPLAINED = 0.4


class Motion(NamedTuple):
    """What the motion says of a log: sentences, without the final stop, and how much of it they are about."""

    misread: tuple[str, ...]  # what the log is not; none of a log that is read as it should be
    wanted: tuple[str, ...]  # whether units were mistaken
    unexplained: float | None  # share of the motion over windows that no gain and friction explain; None: not driven


def motion_of(log: WheelLog, *, described: bool = False) -> Motion:
    """Hold the equation of motion against a log.

    Units are judged by a log's size alone: a machine may have any, so that withholds nothing, and is not tested where a
    configuration or a model says what machine this is (described).
    """
    held = None if log.faults else _held_against(log)
    if held is None:
        return Motion(log.faults, (), None)
    course, sums, read, noise = held
    driven = _is_driven(log, sums)
    found = itertools.islice(_suspicions(log, course, sums, read, noise, described=described), 1)
    wanted = () if described else itertools.islice(_units(log, read, driven=driven), 1)
    return Motion(tuple(found), tuple(wanted), read.left if driven else None)


def misreadings_and_questions(log: WheelLog, *, described: bool = False) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """What a log is not, and whether units were mistaken, or columns that were guessed, as in `Motion`."""
    motion = motion_of(log, described=described)
    return motion.misread, (*(unexplained(motion) if log.guessed else ()), *motion.wanted)


def unexplained(motion: Motion) -> tuple[str, ...]:
    """A sentence where hardly anything of a log's motion is a machine's; none where enough is."""
    left = motion.unexplained
    if motion.misread or left is None or left <= _UNEXPLAINED:
        return ()
    return (
        f"read like this, drive and friction explain {100.0 * (1.0 - min(left, 1.0)):.0f} % of how the speed "
        "changes: is one of the columns another wheel's, a set-point, or another quantity?",
    )


def warnings_of(misread: tuple[str, ...], wanted: tuple[str, ...] = ()) -> list[str]:
    """What is reported to a user of a log that is filtered or fitted all the same."""
    return [f"{MISREAD}, and no number here is a machine's: {text}" for text in misread] or list(wanted)


def _held_against(log: WheelLog) -> tuple[Course, WindowSums, Reading, float] | None:
    """The log's course, its windows, what equation 7 makes of them, and the readings' noise; None where it is short."""
    course = Course.of_log(log)
    noise = speed_noise_of(course.speed_rad_s, course.segment) or 0.0
    sums = window_sums(course, noise)
    if sums is None or sums.change.size < 8:
        return None
    return course, sums, Reading.of(sums.change, sums.integrals), noise


def _is_driven(log: WheelLog, sums: WindowSums) -> bool:
    return log.drive != "constant" and bool(np.any(sums.integrals[:, 0]))


def _suspicions(
    log: WheelLog, course: Course, sums: WindowSums, read: Reading, noise: float, *, described: bool
) -> Iterator[str]:
    """What may be wrong, the least doubtful first."""
    top = sums.top_speed
    if _is_driven(log, sums):
        if is_set_point(sums, read):
            yield _of_set_point(log)
        odd = read.gain < 0.0 or read.friction(top) < 0.0 or read.left > LEFT_OVER
        if odd:
            yield from _other_reading(log, course, sums, read, noise)
        if read.gain < 0.0 and read.left < EXPLAINED and read.without_gain > GAIN_COUNTS:
            yield _of_sign(log, read, top)
    yield from _clock_set_forward(log, noise)
    yield from _angle_beside_speed(log, course, top)
    if not described:
        yield from _rows_apart(log, course)


def _of_sign(log: WheelLog, read: Reading, top: float) -> str:
    if read.friction(top) < 0.0:
        return (
            "the machine runs backward in time (negative gain and friction): are the rows reversed? `reverse: true`, "
            "or, where a map has that, does the time count down? `scale: -1` of `time_s` in its place"
        )
    name, source = _drive(log)
    line = source.line(name, scale=-source.scale, offset=-source.offset)
    return (
        f"the drive pushes against the motion (a motor gain of {read.gain:.3g}, which no machine has): drive and speed "
        f"are counted in opposite directions: {line}"
    )


def _other_reading(log: WheelLog, course: Course, sums: WindowSums, read: Reading, noise: float) -> Iterator[str]:
    """Columns exchanged, or one of them a magnitude: what makes a machine of the log where as it stands it is none."""
    top = sums.top_speed
    enough = min(read.left / BETTER, EXPLAINED)
    swapped = window_sums(exchanged(log), None)
    if swapped is not None and swapped.change.size >= 8:
        other = Reading.of(swapped.change, swapped.integrals)
        if other.left < enough and other.is_machine(swapped.top_speed) and other.coulomb > 0.0:
            (drive, of_drive), (speed, of_speed) = _drive(log), _speed(log)
            yield (
                "current and speed are exchanged: "
                f"{of_speed.line(speed, column=of_drive.column)} and {of_drive.line(drive, column=of_speed.column)}"
            )
    readings = course.speed_rad_s[np.isfinite(course.speed_rad_s)]
    backward, forward = (float(np.mean(way * readings > 0.05 * top)) for way in (-1.0, 1.0))
    one_way = float(np.min(log.current_A)) >= 0.0 or float(np.max(log.current_A)) <= 0.0
    if one_way and min(backward, forward) > 0.02:
        name, source, what = *_drive(log), "current"
        kept = between_steps(log, sums)
        other = signed_by(np.arange(kept.change.size), kept)
    elif min(backward, forward) == 0.0 and not one_way and float(np.min(readings)) >= -5.0 * noise:
        name, source, what = *_speed(log), "speed"
        stretch = between_rests(course, top, noise)
        whole = (stretch[sums.begin] == stretch[sums.end]) & (stretch[sums.begin] > 0)
        if int(whole.sum()) < 8:
            return
        kept = replace(sums, change=sums.change[whole], integrals=sums.integrals[whole])
        other = signed_by(stretch[sums.begin][whole], kept)
    else:
        return
    if other.left < enough and other.is_machine(top):
        line = source.line(name, sign_of=_of_other(log, r"dir|sign|way|forward|cw") or "DIRECTION")
        yield f"the {what} is a magnitude, without the sign of its direction: {line} (the column that has the sign)"


def _of_set_point(log: WheelLog) -> str:
    name, source = _drive(log)
    column = _of_other(log, r"^i$|iq|cur|amp|torque|tau|pwm|volt") or "CURRENT"
    line = replace(source, scale=1.0, offset=0.0).line(name, column=column)
    return (
        f"the speed follows column '{source.column}' and stands where it says: that is a set-point of the speed, not a "
        f"current: {line} (the column of the current)"
    )


def _clock_set_forward(log: WheelLog, noise: float) -> Iterator[str]:
    """A gap over which nothing happened: the speed is where one row would have brought it, and two of these hold.

    The drive is the same; it would have moved the wheel; the gap is of half hours, as a summer's time has them.
    """
    time, speed, current = log.time_s, log.speed_rad_s, log.current_A
    step = np.diff(time)
    inside = np.diff(log.segment) == 0
    if not inside.any() or log.drive == "constant":
        return
    usual = float(np.median(step[inside]))
    even = inside & (np.abs(step - usual) < 0.3 * usual)
    gaps = np.flatnonzero(inside & (step > 5.0 * usual))
    if not 0 < gaps.size <= 3 or float(np.mean(even[inside])) < 0.8:
        return
    before_gaps = window_sums(_closed_up(log, usual), noise)
    if before_gaps is None:
        return
    read = Reading.of(before_gaps.change, before_gaps.integrals)
    spread = float(np.ptp(current))
    for i in gaps:
        if not np.isfinite(speed[i : i + 2]).all():
            continue
        same = bool(abs(current[i + 1] - current[i]) <= 0.05 * spread)
        push = read.gain * current[i] - read.viscous * speed[i] - read.coulomb * np.sign(speed[i])
        off = speed[i + 1] - speed[i] - push * usual
        by = float(step[i] - usual)
        whole = abs(by / _HALF_HOUR_S - round(by / _HALF_HOUR_S)) * _HALF_HOUR_S < usual and by > 0.5 * _HALF_HOUR_S
        moved = abs(push) * by > max(30.0 * noise, 10.0 * abs(off)) and read.is_machine(before_gaps.top_speed)
        if abs(off) < 4.0 * math.sqrt(2.0) * noise and same + moved + whole >= 2:
            yield clock_sentence(by, f"{time[i]:.10g} s", step[even])
            return


def _closed_up(log: WheelLog, period_s: float) -> Course:
    """The log with every step as long as the usual one."""
    even = np.arange(len(log)) * period_s
    return Course.of(
        np.asarray(even, dtype=np.float64), log.speed_rad_s, np.array(log.current_A), log.command_delay_s, log.segment
    )


def _angle_beside_speed(log: WheelLog, course: Course, top: float) -> Iterator[str]:
    """An angle that grows by another factor than the speed says."""
    angle, source = course.angle_rad, log.sources.get("angle_rad")
    if source is None or not np.isfinite(angle).any():
        return
    degrees = source.line("angle_rad", scale=float(f"{source.scale * math.radians(1.0):.6g}"))
    turned = 0.5 * (course.speed_rad_s[1:] + course.speed_rad_s[:-1]) * np.diff(course.time_s)
    step = np.diff(angle)
    sure = np.isfinite(turned) & np.isfinite(step) & (np.diff(course.segment) == 0)
    sure &= np.abs(course.speed_rad_s[1:]) > 0.2 * top
    if int(sure.sum()) < 20:
        return
    low, middle, high = np.quantile(step[sure] / turned[sure], (0.25, 0.5, 0.75))
    if high - low < _SAME_ANGLE * abs(middle) and middle > 0.0:
        speed_name = _speed(log)[0]
        usual = [Slip(1.0 / slip.factor, slip.question) for slip in (*SPEED_SLIPS[speed_name][:1], *TIME_SLIPS)]
        for slip in (Slip(180.0 / math.pi, "is the angle in degrees?"), *usual):
            if abs(math.log(middle / slip.factor)) < _SAME_ANGLE:
                reported = f"the angle grows by {middle:.4g} times what the speed says: {slip.question}"
                if "angle" in slip.question:
                    yield f"{reported} {degrees}"
                else:
                    true = Slip(1.0 / slip.factor, slip.question)
                    slips = Slips(speed=true) if "speed" in true.question else Slips(time=true)
                    yield f"{reported} {_lines(log, slips)}"
    spread = float(np.nanmax(angle) - np.nanmin(angle))
    if _CIRCLE_DEG[0] < spread < _CIRCLE_DEG[1] and float(np.nanmax(np.abs(step))) > 180.0:
        yield f"the angle begins anew after 360: is it in degrees? {degrees}"


def _rows_apart(log: WheelLog, course: Course) -> Iterator[str]:
    """Rows so far apart that the unit of time must be another."""
    time, period = log.sources.get("time_s"), course.period_s
    if period > _SLOWEST_S and time is not None and not time.says_scale:
        slip = min(TIME_SLIPS[:3], key=lambda slip: abs(math.log(period / slip.factor / _USUAL_PERIOD_S)))
        yield f"the rows are {period:.4g} s apart: {slip.question} {_lines(log, Slips(time=slip))}"


def _units(log: WheelLog, read: Reading, *, driven: bool) -> Iterator[str]:
    """A size that no wheel has and a usual slip of units explains."""
    k, _, c, _ = CK13_STATISTICAL
    gain = read.gain / k if driven else 1.0
    if GAIN_BAND[0] < gain < GAIN_BAND[1] and COULOMB_BAND[0] < read.coulomb / c < COULOMB_BAND[1]:
        return
    if read.left < EXPLAINED:
        found = FrictionParameters(read.gain if driven else k, read.viscous, read.coulomb, read.coulomb)
        slips = question_of_units(found, driven=driven, speed_name=_speed(log)[0], viscous_std=read.viscous_std)
        if slips is not None:
            yield f"the record would be a wheel's in other units: {slips.question} {_lines(log, slips)}"


def _lines(log: WheelLog, slips: Slips) -> str:
    """The lines of the map that undo slips of units."""
    (drive, of_drive), (speed, of_speed) = _drive(log), _speed(log)
    lines = []
    if slips.speed.factor != 1.0:
        other = "speed_rpm" if speed == "speed_rad_s" else "speed_rad_s"
        to_other = RAD_S_PER_RPM if speed == "speed_rad_s" else 1.0 / RAD_S_PER_RPM
        if abs(slips.speed.factor * to_other - 1.0) < 1e-6:  # the very column, called what it is
            lines.append(of_speed.line(other))
        else:
            in_rad_s = RAD_S_PER_RPM if speed == "speed_rpm" else 1.0
            lines.append(_scaled(of_speed, "speed_rad_s", in_rad_s / slips.speed.factor))
    if slips.current.factor != 1.0:
        lines.append(_scaled(of_drive, drive, 1.0 / slips.current.factor))
    if slips.time.factor != 1.0:
        lines.append(_scaled(log.sources.get("time_s", Source("column", "time_s")), "time_s", 1.0 / slips.time.factor))
    return " and ".join(lines)


def _scaled(source: Source, name: str, by: float) -> str:
    return source.line(name, **{key: float(f"{getattr(source, key) * by:.6g}") for key in ("scale", "offset")})


def _drive(log: WheelLog) -> tuple[str, Source]:
    """What drives the model: its name in the map, and where it came from."""
    name = log.drive if log.drive in _CURRENTS else "current_A"
    return name, log.sources.get(name, Source("column", name))


def _speed(log: WheelLog) -> tuple[str, Source]:
    name = "speed_rpm" if log.in_rpm else "speed_rad_s"
    return name, log.sources.get(name, Source("column", name))


def _of_other(log: WheelLog, pattern: str) -> str | None:
    """A column of the file that nothing uses and whose name fits."""
    return next((name for name in log.other if re.search(pattern, name.lower())), None)
