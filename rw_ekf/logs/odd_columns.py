"""What shows, column by column, that it is not what it is taken for, with the line of the column map that mends it.

A unit in a column's name that the map forgets; negative numbers read as unsigned; an angle that begins anew each turn
and is differentiated; a clock that was set back. What only the motion shows is in `rw_ekf.identify.misread`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from rw_ekf.arrays import Float64Array, Int64Array
from rw_ekf.logs.column_map import Source
from rw_ekf.logs.column_names import stated_by
from rw_ekf.logs.column_units import OF_COLUMN, unit_of
from rw_ekf.units import RAD_S_PER_RPM

_SPEEDS = {"speed_rpm": unit_of("rpm"), "speed_rad_s": unit_of("rad/s")}  # whose name says the unit
_SAME = 1.05  # a scale that agrees with the name
COUNTERS = (2.0**16, 2.0**32)  # which begin anew there, whatever they count
_STEPS = (1.0, 0.1, 0.01, 1e-3, 1e-4)  # of a counter that was written in another unit
_EMPTY = (0.25, 0.75)  # of its range: nothing lies between small positive numbers and small negative ones
_NEAR_END = 0.99  # of its range: so near come small negative numbers, and hardly anything else
_LEAST_ROWS = 3
_TURNS = (2.0 * math.pi, 360.0, 1.0, *(2.0**bits for bits in range(8, 25)), 2.0**32, 4000.0, 3600.0)
_FULL = 0.9  # of a turn, which an angle that begins anew covers
_OVER = 1.05  # of a turn in degrees, radians or turns: so far goes one whose calibration is off, or is noisy
_SAME_TURN = 0.01  # of itself: 4000 counts and 4096 differ by more, what a jump says of a turn by less
_EVEN = 0.3  # of the usual step, by which a regular clock may be early or late
_MOSTLY = 0.8
_LANDS = 10.0  # steps: a clock that begins anew begins near where it began
_MARKS = frozenset([
    999.0, 999.9, 999.99, 9999.0, 9999.9, 9999.99, 99999.0, 999999.0, 32768.0, 65535.0, 2.0**31 - 1.0, 2.0**31,
    2.0**32 - 1.0,
])  # fmt: skip
_NO_COMMAND = frozenset([-9999.0, -9999.9, -9999.99, -99999.0, -999999.0])
_HUGE = 1.0e20  # 1e30, 9.91e37 (SCPI), 9.97e36 (netCDF): no machine's
_APART = 0.1  # of itself: so far from all else is what was not measured; a machine passes what lies between
_BEYOND = 0.01  # of itself: all else is less where it is no level of a command
_LEVELS = 4  # values but zero: a command of no more may go to 999, or to 65535 of 65535
_SETS = 5  # times at most that a clock is set in one log; rows out of order come oftener


def faults_of_column(header: str, name: str, source: Source, values: Float64Array) -> list[str]:
    """Sentences (without the file) on a column as it stands in the file, (n,) before scale; `name` is the log's."""
    if name not in {"time_s", "angle_rad", "current_A", "current_command_A", "speed_rad_s", "speed_rpm"}:
        return []
    if source.wrap or source.sign_of is not None:
        return []
    finite = values[np.isfinite(values)]
    if finite.size < 2 * _LEAST_ROWS:
        return []
    found = [_unit_in_name(header, name, source)]
    if name != "time_s" and (mark := mark_of_missing(finite)) is not None:
        line = source.line(name, missing=mark)
        found.append(f"{name} is {mark:.10g} in {int(np.sum(finite == mark))} rows and nowhere near it else: {line}")
    if source.kind == "derivative":
        found.append(_begins_anew(name, source, finite))
    elif name not in {"time_s", "angle_rad"}:
        found.append(_unsigned_counter(name, source, finite))
    return [text for text in found if text is not None]


def _unit_in_name(header: str, name: str, source: Source) -> str | None:
    """A unit that the header says and the map does not; a map that gives a scale has thought of it."""
    if source.says_scale or source.scale != 1.0 or not header:
        return None
    of_angle = source.kind == "derivative"
    stated = stated_by(header)
    known = stated.unit
    column = "angle_rad" if of_angle else "speed_rad_s" if name.startswith("speed") else name
    if known is None or known.per or known.offset or known.quantity != OF_COLUMN[column][0]:
        return None
    size = known.factor / (RAD_S_PER_RPM if name == "speed_rpm" else 1.0)
    if max(size, 1.0 / size) < _SAME:
        return None
    line = source.line(name, scale=float(f"{size:.6g}"))
    other = next((other for other, unit in _SPEEDS.items() if known == unit), None)
    if other is not None:
        line = source.line(other)
    return f"column '{header}' is taken for {name} as it stands, and its name says {stated.unit_text}: {line}"


def mark_of_missing(values: Float64Array) -> float | None:
    """The number, as -9999, that stands in values (n,) where nothing was measured; None where none does."""
    known = values[np.isfinite(values)]
    for mark in (float(known.min()), float(known.max())) if known.size else ():
        size = abs(mark)
        if size not in _MARKS and size < _HUGE:
            continue
        others = known[known != mark]
        often = known.size - others.size > (size < 1000.0)  # 999 once may be a reading
        beyond = 0.0 < float(np.max(np.abs(others), initial=0.0)) < _BEYOND * size
        level = mark not in _NO_COMMAND and not beyond and np.unique(others[others != 0.0]).size <= _LEVELS
        if not often or level or others.size <= known.size // 2:
            continue
        if float(np.min(np.abs(np.abs(others / mark) - 1.0))) > _APART:  # nor near its opposite: a drive to both ends
            return mark
    return None


def unsigned_turn(values: Float64Array) -> tuple[float, int] | None:
    """What a counter whose negative numbers were written as unsigned counts to, and its bits; None for any other.

    Those of 16 or 32 bits all lie at the upper end of values (n,), and nothing between them and the positive ones.
    """
    values = values[np.isfinite(values)]
    if values.size < 2 * _LEAST_ROWS or float(values.min()) < 0.0:
        return None
    for step in _STEPS:
        for size in COUNTERS:
            full = size * step
            if not _NEAR_END * full <= float(values.max()) < full:
                continue
            part = values / full
            upper, lower = part > _EMPTY[1], part < _EMPTY[0]
            whole = np.abs(values / step - np.round(values / step)) < 1.0e-3
            ends = bool(np.all(values[upper] >= full - 1.5 * step))  # a drive from 0 to 65535, and not to -1
            if min(upper.sum(), lower.sum()) >= _LEAST_ROWS and (upper | lower).all() and whole.all() and not ends:
                return full, round(math.log2(size))
    return None


def _unsigned_counter(name: str, source: Source, values: Float64Array) -> str | None:
    """Negative numbers of 16 or 32 bits that were written as unsigned."""
    if (found := unsigned_turn(values)) is None:
        return None
    full, bits = found
    return (
        f"{int(np.sum(values > _EMPTY[1] * full))} values of {name} lie just below {full:.10g}: negative numbers of "
        f"{bits} bits, read as unsigned: {source.line(name, wrap=full)}"
    )


def _begins_anew(name: str, source: Source, values: Float64Array) -> str | None:
    """An angle or counter that falls back after a full turn, and whose derivative is the speed."""
    if (turn := turn_of(values)) is None:
        return None
    change = np.diff(values)
    mended = change - turn * np.round(change / turn)
    fast = float(np.quantile(np.abs(mended), 0.99)) > 0.4 * turn
    also = "; it turns half a turn and more from row to row, which no map mends: log it faster" if fast else ""
    jumps = int(np.sum(np.abs(change) > 0.5 * turn))
    return (
        f"column '{source.column}' begins anew after {turn:.10g}, {jumps} times, and each time its "
        f"derivative, the speed, jumps: {source.line(name, wrap=turn)}{also}"
    )


def turn_of(values: Float64Array, turns: Sequence[float] = (), *, only: bool = False) -> float | None:
    """After how much an angle (n,) begins anew: one of `turns`, or (unless only these) of the usual ones; or None.

    Where there is a choice, it jumps by what it goes from row to row there less a turn, which says which one it is.
    """
    values = values[np.isfinite(values)]
    spread, change = float(np.ptp(values)), np.diff(values)
    usual = (*turns, *(() if only else _TURNS))
    whole = {turn: bool(np.isclose(turn, _TURNS[:3], rtol=1.0e-9).any()) for turn in usual}  # in the unit of an angle
    at = np.flatnonzero(np.abs(change) > 0.5 * spread)
    at = at[(at > 0) & (at < change.size - 1)]
    jump = float(np.median(np.abs(change[at] - 0.5 * (change[at - 1] + change[at + 1])))) if at.size else 0.0
    most = {turn: turn * (_OVER if whole[turn] and at.size else 1.0 + 1.0e-9) for turn in usual}
    fits = [turn for turn in usual if _FULL * turn <= spread <= most[turn] and (np.abs(change) > 0.5 * turn).any()]
    if at.size:
        sure = [turn for turn in fits if abs(jump / turn - 1.0) < (_OVER - 1.0 if whole[turn] else _SAME_TURN)]
        within = [turn for turn in fits if spread <= turn * (1.0 + 1.0e-9)]
        fits = within if only and within else sorted(sure, key=lambda turn: abs(jump - turn))
    return fits[0] if fits else None


def clock_set_back(
    time_s: Float64Array, reading: Float64Array, segment: Int64Array, place: Callable[[int], str]
) -> str | None:
    """A sentence where rows stand in order but their clock was set back, or where all stand in reverse; else None.

    Rows out of order, rows sent twice and a clock that begins anew are something else (`rw_ekf.logs.row_rules`).
    """
    step = np.diff(time_s)
    inside = np.diff(segment) == 0
    if step.size < 10 or not inside.any():
        return None
    if float(np.mean(step[inside] < 0.0)) > _MOSTLY:
        return "the rows stand in reverse order of time, the last first: `reverse: true`"
    back = np.flatnonzero((step < 0.0) & inside)
    forth = step[inside & (step > 0.0)]
    if not 0 < back.size <= _SETS or forth.size == 0:
        return None
    usual = float(np.median(forth))
    even = np.abs(step - usual) < _EVEN * usual
    if float(np.mean(even[inside])) < _MOSTLY:
        return None
    for row in back:
        out_of_order = np.count_nonzero(~even[max(row - 2, 0) : row + 3]) > 1
        anew = abs(time_s[row + 1] - time_s[0]) <= _LANDS * usual
        twice = np.isin(reading[row + 1 : row + 1 + _LEAST_ROWS], reading[: row + 1]).all()
        if out_of_order or anew or (twice and np.isin(time_s[row + 1], time_s[: row + 1])):
            return None
    first = int(back[0])
    return clock_sentence(float(step[first]) - usual, place(first + 1), step[even])


def clock_sentence(by_s: float, where: str, even_steps_s: Float64Array) -> str:
    """What is reported of a clock that was set by so much [s] at a row, in a log whose other rows are evenly spaced."""
    way = "forward" if by_s > 0.0 else "backward"
    return (
        f"the clock was set {way} by {abs(by_s):.6g} s at {where}, while the rows went on "
        f"evenly: `rate_hz: {1.0 / float(np.mean(even_steps_s)):.5g}` in place of `time_s`, "
        "or a column `segment` that changes there"
    )
