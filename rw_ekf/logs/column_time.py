"""Which column is the time, and what it counts in: of the clocks that fit best the first, a counter, a known rate."""

from __future__ import annotations

import shlex
from collections.abc import Sequence

import numpy as np

from rw_ekf.arrays import Float64Array
from rw_ekf.logs.clock_columns import MAY_BE_A_PART
from rw_ekf.logs.column_answers import Answers
from rw_ekf.logs.column_brackets import without_unit
from rw_ekf.logs.column_clock import (
    EPOCHS,
    FASTEST_S,
    SLOWEST_S,
    Clock,
    clock_of,
    no_clock,
    rate_in,
    ticks_a_second,
    ticks_of_stamps,
    unit_of_stamps,
)
from rw_ekf.logs.column_records import Column, Guess, Line
from rw_ekf.logs.column_units import unit_of
from rw_ekf.logs.raw_table import RawTable
from rw_ekf.logs.row_rules import goes_with_seconds, is_even, usual_step
from rw_ekf.numbers import number_text

_COUNTERS_CALLED = (
    "tick", "ticks", "counter", "timer", "cnt", "clk", "clock", "cycle", "cycles", "count", "takt",
)  # fmt: skip
_STEADY = 0.5  # of its step: so evenly goes a counter that is a clock, and not the angle of a wheel that turns
_DATES = (6.3e8, 2.3e9)  # 1990 to 2042, in seconds since 1970; in ms and less from 2001, as any clock (`column_clock`)
_SAME_RATE = 0.01  # relative
_JULIAN, _JULIAN_STEP = (2.44e6, 2.48e6), 1.0e-3  # 1968 to 2077 in days, and less than 90 s between rows
_OF_AN_ANGLE = ("encoder", "enc", "hall", "pos", "position", "angle", "theta", "motor", "wheel", "rev")
_NO_CLOCK = ("aside", "derived", "controller", "place")  # words of these say that it is something else


def find_time(table: RawTable, columns: list[Column], reported: Answers, guess: Guess) -> Clock | None:
    """Choose the time: the clock that fits best, else a counter, else the rows where their rate is known."""
    clocks = _clocks(table, columns, reported)
    if not clocks:
        return _without_clock(table, columns, reported, guess)
    given = reported.of("time_s")
    clock = max(clocks, key=lambda clock: (clock.is_clock, clock.rank, -clock.again))
    others = (other for other in clocks if _contradict(clock, other) or _of_two_signals(clock, other, columns))
    if given is None and (other := next(others, None)) is not None:
        both = [(one, columns[one.number]) for one in (clock, other)]
        text = f"{both[0][1].shown} and {both[1][1].shown} do not tell the same time: which is the speed's?"
        guess.ask("time_s", text, *(Line("time_s", c.entry(one.unit), one.why) for one, c in both))
        return clock
    column = columns[clock.number]
    counted = _counted_as_stated(clock, column, table.preamble, reported, guess)
    if counted is None:
        return clock
    clock = counted
    if (
        not clock.is_clock
        and not _time_unit(reported)
        and (why := no_clock(column.shown, column.values, column.stated))
    ):
        guess.ask("time_s", f"{why}: in which unit is it?", Line("time_s", column.entry("s"), ""))
        return clock
    if clock.repeats and _rows_again(clock, columns):
        clock.repeats, clock.again = "drop", 0.0
    part = next((c for c in columns if _may_be_its_part(c, clock)), None) if given is None else None
    if part is not None:
        text = f"{part.shown} begins anew with each second of {column.shown}: of how many parts of a second is it?"
        guess.ask("time_s", text, Line("time_s", column.entry(clock.unit), "without it, rows evenly in each second"))
        guess.options["repeats"] = clock.repeats
        return clock
    _take_clock(clock, column, reported, guess)
    return clock


def _counts_down(column: Column) -> bool:
    """Whether a time is what is left, by its name and its numbers: `time_remaining_s`."""
    return column.stated.has("countdown") and bool(np.all(np.diff(column.values) <= 0.0))


def _time_unit(reported: Answers) -> str:
    """The unit of the time that was answered; seconds where a scale was."""
    scaled = isinstance(reported.more.get("time_s", {}).get("scale"), float)
    return reported.unit("time_s") or ("s" if scaled else "")


def _clocks(table: RawTable, columns: list[Column], reported: Answers) -> list[Clock]:
    """The columns that may be the time, as clocks: the one that was answered, else those called so, else dates."""
    given, unit, scale = reported.of("time_s"), _time_unit(reported), reported.more.get("time_s", {}).get("scale")

    def among(columns: list[Column]) -> list[Clock]:
        found = [
            clock_of(
                c.number, c.name, c.stated, (-1.0 if _counts_down(c) else 1.0) * c.values, unit,
                not table.is_plain_number(c.number), scale if isinstance(scale, float) else 1.0,
            )
            for c in columns
        ]  # fmt: skip
        return [clock for clock in found if clock is not None and (clock.is_clock or given is not None)]

    if given is not None and given[1] is not None:
        return among([columns[given[1]]])
    if reported.rate is not None:  # whatever a column says
        return []
    called = among([c for c in columns if c.role == "time" and np.isfinite(c.values).all()])
    # What is called nothing that is known is a time where it holds dates.
    undated = [c for c in columns if c.role in ("other", "count", "angle") and (_holds_dates(table, c) or _runs(c))]
    return called or among(undated)


def _counted_as_stated(
    clock: Clock, column: Column, preamble: Sequence[str], reported: Answers, guess: Guess
) -> Clock | None:
    """A clock whose unit its steps gave, as the file says that it counts; None, and a question, if they differ."""
    values = column.values
    if not clock.concluded or _time_unit(reported) or not np.array_equal(values, np.round(values)):
        return clock
    if (counted := unit_of_stamps(preamble)) is not None:
        size, of, words = counted
        found = clock_of(column.number, column.name, column.stated, values, of, False, size) or clock
        found.why, found.scale = f"the file says '{words}'", size
        if FASTEST_S <= usual_step(found.time_s) <= SLOWEST_S:
            return found
        text = f"{column.shown} {without_unit(column)}; '{words}' is said, which its steps are not like"
        stated = Line("time_s", column.entry(of, scale=size), words)
        guess.ask("time_s", text, stated, Line("time_s", column.entry(clock.unit or "s"), clock.why))
    elif (ticks := _other_ticks(clock, preamble)) is not None:
        length = f"{1e6 / ticks[0]:g}"
        text = f"{column.shown} {without_unit(column)}, and '{ticks[1]}' is said: what does it count in?"
        own = Line("time_s", column.entry(clock.unit or "s"), "by its steps")
        guess.ask("time_s", text, Line("time_s", column.entry("us", scale=float(length)), f"{length} us"), own)
    else:
        return clock
    return None


def _without_clock(table: RawTable, columns: list[Column], reported: Answers, guess: Guess) -> Clock | None:
    """A counter as the time, else rows where something says their rate; None, and a question, where nothing does."""
    counter = _counter(table, columns) if reported.rate is None else None
    if counter is not None:
        clock, step_s, why = counter
        guess.take(
            "time_s", reported.with_more("time_s", columns[clock.number].entry(scale=step_s, wrap=clock.wrap)), why
        )
        return clock
    rate = reported.rate or rate_in((*table.preamble, *table.names))
    if rate is not None and (steps := next((c for c in columns if _counts_steps(c)), None)) is not None:
        text = f"{steps.shown} rises by some {usual_step(_known(steps)):.4g} from row to row, and '{rate[1]}' is said"
        how = f"--set {shlex.quote(f'time={steps.key}')} --set time.scale=SECONDS"
        guess.ask("time_s", f"{text}: how many of them are a second? {how}.")
        return None
    if rate is not None:
        guess.options["rate_hz"] = rate[0]
        guess.notes.append(f"there is no column of time; rows are {rate[0]:g} a second, by '{rate[1]}'")
        return Clock(-1, np.arange(table.rows) / rate[0])
    rising = [c for c in columns if not c.name and np.all(np.diff(c.values) > 0.0) and table.rows > 2]
    text = "no column is known to be the time: --set time=COLUMN, or --set rate_hz=ROWS_A_SECOND."
    times = [c for c in columns if c.role == "time"]
    refused = [f"{c.shown} {c.spoilt}" if c.spoilt else no_clock(c.shown, c.values, c.stated) for c in times]
    text = "; ".join([*filter(None, refused[:1]), text])
    guess.ask("time_s", text, *(Line("time_s", c.entry("s"), "it rises") for c in rising[:3]))
    return None


def _other_ticks(clock: Clock, preamble: Sequence[str]) -> tuple[float, str] | None:
    """Another rate than the one concluded of its steps at which a clock may count, and the words that say so.

    Not where that is the rate of the rows, or would make one that no log has.
    """
    ticks, known = ticks_of_stamps(preamble), unit_of(clock.unit or "s")
    if ticks is None or known is None:
        return None
    step_s = usual_step(clock.time_s)
    by_ticks_s = step_s / known.factor / ticks[0]
    alike = any(abs(ticks[0] * each - 1.0) < _SAME_RATE for each in (known.factor, step_s))
    return None if alike or not FASTEST_S <= by_ticks_s <= SLOWEST_S else ticks


def _counts_steps(column: Column) -> bool:
    """Whether a column counts something of which the rows have not each one: where they do, the rows are the clock."""
    step = np.diff(_known(column)) if column.role in ("count", "time") else np.zeros(0)
    return step.size > 0 and bool(np.all(step >= 0.0)) and not np.all(step == step[0])


def _known(column: Column) -> Float64Array:
    return column.values[np.isfinite(column.values)]


def _rows_again(clock: Clock, columns: list[Column]) -> bool:
    """Whether rows of one time are the same throughout: written twice, and no coarse stamps."""
    again = np.diff(clock.time_s) == 0.0
    return all(np.array_equal(c.values[1:][again], c.values[:-1][again], equal_nan=True) for c in columns)


def _may_be_its_part(column: Column, clock: Clock) -> bool:
    """Whether a column goes with the whole seconds of a clock, and counts no rows."""
    if clock.repeats != "spread" or column.role not in MAY_BE_A_PART:
        return False
    step = np.diff(column.values)[np.diff(clock.time_s) == 0.0]
    return goes_with_seconds(clock.time_s, column.values) and bool(np.any(step != 1.0))


def _contradict(one: Clock, other: Clock) -> bool:
    """Whether two clocks that run through say spans of time that differ, by more than either's steps."""
    if one is other or not all(clock.is_clock and not clock.restarts and not clock.asks for clock in (one, other)):
        return False
    spans = [float(np.ptp(clock.time_s)) for clock in (one, other)]
    steps = max(float(np.max(np.diff(clock.time_s))) for clock in (one, other))
    return abs(spans[0] - spans[1]) > 0.2 * max(spans) + 3.0 * steps


def _of_two_signals(one: Clock, other: Clock, columns: list[Column]) -> bool:
    """Whether two clocks are of different signals by their names, and differ."""
    stated = [columns[clock.number].stated for clock in (one, other)]
    groups = [{name for name in ("speed", "current", "torque", "voltage") if each.has(name)} for each in stated]
    apart = bool(groups[0] and groups[1]) and not groups[0] & groups[1]
    return apart and not np.allclose(one.time_s, other.time_s, rtol=0.0, atol=1.0e-3)


def _holds_dates(table: RawTable, column: Column) -> bool:
    """Whether all its cells are dates or times of day, text, seconds since 1970 or Julian dates, that do not fall."""
    values = column.values
    if len(values) < 3 or not np.isfinite(values).all() or float(np.mean(np.diff(values) < 0.0)) > 0.01:
        return False
    first, last = float(values[0]), float(values[-1])
    spans = (
        [_DATES, *(epoch[:2] for epoch in EPOCHS)] if column.role != "angle" else [epoch[:2] for epoch in EPOCHS[2:]]
    )
    since_1970 = any(low <= first < last < high for low, high in spans)  # `Ticks`: no angle is counted in so many
    julian = _JULIAN[0] <= first < last < _JULIAN[1] and float(np.median(np.diff(values))) < _JULIAN_STEP
    return since_1970 or julian if table.is_plain_number(column.number) else float(np.ptp(values)) > 0.0


def _runs(column: Column) -> bool:
    """Whether a column in a unit of time rises from row to row, whatever it is called in whatever language."""
    in_time = (
        column.stated.unit is not None and column.stated.unit.quantity == "time" and not column.stated.has(*_NO_CLOCK)
    )
    return in_time and bool(np.all(np.diff(column.values) > 0.0))  # NaN does not


def _counter(table: RawTable, columns: list[Column]) -> tuple[Clock, float, str] | None:
    """The only counter that rises, where the file says how fast it runs: clock, its step [s], and what says so."""
    counters = [c for c in columns if c.role in ("count", "angle", "time") and c.stated.any_of(*_COUNTERS_CALLED)]
    counters = [c for c in counters if not c.stated.any_of(*_OF_AN_ANGLE)]
    found = [(c, clock_of(c.number, c.name, c.stated, c.values, "s", stamps=False)) for c in counters]
    rising = [
        (c, clock) for c, clock in found if clock is not None and not clock.restarts and is_even(clock.time_s, _STEADY)
    ]
    if len(rising) != 1:
        return None
    column, clock = rising[0]
    reported = ticks_a_second((column.remark, table.units.get(column.name, ""), column.name, *table.preamble))
    if reported is None:
        return None
    clock.time_s = clock.time_s / reported[0]
    return clock, float(f"{1.0 / reported[0]:.15g}"), f"a counter of {reported[0]:g} a second, by '{reported[1]}'"


def _take_clock(clock: Clock, column: Column, reported: Answers, guess: Guess) -> None:
    if clock.odd:
        guess.ask("time_s", f"{column.shown} {clock.odd}", Line("time_s", column.entry(clock.unit), clock.why))
    elif clock.asks:
        text = f"{column.shown} {without_unit(column)}, and its steps may be of {' or '.join(clock.asks)}: which?"
        guess.ask("time_s", text, *(Line("time_s", column.entry(unit), unit) for unit in clock.asks))
    else:
        down = {"scale": -1.0} if _counts_down(column) else {"scale": clock.scale} if clock.scale != 1.0 else {}
        entry = reported.with_more("time_s", column.entry(clock.unit, wrap=clock.wrap, **down))
        guess.take("time_s", entry, clock.why, assumed=clock.concluded)
        if (apart := usual_step(clock.time_s)) > SLOWEST_S:
            guess.warnings.append(f"{column.shown}: {clock.why}, and its rows are then {apart:.4g} s apart")
    if clock.restarts:
        guess.options["restarts"] = True
    if clock.repeats:
        guess.options["repeats"] = clock.repeats
    if clock.again:
        share = f"{number_text(100.0 * clock.again, 2)} % of the rows have the stamp of the row before"
        guess.notes.append(f"{column.shown}: {share}: they are spread over the time of a stamp")
    guess.notes += clock.notes
