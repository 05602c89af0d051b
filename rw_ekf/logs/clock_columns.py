"""A time whose parts stand in columns of their own: hours, minutes and seconds, with a date or a week's number."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np

from rw_ekf.arrays import Float64Array
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
_FALLS = 0.01  # of the rows, at most
_NO_YEAR = 2001  # of which a month and a day are taken to be


def with_clock_columns(table: RawTable) -> RawTable:
    """The table with one more column, the time [s] that several are the parts of; itself where there are none.

    Minutes, or weeks, beside seconds that begin anew with each; a date, in columns or as one, is added to hours. The
    columns stay where they are, and are no times any more.
    """
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
    told = {_PART[word] for word in words if word in _PART and (word not in _BESIDE or len(words) == 1)}
    rest = [word for word in words if word not in _PART and word not in _BESIDE]
    return told.pop() if len(told) == 1 and not rest else ""


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
            if np.isfinite(seconds).all() and seconds[0] >= DAY_S and not np.any(seconds % DAY_S):
                return seconds + time_s, {number}
    return past_midnight(past_noon(time_s)), set()
