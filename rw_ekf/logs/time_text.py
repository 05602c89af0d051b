"""Dates and times of day as text, in seconds.

A date counts from 1970 in UTC (without a zone: in the one that is given, else as if it were UTC). A time of day alone
counts from midnight, and a day is added where it begins anew. `05/04/2026` is the fifth of April unless some second
number is above 12: within a run it makes no difference.
"""

from __future__ import annotations

import datetime
import re
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from rw_ekf.arrays import Float64Array, Int64Array
from rw_ekf.logs.local_time import utc_of_local

if TYPE_CHECKING:
    from zoneinfo import ZoneInfo

DAY_S = 86400.0
_MONTHS = {
    name: number
    for number, name in enumerate(
        ["jan", "feb", "mar", "apr", "may", "jun", "jul", "aug", "sep", "oct", "nov", "dec"], 1
    )
}
_TEXT = re.compile(
    r"(?:(?P<date>\d{1,4}[-/.]\d{1,2}[-/.]\d{1,4}|\d{1,2}[- ]?[A-Za-z]{3}[a-z]*[- ,]*\d{2,4}|\d{8})(?:[T _,/-]+|$))?"
    r"(?:(?P<h>\d{1,3}):(?P<m>\d{2})(?::(?P<s>\d{2})(?:(?:[.,;]|::?)(?P<f>\d+))?)?\s*(?P<half>[AaPp][Mm])?)?"
    r"\s*(?P<zone>Z|UTC|GMT|[+-]\d{2}(?::?\d{2})?)?"
)
_DAY_OF_YEAR = re.compile(  # CCSDS, SCOS: 2023-073T10:58:12.250Z, 2023.073.10.58.12.250
    r"(?P<year>(?:19|20)\d\d)[-/.:](?P<day>[0-3]\d\d)[-T./: ]"
    r"(?P<clock>\d{2}[.:]\d{2}[.:]\d{2})(?P<rest>(?:[.,:]\d+)?(?:Z| ?UTC)?)"
)
_OF_AN_HOUR = re.compile(r"(\d{1,2}:\d{2}[.,]\d+)")  # Excel's mm:ss.0
_OF_ONE_DIGIT = re.compile(r"^0:(\d:)")  # minutes behind an hour
_HOUR_S, _HALF_S = 3600.0, 43200.0
_NEARLY = 0.98  # of twelve hours, by which a clock falls that continues from 12:59 to 1:00
_POINTED = re.compile(r"(?P<h>[01]?\d|2[0-3])\.(?P<m>[0-5]\d)\.(?P<s>[0-5]\d)(?P<f>[.,:]\d+)?")  # 10.58.12,250
_DAYS = re.compile(r"(?P<days>\d{1,6}) days?,? +(?=\d)")  # 0 days 00:00:12.250000, as pandas writes a Timedelta
_DURATION = re.compile(  # ISO 8601: PT1M0.25S
    r"P(?=\d|T\d)(?:(?P<d>\d+)D)?(?:T(?:(?P<h>\d+)H)?(?:(?P<m>\d+)M)?(?:(?P<s>\d+(?:[.,]\d+)?)S)?)?"
)
_SECONDS = {"d": DAY_S, "h": 3600.0, "m": 60.0, "s": 1.0}
_YEARS = 2  # at most in a log: what has more last parts than that is hours, minutes and seconds, and no date


def is_odd_stamp(text: str) -> bool:
    """Whether a text is a day of a year with its time, minutes and seconds with a fraction, or a time with points."""
    return any(form.fullmatch(text) for form in (_DAY_OF_YEAR, _OF_AN_HOUR, _POINTED, _DURATION)) or bool(
        _DAYS.match(text)
    )


def seconds_of(cells: Sequence[str | None], zone: ZoneInfo | None = None) -> Float64Array | None:
    """Seconds (n,) of stamps, NaN where a cell is empty; None where one of them is no stamp.

    zone: of dates that bear none themselves; None: UTC.
    """
    first = next((cell.strip() for cell in cells if cell and cell.strip()), "")
    if _OF_AN_HOUR.fullmatch(first):
        stated = [cell.strip() if cell else "" for cell in cells]
        hours = seconds_of([cell and _OF_ONE_DIGIT.sub(r"0:0\1", f"0:{cell}") for cell in stated])
        return None if hours is None else past_full(hours, _HOUR_S)
    if _DURATION.fullmatch(first):
        return _durations(cells)
    cells = _with_colons(cells)
    dates: dict[str, int] = {}
    which = np.full(len(cells), -1)
    found, is_local = np.full(len(cells), np.nan), np.zeros(len(cells), dtype=np.bool_)
    dated = False
    for row, cell in enumerate(cells):
        text = "" if cell is None else cell.strip()
        if not text:
            continue
        if (of_year := _DAY_OF_YEAR.fullmatch(text)) is not None:
            text = _as_date(of_year)
        since = _DAYS.match(text)
        match = _TEXT.fullmatch(text if since is None else text[since.end() :])
        if match is None or not (match["date"] or match["h"]):
            return None
        seconds = 0.0
        if match["date"]:
            dated, is_local[row] = True, match["zone"] is None
            which[row] = dates.setdefault(match["date"], len(dates))
        if since is not None:
            dated, seconds = True, DAY_S * int(since["days"])
        if match["h"]:
            seconds += _of_day(match)
        found[row] = seconds - _zone_s(match["zone"])
    if dates:
        days = _days(list(dates), which, found)
        if days is None:
            return None
        found[which >= 0] += days[which[which >= 0]]
    if zone is not None:
        found[is_local] = utc_of_local(found[is_local], zone)
    return found if dated else past_midnight(past_noon(found))


def _durations(cells: Sequence[str | None]) -> Float64Array | None:
    """Seconds (n,) of durations, NaN where a cell is empty; None where one of them is none."""
    found = np.full(len(cells), np.nan)
    for row, cell in enumerate(cells):
        if cell and cell.strip():
            if (match := _DURATION.fullmatch(cell.strip())) is None:
                return None
            parts = match.groupdict("0").items()
            found[row] = sum(_SECONDS[part] * float(text.replace(",", ".")) for part, text in parts)
    return found


def _with_colons(cells: Sequence[str | None]) -> Sequence[str | None]:
    """Times of day that were written with points, with colons; all other cells as they are."""
    found = [_POINTED.fullmatch(cell.strip()) for cell in cells if cell and cell.strip()]
    times = [match for match in found if match is not None]
    if len(times) < len(found) or not (any(m["f"] for m in times) or len({m["s"] for m in times}) > _YEARS):
        return cells
    return [cell and cell.strip().replace(".", ":", 2) for cell in cells]


def past_midnight(seconds: Float64Array) -> Float64Array:
    """Add a day wherever times of day (n,) begin anew."""
    return past_full(seconds, DAY_S)


def past_noon(seconds: Float64Array) -> Float64Array:
    """The same of a clock of twelve hours that says no half of the day: after 12:59:59 it begins anew at 1:00."""
    fall = np.diff(seconds[np.isfinite(seconds)])
    fall = fall[fall < -0.5 * _HALF_S]
    of_twelve = bool(np.all((seconds >= _HOUR_S) & (seconds < _HALF_S + _HOUR_S) | np.isnan(seconds)))
    return (
        past_full(seconds, _HALF_S) if of_twelve and fall.size and bool(np.all(fall < -_NEARLY * _HALF_S)) else seconds
    )


def past_full(seconds: Float64Array, full_s: float) -> Float64Array:
    """Add a day, or an hour [s], wherever times of it (n,) begin anew."""
    filled = np.flatnonzero(np.isfinite(seconds))
    falls = np.diff(seconds[filled]) < -0.5 * full_s
    times = np.zeros(len(seconds))
    times[filled[1:]] = np.cumsum(falls)
    return np.asarray(seconds + full_s * times)


def _as_date(match: re.Match[str]) -> str:
    """A day of a year, with its time, as a date."""
    date = datetime.date(int(match["year"]), 1, 1) + datetime.timedelta(days=int(match["day"]) - 1)
    return f"{date.isoformat()}T{match['clock'].replace('.', ':')}{match['rest']}"


def _of_day(match: re.Match[str]) -> float:
    hours = int(match["h"])
    if match["half"]:
        hours = hours % 12 + (12 if match["half"].lower() == "pm" else 0)
    part = f"0.{match['f']}" if match["f"] else "0"
    return 3600.0 * hours + 60.0 * int(match["m"]) + int(match["s"] or 0) + float(part)


def _zone_s(zone: str | None) -> float:
    if zone is None or zone[0] not in "+-":
        return 0.0
    return (1.0 if zone[0] == "+" else -1.0) * (3600.0 * int(zone[1:3]) + 60.0 * int(zone[3:].strip(":") or 0))


def _day(text: str, order: str) -> float | None:
    """Seconds from 1970 to the begin of a day; None where there is no such day. order: of its parts, as `dmy`."""
    named = re.fullmatch(r"(\d{1,2})[- ]?([A-Za-z]{3})[a-z]*[- ,]*(\d{2,4})", text)
    if named:
        parts = {"y": int(named[3]), "m": _MONTHS.get(named[2].lower(), 0), "d": int(named[1])}
    elif len(text) == 8 and text.isdigit():
        parts = {"y": int(text[:4]), "m": int(text[4:6]), "d": int(text[6:])}
    else:
        numbers = re.split(r"[-/.]", text)
        parts = dict(zip("ymd" if len(numbers[0]) > 2 else order, map(int, numbers), strict=True))
    year = parts["y"] + (2000 if parts["y"] < 70 else 1900 if parts["y"] < 100 else 0)
    try:
        return DAY_S * (datetime.date(year, parts["m"], parts["d"]).toordinal() - datetime.date(1970, 1, 1).toordinal())
    except ValueError:
        return None


def _days(dates: list[str], which: Int64Array, of_day_s: Float64Array) -> Float64Array | None:
    """Seconds from 1970 to the begin of each of some days (d,); None where one is none.

    which, of_day_s (n,): which day each stamp is of, -1 where it has none, and how late in it. Days stand before months
    where both orders make days of all; but a run that goes over midnight goes into the next day, and not into the same
    day of the next month, or year, at the same moment.
    """
    ways = []
    for order in ("dmy", "ymd") if any("." in date for date in dates) else ("dmy", "mdy", "ymd"):
        days = [_day(date, order) for date in dates]
        known = [day for day in days if day is not None]
        if len(known) == len(days):
            ways.append(np.array(known))
    rows = which >= 0

    def longest(days: Float64Array) -> float:
        return float(np.max(np.abs(np.diff(days[which[rows]] + of_day_s[rows])), initial=0.0))

    if len(ways) > 1 and len(dates) > 1 and longest(ways[0]) > DAY_S:
        on = _HOUR_S if np.any(of_day_s[rows]) else DAY_S  # of dates alone, which have their times beside them
        return next((days for days in ways[1:] if longest(days) <= on), ways[0])
    return ways[0] if ways else None
