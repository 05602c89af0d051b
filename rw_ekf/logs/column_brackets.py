"""What stands in brackets in a column's name as a unit does, and is none that is known."""

from __future__ import annotations

import re

from rw_ekf.logs.column_counts import SINCE_LAST
from rw_ekf.logs.column_names import role_of, stated_by
from rw_ekf.logs.column_records import Column
from rw_ekf.logs.column_units import unit_of
from rw_ekf.logs.column_words import BACKWARD, FORWARD, WORDS

BRACKETED = re.compile(r"[\[(<{]([^\])>}]+)[\])>}]")
_ODD = re.compile(r"\d|%|\u00b3|thousand|hundred|tenth|\bunits?\b|(?<!\w)\w\.\w", re.IGNORECASE)  # arb. units, a.u.
_LIKE_A_UNIT = re.compile(
    r"[a-z]?(A|V|Amps?|Arms|Apk|Vrms|Hz|RPM)(rms|pk|peak|eff|p|pp|p-p|dc|ac)?"
)  # of no known meaning
_OBJECT = re.compile(  # of a drive, by its number: 0x606C.00, 01.07, 16-17
    r"(0x)?[0-9a-f]{4}h?([.:/](0x)?[0-9a-f]{1,2}h?)?|\d{2}[.:-]\d{2,3}", re.IGNORECASE
)
_A_WORD = 3  # letters: shorter is a unit, or an axis
_AXES = frozenset(["x", "y", "z", "q", "d", "m", "w"])
_INDEX = re.compile(r"(?<=\w)\[\d{1,3}\]")  # r61[0], of one among several


def unread(column: Column) -> str:
    """What stands in brackets in a name and is no unit, word or index: `[0.25 rpm]`, `(thousands of rpm)`, `[%FS]`.

    The last unit in brackets is the column's: one before it that measures something else becomes a question.
    """
    stated, name = column.stated.unit, column.bare_name or column.name
    for text in BRACKETED.findall(_INDEX.sub("", name)):
        known, short = unit_of(text), len(text) < _A_WORD and text.lower() not in _AXES
        another = known is not None and stated is not None and known.quantity != stated.quantity
        symbol = len(text) == 1 and role_of(stated_by(text)) == column.role  # time(t), speed(n)
        if symbol or SINCE_LAST.search(text) or (stated is not None and _OBJECT.fullmatch(text)):  # counts, understood
            continue
        odd = short or _ODD.search(text) or _LIKE_A_UNIT.fullmatch(text) or any(map(unit_of, text.split("/")))
        if another or (known is None and (odd or (stated is None and _is_no_word(text, name)))):
            return str(text)
    return ""


def _is_no_word(text: str, name: str) -> bool:
    """Whether what ends a name in square brackets says nothing of it, as only a unit does: `[Skt]`, `[raw]`."""
    words = {word for word in stated_by(text).words if len(word) > 1}
    reported = text.lower() in FORWARD | BACKWARD | _AXES or any(words & known for known in WORDS.values())
    reported &= text.lower() != "raw"
    return name.rstrip().endswith(f"[{text}]") and not reported


def without_unit(column: Column) -> str:
    """A clause of a question: that a column has no unit, or none that is known."""
    text = unread(column)
    return f"is in {text!r}, which is no unit that is known" if text else "has no unit"
