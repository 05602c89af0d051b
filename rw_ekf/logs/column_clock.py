"""Which column is a clock, in which unit, and what is odd about it: it wraps, begins anew, or its stamps are coarse."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np

from rw_ekf.arrays import Float64Array
from rw_ekf.logs.column_names import Stated
from rw_ekf.logs.column_units import unit_of
from rw_ekf.logs.row_rules import restarted, unwrapped, usual_step

EPOCHS = (
    (1.0e9, 2.3e9, "s", "1970"), (1.0e12, 2.3e12, "ms", "1970"), (1.0e15, 2.3e15, "us", "1970"),
    (1.0e18, 2.3e18, "ns", "1970"), (6.2e17, 6.5e17, "100 ns", "year 1, as .NET does,"),
    (1.2e17, 1.4e17, "100 ns", "1601, as Windows does,"),
)  # fmt: skip
_SERIAL_DAYS = (
    (3.0e4, 6.5e4, "Excel has them"), (6.9e5, 7.8e5, "MATLAB has them"), (2.44e6, 2.48e6, "Julian dates are"),
)  # fmt: skip
_WINCC = (3.0e10, 6.5e10)  # 1982 to 2077 in millionths of a day
_COUNTERS = (2.0**32, 2.0**16, 2.0**24, 2.0**31, 2.0**30)  # of 30 bits: MicroPython's ticks_ms()
_BILLION = 1.0e9
_REPEATED = 0.01  # of the rows: beyond it, they are no accident
_BACKWARD = 0.02  # of the rows: beyond it, a column is no clock
SLOWEST_S, FASTEST_S = 5.0, 2.0e-4  # between rows
_SHORTEST_S = 3.0  # that a log lasts whose unit is concluded from its steps
_SLOW_US = 3.0e5  # between rows, in whole numbers: us would be fewer than 3 rows a second, 100 ns or ns more
_ROUND = 5.0e-3  # relative
_A_SECOND = 0.9  # between rows, with decimals: less is in seconds
_THOUSAND = (900.0, 1100.0)  # between rows, in whole numbers: ms at 1 Hz or us at 1 kHz; less is ms, more is us
_HERTZ = r"(\d+(?:[.,]\d+)?(?:e[+-]?\d+)?)\s*([kM]?)Hz"
_COUNTER_WORDS = r"(?:tick|clock|timer|counter|counts|interrupt|cycle|takt|zaehler|zähler)"
_TICK_RATE = re.compile(rf"{_COUNTER_WORDS}[^\d]{{0,25}}{_HERTZ}", re.IGNORECASE)
_TICK = re.compile(
    rf"{_COUNTER_WORDS}s?\W*(?:period|length|resolution|dauer|step)?\s*(?:=|:|is|of)\s*"
    r"(\d*[.,]?\d+(?:e[+-]?\d+)?)\s*([nuµm]?)s\b",
    re.IGNORECASE,
)
_STAMPS = r"(?:time ?stamps?|timestamps?|time|ticks?)"
_UNIT_OF_STAMPS = (  # a line that says nothing else: timestamp unit: 10 us; ticks: 10 us per count
    re.compile(
        rf"\W*{_STAMPS}(?: column)?\W+(?:is |are )?(?:in )?units?\b(?: of)?\W*(?P<size>\d+(?:\.\d+)?)?\s*"
        r"(?P<unit>[nuµm]?s)\W*", re.IGNORECASE
    ),
    re.compile(
        rf"\W*(?:{_STAMPS}|timer)\W+(?P<size>\d+(?:\.\d+)?)\s*(?P<unit>[nuµm]?s)\s*(?:/|per )\s*"
        r"(?:count|tick|lsb|digit)\W*", re.IGNORECASE
    ),
)  # fmt: skip
_RATE_OF_STAMPS = re.compile(  # nor does one that says how fast a timer runs, which may be another's
    rf"\W*(?:{_HERTZ}\W+(?:time ?stamp |timestamp )?(?:timer|ticks?|counter)|"
    rf"(?:time ?stamp |timestamp )?(?:timer|ticks?|counter)(?: rate| frequency)?\W+{_HERTZ})\W*",
    re.IGNORECASE,
)
_RATE_OF_TICKS = re.compile(rf"{_HERTZ}\b[^\d]{{0,25}}{_COUNTER_WORDS}", re.IGNORECASE)
_PART_OF_A_SECOND = 0.5  # [s] by which what falls again and again is the part of a second, not a clock
_OF_ROWS = r"(?:sampl\w*|abtast\w*|fs|rate|freq\w*|f_s|increments?|interval\w*|采样\w*|サンプリング\w*)"
_VALUE = r"(?P<value>\d+(?:[.,]\d+)?(?:e[+-]?\d+)?)"
_ROW_RATE = re.compile(
    rf"{_OF_ROWS}\D{{0,25}}?{_VALUE}[\s,;]*(?P<unit>k?hz|k?S/s|k?sps|samples/s|ms|us|s(?:ec\w*)?)\b", re.IGNORECASE
)
_ROW_STEP = re.compile(  # its unit before the number: `Sampling time [ms];50`
    rf"{_OF_ROWS}[^\d\[(]{{0,20}}[\[(]\s*(?P<unit>k?hz|ms|us|s|sec)\s*[\])]\W{{1,4}}{_VALUE}(?!\S*[\d:/])",
    re.IGNORECASE,
)
_STEP_NUMBER = r"\d*\.?\d+(?:e[+-]?\d+)?"
_STEPS = re.compile(  # one for each channel: a `dt` alone is whoever's, and may be in ms
    rf"\W*(?:d_?t(?=\W+{_STEP_NUMBER}[\s,;]+\d)|h[_ ]?resolution|increment)\W+"
    rf"({_STEP_NUMBER}(?:[\s,;]+{_STEP_NUMBER})*)\W*",
    re.IGNORECASE,
)
_STEPS_IN_S = re.compile(  # as a recorder has them
    rf"\W*(?:h[_ ]?unit\W+s\b|start times?\b|t_?0\b|start\W+{_STEP_NUMBER}\W*$)", re.IGNORECASE
)
_OTHER_RATE = re.compile(
    r"every|loop|accelero|vibrat|imu\b|camera|excit|chirp|\badc\b|\bdac\b|oversampl|decimat|averag|anregung|"
    r"pwm|switch|cut.?off|filter|baud|carrier|mains|clock|netz|tick|timer|counter|interrupt",
    re.IGNORECASE,
)


@dataclass(eq=False)
class Clock:
    """A column that may be the time."""

    number: int
    time_s: Float64Array  # (n,)
    unit: str = ""  # as a map has it; empty: seconds, or stamps
    why: str = ""
    asks: tuple[str, ...] = ()  # units that it may have, where that cannot be determined
    wrap: float | None = None
    restarts: bool = False
    repeats: str = ""
    again: float = 0.0  # share of the rows that have the stamp of the row before, where they are many
    rank: int = 0
    is_clock: bool = True
    odd: str = ""  # the question about it, as a clause
    concluded: bool = False  # the unit is, from the steps
    scale: float = 1.0  # how many of the unit a stamp counts in
    notes: list[str] = field(default_factory=list)


def clock_of(
    number: int, name: str, stated: Stated, values: Float64Array, reported: str, stamps: bool, scale: float = 1.0
) -> Clock | None:
    """A column (n,) as a clock; reported: the unit that was given, `scale` of it each. None where no numbers rise."""
    if len(values) < 3 or not np.isfinite(values).all() or float(np.ptp(values)) == 0.0:
        return None
    wrap = _wrap(values)
    raw = unwrapped(values, wrap or 0.0)
    usual = usual_step(raw)
    stated_unit = _unit(name, stated, raw, reported, stamps, usual)
    unit, asks, why = _by_steps(raw, usual) if stated_unit is None else stated_unit
    known = unit_of(unit) if unit else None
    time_s = raw * (scale * (known.factor if known is not None else 1.0))
    clock = Clock(number, time_s, "" if stamps else unit, why, asks, wrap, concluded=stated_unit is None)
    if clock.concluded and _is_packed(raw):
        clock.odd = "jumps where 60 would be full: is it a time of day, or minutes and seconds, without colons?"
    step = np.diff(time_s)
    run = restarted(time_s)
    clock.restarts = bool(run[-1])
    inside = np.diff(run) == 0
    if not inside.any():
        return None
    back = float(np.mean(step[inside] < 0.0))
    part = int(run[-1]) > 2 and float(np.ptp(time_s)) < 1.0 and float(step.min()) < -_PART_OF_A_SECOND
    clock.is_clock = back < _BACKWARD and (bool(asks) or _usual(step[inside])) and not part
    same = float(np.mean(step[inside] == 0.0))
    if same > _REPEATED and clock.is_clock:
        clock.repeats, clock.again = "spread", same
    if clock.restarts:
        clock.notes.append(f"column '{name}' begins anew {int(run[-1])} times: each run is a segment")
    # A clock of the log's own name, then one that counts from the run's begin with a unit, then stamps, then others.
    known_unit = stated.unit is not None and not stamps
    clock.rank = (
        4 if name == "time_s" else 3 if known_unit and not clock.repeats else 2 if stamps and not clock.repeats else 1
    )
    return clock


def no_clock(shown: str, values: Float64Array, stated: Stated) -> str:
    """Why a column (n,) that is called a time is none, with its numbers; empty where it cannot be determined."""
    known = values[np.isfinite(values)]
    if known.size < 3 or float(np.ptp(known)) == 0.0:
        return f"{shown} never changes" if known.size else ""
    step = np.diff(known)
    back = int(np.argmax(step < 0.0))
    if step[back] < 0.0:
        return f"{shown} falls from {known[back]:.6g} to {known[back + 1]:.6g} after {back + 1} rows"
    factor = 1.0 if stated.unit is None else stated.unit.factor
    usual = float(np.median(step)) * factor
    return "" if _usual(step * factor) else f"{shown} would make rows {usual:.3g} s apart, by the unit of its name"


def _usual(step_s: Float64Array) -> bool:
    forth = step_s[step_s > 0.0]
    return forth.size > 0 and FASTEST_S / 4.0 <= float(np.median(forth)) <= 30.0 * SLOWEST_S


def _wrap(values: Float64Array) -> float | None:
    """After how many counts a counter begins anew; None where it does not."""
    step = np.diff(values)
    falls = step < 0.0
    if not falls.any() or not np.all(values == np.round(values)):
        return None
    usual = usual_step(values)
    for turn in _COUNTERS:
        mended = step[falls] + turn
        billionths = turn == 2.0**30 and float(values.max()) < _BILLION  # begin anew with each second
        if not billionths and float(values.max()) < turn and np.all((mended > 0.0) & (mended < max(10.0 * usual, 1.0))):
            return turn
    return None


def _unit(
    name: str, stated: Stated, values: Float64Array, reported: str, stamps: bool, usual: float
) -> tuple[str, tuple[str, ...], str] | None:
    """Unit, what it may be where that is open, and what says so; None where nothing does."""
    if reported:
        return reported, (), "as it was set"
    if stamps:
        return "", (), "its cells are dates or times of day"
    if name == "Time_MS" and _WINCC[0] <= float(np.median(values)) < _WINCC[1]:
        return "1e-6 days", (), "millionths of a day from 1900, as WinCC has them"
    if stated.unit is not None and stated.unit.quantity == "time":
        return stated.unit_text, (), f"its name says {stated.unit_text}"
    if name == "time_s":
        return "", (), "its name is the log's own"
    middle = float(np.median(values))
    for low, high, unit, year in EPOCHS:
        if low <= middle < high and usual < 0.01 * low:
            if unit == "s" and usual > SLOWEST_S:  # or a counter of ms that has come so far
                return "", ("s", "ms"), f"its rows are {usual:.4g} apart"
            return unit, (), f"counts from {year} in {unit}"
    for low, high, whose in _SERIAL_DAYS:
        if low <= middle < high and 0.0 < usual < 1.0e-3 and not np.all(values == np.round(values)):
            return "days", (), f"serial days, as {whose}"
    return None


def _by_steps(values: Float64Array, usual: float) -> tuple[str, tuple[str, ...], str]:
    """The unit that the steps between rows leave: logs have 0.2 to 5,000 rows a second, and last some seconds."""
    whole = bool(np.all(values == np.round(values)))
    reported = f"its rows are {usual:.4g} apart"
    span = float(np.ptp(values))
    if not whole:
        if usual < _A_SECOND:
            units = (("min", 60.0), ("h", 3600.0), ("days", 86400.0))
            longer = next((unit for unit, size in units if _is_round(usual * size)), "")
            return ("", ("s", longer), reported) if longer and not _is_round(usual) else ("s", (), reported)
        return ("ms", (), reported) if usual > SLOWEST_S else ("", ("s", "ms"), reported)
    if usual < SLOWEST_S or (usual < _THOUSAND[0] and 1e-3 * span < _SHORTEST_S):
        return "", ("s", "ms"), reported
    if usual < _THOUSAND[0]:
        return "ms", (), reported
    return ("", ("ms", "us"), reported) if usual < _THOUSAND[1] or usual > _SLOW_US else ("us", (), reported)


def _is_packed(values: Float64Array) -> bool:
    """Whether numbers are a time of day written without colons: they jump by 40 where a minute is full."""
    step = np.diff(values)
    usual = float(np.median(step))
    for second in (1.0, 1000.0, 0.01):  # hhmmss, hhmmssmmm, and minutes.seconds
        whole = np.floor(values / second + 1.0e-6)
        jumps = np.abs(step - usual - 40.0 * second) < max(0.6 * usual, 0.1 * second)
        if usual < 20.0 * second and whole.max() >= 100.0 and float((whole % 100.0).max()) < 60.0 and jumps.any():
            return True
    return False


def _is_round(step: float) -> bool:
    """Whether a step is 1, 2, 2.5, 4, 5 or 8 of a power of ten, as those are that somebody sets."""
    first = step / 10.0 ** math.floor(math.log10(step)) if step > 0.0 else 0.0
    return any(abs(first / digit - 1.0) < _ROUND for digit in (1.0, 2.0, 2.5, 4.0, 5.0, 8.0, 10.0))


def ticks_a_second(texts: Iterable[str]) -> tuple[float, str] | None:
    """How fast a counter runs that stands for the time, and the words that say so."""
    for text in texts:
        match = _TICK_RATE.search(text) or _RATE_OF_TICKS.search(text)
        if match is not None:
            rate = float(match[1].replace(",", ".")) * {"": 1.0, "k": 1e3, "m": 1e6}[match[2].lower()]
            if rate > 0.0:
                return rate, match[0].strip()
        match = _TICK.search(text)
        if match is not None and (length := float(match[1].replace(",", "."))) > 0.0:
            per_second = {"": 1.0, "m": 1e3, "u": 1e6, "µ": 1e6, "n": 1e9}[match[2].lower()]
            return per_second / length, match[0].strip()
    return None


def unit_of_stamps(texts: Sequence[str]) -> tuple[float, str, str] | None:
    """In how many of which unit lines above the names say that a stamp counts, `10 us`, and the words."""
    for text in texts:
        for pattern in _UNIT_OF_STAMPS:
            if (match := pattern.fullmatch(text)) is not None and (size := float(match["size"] or 1.0)) > 0.0:
                return size, match["unit"].replace("µ", "u"), text.strip("# %;")
    return None


def ticks_of_stamps(texts: Sequence[str]) -> tuple[float, str] | None:
    """How fast a timer runs [Hz] that may be the stamps', and the words that say so."""
    return ticks_a_second(text.strip("# %;") for text in texts if _RATE_OF_STAMPS.fullmatch(text))


def rate_in(texts: Sequence[str]) -> tuple[float, str] | None:
    """Rows a second, and the words that say so, where lines above the names have them and agree."""
    found: list[tuple[float, str]] = []
    recorded = any(map(_STEPS_IN_S.match, texts))
    for text in texts:
        if _OTHER_RATE.search(text):
            continue
        if recorded and (step := _STEPS.fullmatch(text)) is not None:  # a step [s] for each channel
            found += [(1.0 / float(each), text.strip()) for each in re.split(r"[\s,;]+", step[1]) if float(each) > 0.0]
        match = _ROW_RATE.search(text) or _ROW_STEP.search(text)
        if match is None:
            continue
        value, unit = float(match["value"].replace(",", ".")), match["unit"].lower()
        if value <= 0.0:
            continue
        if unit.endswith(("hz", "s/s", "sps")):
            rate = value * (1e3 if unit.startswith("k") else 1.0)
        else:
            rate = {"ms": 1e3, "us": 1e6}.get(unit, 1.0) / value
        if 0.1 <= rate <= 1e5:
            found.append((rate, match[0]))
    return found[0] if found and all(abs(rate - found[0][0]) < 1e-3 * rate for rate, _ in found) else None
