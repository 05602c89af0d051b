"""Counts, of an encoder or of pole pairs: how many are a turn, and of which time, as far as the file says."""

from __future__ import annotations

import re

from rw_ekf.arrays import Float64Array
from rw_ekf.logs.column_clock import rate_in
from rw_ekf.logs.column_records import Column
from rw_ekf.logs.column_units import unit_of
from rw_ekf.logs.raw_table import RawTable
from rw_ekf.logs.row_rules import is_even, usual_step

_SAME = 0.03  # relative: an interval that is stated, and the step of the clock, are the same
_EVEN = 0.1  # of a step: where rows come as evenly, their interval is one
_TIMED = r"(\d+(?:[.,]\d+)?)[ _]?([mu]?s)(?![a-z])"
_A_ROW = r"(?:row|sample|print\w*|record|message|reading|loop|interval|update|poll|zeile|abtast\w*|intervall)"
# Counts of one row alone: since the one before, or in its own interval of time. Lines and cycles are the encoder's too.
SINCE_LAST = re.compile(
    r"(?:counts?|cnts?|ticks?|inc\w*|inkr\w*|pulses|edges)\b.{0,30}?(?:"
    rf"\b(?:since|seit)\b.{{0,12}}\b(?:last|previous|prior|letzte\w*) (?:line|{_A_ROW})\b|"
    rf"(?:\bper|\bpro|/|\bin)[ _]?(?:the |each |last )*(?:{_A_ROW}\b|{_TIMED}))",
    re.IGNORECASE,
)
_INTERVAL = re.compile(
    rf"(?:per|pro|/|\bin|each|every|alle|of|interval|period)\W{{0,3}}(?:the )?(?:last )?{_TIMED}", re.IGNORECASE
)
_PAIRS = re.compile(r"pole[_ ]?pairs?\W{0,4}(\d{1,3})(?![\d.])|(?<![\d.])(\d{1,3}) ?pole[_ ]?pairs?", re.IGNORECASE)
_POLES = re.compile(r"(?<![a-z])poles\W{0,4}(\d*[02468])(?![\d.])|(?<![\d.])(\d*[02468])[ _-]?poles\b", re.IGNORECASE)
_COUNTS = re.compile(r"(\d{2,8})\s*(?:counts?|cnts?|inc\w*)\s*(?:/|per\s|pro\s)\s*(?:turn|rev|u\b|umdr)", re.IGNORECASE)
_QUADRATURE = re.compile(
    r"quadratur|\b(x4|4x)\b|\blines?\b|\bppr\b|\d+ppr\b|\bslots?\b|strich|cycles per", re.IGNORECASE
)
_PER_TURN = tuple(
    re.compile(pattern, re.IGNORECASE)
    for pattern in (
        r"(\d{2,8})\s*(?:counts?|cpr|ppr|ticks?|inc\w*|pulses|lines|steps)?\s*(?:/|per\s|pro\s)\s*(?:turn|rev|u\b|umdr)",
        r"(?:cpr|ppr|(?:counts?|ticks|inc\w*|steps|pulses)[ _-]*(?:per|pro|/)[ _-]*(?:turn|rev\w*|umdr\w*))"
        r"\D{0,4}(\d{2,8})",
        r"(\d{2,8})\s*(?:cpr|ppr)\b",
        r"(\d{2,8})\W{0,3}(?:\w+ ){0,2}(?:counts?|ticks?|inc\w*|pulses|lines|steps) (?:per|pro) (?:turn|rev|umdr)",
    )
)


def is_since_last(column: Column) -> bool:
    """Whether each row has the counts of its own interval alone, by what is stated of the column."""
    return any(SINCE_LAST.search(text.replace("_", " ")) is not None for text in (column.name, column.remark))


def interval_of(table: RawTable, column: Column, time_s: Float64Array | None) -> float | None:
    """How long an encoder is counted for a row, as the file says and the clock bears out; None where they do not."""
    stated = {
        float(match[1].replace(",", ".")) * unit.factor
        for match in _INTERVAL.finditer(f"{column.name} {column.remark}".replace("_", " "))
        if (unit := unit_of(match[2])) is not None
    }
    if not stated and (rate := rate_in(table.preamble)) is not None:
        stated = {1.0 / rate[0]}
    usual = 0.0 if time_s is None else usual_step(time_s)
    if not stated and time_s is not None and is_even(time_s, _EVEN):
        return usual
    interval = stated.pop() if len(stated) == 1 else None
    return interval if interval is not None and (not usual or abs(interval - usual) < _SAME * usual) else None


def per_turn(table: RawTable, column: Column) -> float | None:
    """How many counts a turn has, where a name or a line above the names says so."""
    texts = (column.name, column.remark, *table.preamble, *table.names)
    reported = next((found for text in texts if (found := _COUNTS.search(text))), None)
    if reported is None and any(_QUADRATURE.search(text) for text in texts):
        return None  # lines of a disc, or their four edges?
    patterns = (_COUNTS,) if reported is not None else _PER_TURN
    found_numbers = {float(found[1]) for text in texts for pattern in patterns for found in pattern.finditer(text)}
    return found_numbers.pop() if len(found_numbers) == 1 else None  # several are of several encoders


def pole_pairs(table: RawTable, column: Column) -> float | None:
    """How many pole pairs the motor has, where the file says one number."""
    texts = (column.name, column.remark, *table.preamble)
    numbers = ((each, match) for text in texts for each in (_PAIRS, _POLES) for match in each.finditer(text))
    found = {float(match[1] or match[2]) / (2.0 if each is _POLES else 1.0) for each, match in numbers}
    return found.pop() if len(found) == 1 else None
