"""A time whose parts stand in columns of their own.

Hours, minutes and seconds, with a date or a week's number; whole seconds and a part of one; a date and a time of day.
"""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np

from rw_ekf.arrays import Float64Array
from rw_ekf.logs.column_names import role_of, stated_by
from rw_ekf.logs.raw_table import RawTable
from rw_ekf.logs.row_rules import goes_with_seconds
from rw_ekf.logs.time_text import DAY_S, past_full, past_midnight, past_noon

_WORDS = {
    "week": "week woche wk wn",
    "year": "year yr yyyy jahr annee année ano año",
    "month": "month mon monat mois mes",
    "day": "day dd tag jour dia día",
    "hour": "hour hours hr hrs h hh stunde stunden std heure heures hora",
    "minute": "minute minutes min mins minuten minuto mm m",
    "second": "second seconds sec secs s ss sekunde sekunden sek seconde secondes segundo tow sow",
    "ms": "ms msec msecs milli millis millisecond milliseconds millisekunde millisekunden",
    "us": "us usec usecs micro micros microsecond microseconds",
}
_PART = {word: part for part, words in _WORDS.items() for word in words.split()}
_BESIDE = frozenset(["time", "utc", "gps", "local", "zeit", "clock", "of", "the", "temps", "heure", "hora", "gmt"])
_SECONDS = {"week": 7.0 * DAY_S, "hour": 3600.0, "minute": 60.0, "second": 1.0, "ms": 1.0e-3, "us": 1.0e-6}
_FULL = {"hour": 24.0, "minute": 60.0, "ms": 1.0e3, "us": 1.0e6, "month": 13.0, "day": 32.0}  # where each begins anew
_HOUR_S, _CENTURY = 3600.0, 100.0
_FALLS = 0.01  # of the rows, at most, where columns together are a time
_NO_YEAR = 2001  # of which a month and a day are taken to be
_WHOLE = 1.0e-6  # [s] from whole seconds, as floats since 1970 have them
MAY_BE_A_PART = ("other", "time", "count", "segment")
_PARTS_OF_A_SECOND = (1.0, 1e-2, 1e-3, 1e-6, 1e-9)
_ALIKE = 5.0  # times the steps within a second, at most, are those into the next: else of other parts
_SECONDS_NAMED = re.compile(r"(.*?)(sec(s|onds?)?|tv_sec|s)", re.IGNORECASE)
_PARTS_NAMED = {
    1e-9: re.compile(r"(.*?)(nano?sec(s|onds?)?|nsecs?|tv_nsec|ns|nanos)", re.IGNORECASE),
    1e-6: re.compile(r"(.*?)(micro?sec(s|onds?)?|usecs?|tv_usec|us|micros)", re.IGNORECASE),
    1e-3: re.compile(r"(.*?)(milli?sec(s|onds?)?|msecs?|ms|millis)", re.IGNORECASE),
}


def with_clock_columns(table: RawTable) -> RawTable:
    """The table with one more column, the time [s] that several are the parts of; itself where there are none.

    Minutes, or weeks, beside seconds that begin anew with each; a date, in columns or as one, is added to hours. The
    columns stay where they are, and are no times any more.
    """
    if table.rows < 2:  # nothing rises
        return table
    found: dict[str, int] = {}
    for number, name in enumerate(table.names):
        part = _part_of(name)
        if part and part in found:
            return table
        if part and table.is_plain_number(number):
            found[part] = number
    if "hour" not in found and any(table.names[at].lower() in ("m", "s") for at in found.values()):
        return table  # metres, or a slip
    values = _of_one_clock({part: table.numbers(number) for part, number in found.items()})
    time_s = _time(values)
    if time_s is None:
        return table
    time_s, dated = _with_date(table, values, time_s)
    if float(np.mean(np.diff(time_s) < 0.0)) > _FALLS:
        return table
    used = [table.names[number] for number in sorted({*(found[part] for part in values), *dated})]
    whole = " + ".join(used)
    text = f"{table.path}: the time is taken from '{whole}' together"
    return replace(
        table, names=(*table.names, f"time of {whole} [s]"), columns=[*table.columns, time_s],
        warnings=[*table.warnings, text], parts_of_time=frozenset(used),
    )  # fmt: skip


def _part_of(name: str) -> str:
    """Which part of a time a name says, and nothing else; empty for any other."""
    words = re.findall(r"[^\W\d_]+", name.lower())
    parts = {_PART[word] for word in words if word in _PART and (word not in _BESIDE or len(words) == 1)}
    rest = [word for word in words if word not in _PART and word not in _BESIDE]
    return parts.pop() if len(parts) == 1 and not rest else ""


def _of_one_clock(values: dict[str, Float64Array]) -> dict[str, Float64Array]:
    """The parts without what is none of the second's: thousandths that do not begin anew with it."""
    if not values.keys() >= {"second", "minute"}:
        return {part: held for part, held in values.items() if part not in ("ms", "us")}
    seconds = past_full(60.0 * values["minute"] + values["second"], _HOUR_S)
    finer: list[str] = []
    for part, coarser in (("ms", seconds), ("us", values.get("ms", seconds))):
        if part in values and np.array_equal(coarser, np.round(coarser)) and _begins_anew(coarser, values[part], part):
            finer.append(part)
    return {part: held for part, held in values.items() if part not in ("ms", "us") or part in finer}


def _begins_anew(coarser: Float64Array, part: Float64Array, name: str) -> bool:
    """Whether numbers go up to where they begin anew, while one of the coarser lasts."""
    if name == "us" and np.any(np.diff(coarser) < 0.0):  # beside thousandths, which begin anew themselves
        coarser = past_full(coarser, _FULL["ms"])
    return float(part.max()) >= 0.5 * _FULL[name] and goes_with_seconds(coarser, part)


def _time(values: dict[str, Float64Array]) -> Float64Array | None:
    """Seconds (n,) of the parts that are not a date; None where they are no time."""
    if "second" not in values or not values.keys() & {"minute", "week"}:
        return None
    if not all(np.isfinite(held).all() for held in values.values()):
        return None
    within = {**_FULL, "second": 60.0 if "minute" in values else _SECONDS["week"]}
    if "hour" not in values:  # minutes since the start, or past the hour
        within.pop("minute")
    if any(np.any((held < 0.0) | (held > within.get(part, np.inf))) for part, held in values.items()):
        return None
    whole = [held for part, held in values.items() if part != "second"]
    if not all(np.array_equal(held, np.round(held)) for held in whole):
        return None
    coarse = values["minute" if "minute" in values else "week"]
    on = np.diff(coarse) != 0.0
    if np.any(np.diff(values["second"])[on] >= 0.0):  # seconds of something else
        return None
    total = np.zeros(len(coarse))
    for part, held in values.items():
        total += _SECONDS.get(part, 0.0) * held
    return total if "hour" in values or "week" in values else past_full(total, _HOUR_S)


def _with_date(table: RawTable, values: dict[str, Float64Array], time_s: Float64Array) -> tuple[Float64Array, set[int]]:
    """Times of day (n,) with the days of a date beside them, and the column of it where it is one."""
    if "hour" not in values:
        return time_s, set()
    if {"month", "day"} <= values.keys():
        year = values.get("year", np.full(len(time_s), float(_NO_YEAR)))
        year = np.where(year < _CENTURY, 2000.0 + year, year)
        months = (year.astype(np.int64) - 1970) * 12 + values["month"].astype(np.int64) - 1
        days = months.astype("datetime64[M]").astype("datetime64[D]").astype(np.float64) + values["day"] - 1.0
        return DAY_S * days + time_s, set()
    if "day" in values:
        return DAY_S * values["day"] + time_s, set()
    for number in range(len(table.names)):
        if not table.is_plain_number(number):
            seconds = table.numbers(number, stamps=True)
            if np.isfinite(seconds).all() and _are_dates(seconds):
                return seconds + time_s, {number}
    return past_midnight(past_noon(time_s)), set()


def _are_dates(seconds: Float64Array) -> bool:
    """Whether stamps (n,) are days, without a time of day."""
    return bool(seconds.size and seconds[0] >= DAY_S and not np.any(seconds % DAY_S))


def with_whole_time(table: RawTable) -> RawTable:
    """The table with a column `sec + nsec [s]` where its time is in two, whole seconds and a part of one.

    So it is where dates stand beside times of day: these then have the days too.
    """
    table = _with_days(table)
    for first, name in enumerate(table.names):
        whole = _SECONDS_NAMED.fullmatch(name)
        stamped = not table.is_plain_number(first) and role_of(stated_by(name)) == "time"
        if whole is None and not stamped:
            continue
        for factor, pattern in _PARTS_NAMED.items():
            for second, other in enumerate(table.names):
                part = pattern.fullmatch(other)
                if part is None or part[1] != ("" if whole is None else whole[1]):
                    continue
                seconds, rest = table.numbers(first, stamps=True), table.numbers(second)
                if not _is_part(seconds, factor * rest):
                    continue
                return _joined(table, first, second, seconds + factor * rest)
    return _with_what_begins_anew(table)


def _joined(table: RawTable, first: int, second: int, time_s: Float64Array) -> RawTable:
    """The table with a time (n,) that two columns make, of an epoch to a quarter of a microsecond, as any float."""
    name = f"{table.names[first]} + {table.names[second]} [s]"
    return replace(table, names=(*table.names, name), columns=[*table.columns, time_s])


def _with_what_begins_anew(table: RawTable) -> RawTable:
    """The same where no name says it: a column that begins anew with each second of another is what it lacks."""
    stated = [stated_by(name) for name in table.names]
    parts = {
        second: values
        for second, each in enumerate(stated)
        if role_of(each) in MAY_BE_A_PART and table.is_plain_number(second)
        and (values := table.numbers(second)).size and values.min() >= 0.0 and np.any(np.diff(values) < 0.0)
    }  # fmt: skip
    clocks = [number for number, each in enumerate(stated) if parts and role_of(each) == "time" and number not in parts]
    for first in clocks:
        seconds = table.numbers(first, stamps=True)
        for second, values in parts.items():
            unit = stated[second].unit
            for factor in _PARTS_OF_A_SECOND if unit is None else (unit.factor,):
                if goes_with_seconds(seconds, values) and _is_part(seconds, part_s := factor * values):
                    step, anew = np.diff(seconds + part_s), np.diff(seconds) > 0.0
                    if float(np.median(step[anew])) < _ALIKE * float(np.median(step[~anew])):
                        joined = _joined(table, first, second, seconds + part_s)
                        text = f"'{table.names[second]}' begins anew with each second of '{table.names[first]}'"
                        joined.warnings = [*table.warnings, f"{table.path}: {text}: it is taken for the part of it"]
                        return joined
    return table


def _with_days(table: RawTable) -> RawTable:
    """The table, its only times of day as seconds since 1970 where the only dates beside them are of several days."""
    stamps = [number for number in range(len(table.names)) if not table.is_plain_number(number)]
    if len(stamps) < 2:
        return table
    held = {number: table.numbers(number, stamps=True) for number in stamps}
    held = {number: seconds for number, seconds in held.items() if np.isfinite(seconds).all() and seconds.size > 2}
    dates = [number for number, seconds in held.items() if _are_dates(seconds)]
    times = [number for number, seconds in held.items() if seconds[0] < DAY_S]
    if len(dates) != 1 or len(times) != 1 or np.ptp(held[dates[0]]) == 0.0:
        return table
    seconds = held[dates[0]] + held[times[0]] % DAY_S
    if float(np.mean(np.diff(seconds) < 0.0)) >= _FALLS:
        return table
    import pyarrow as pa

    columns = list(table.columns)
    columns[times[0]] = pa.array(np.round(1e6 * seconds).astype(np.int64), type=pa.timestamp("us"))  # stamps as before
    return replace(table, columns=columns)


def _is_part(seconds: Float64Array, part_s: Float64Array) -> bool:
    """Whether one column is whole seconds and the other what is missing to the time, which then never falls."""
    if not (np.isfinite(seconds).all() and np.isfinite(part_s).all() and len(seconds) > 2):
        return False
    within = bool(np.all((part_s >= 0.0) & (part_s < 1.0)) and np.all(np.abs(seconds - np.round(seconds)) < _WHOLE))
    return within and float(np.mean(np.diff(seconds + part_s) < 0.0)) < _FALLS
