"""What lines above the rows say of each column in a block of its own: name, unit, and what its numbers are times.

    CH2.Name=Wheel speed      [Channel 2]             OBJECT = COLUMN
    CH2.Unit=rpm              Name=Wheel speed          NAME = "WHEEL_SPEED"
    CH2.Factor=0.1            Unit=rpm                  UNIT = "RPM"

A name alone, `Channel 2: Wheel speed [rpm]`, is one too.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import NamedTuple

_CHANNEL = r"(?:ch|chan|channel|kanal|col|column|spalte|signal|trace|var|variable)"
_ENTRY = r"(?P<key>[^\W\d][\w ]*?)\s*[=:]\s*(?P<value>.*?)\W*"
_NUMBERED = re.compile(rf"\W*{_CHANNEL}[\s._-]*\[?(?P<number>\d+)\]?[\s._:-]+{_ENTRY}", re.IGNORECASE)
_NAMED = re.compile(rf"\W*{_CHANNEL}[\s._-]*\[?(?P<number>\d+)\]?\s*[=:]\s*(?P<value>[^\W\d][^=:]*)", re.IGNORECASE)
_NUMBER = re.compile(rf"{_CHANNEL}[\s._-]*(?P<number>\d+)", re.IGNORECASE)
_SECTION = re.compile(
    rf"\W*\[\s*{_CHANNEL}[\s._-]*(?P<number>\d+)\s*\]\W*|\W*OBJECT\s*=\s*(?:COLUMN|FIELD)\W*", re.IGNORECASE
)  # the second of the labels of the Planetary Data System
_OTHER_SECTION = re.compile(r"\W*\[.*\]\W*|\W*(?:END_)?OBJECT\s*=.*|\W*END\W*", re.IGNORECASE)
_IN_SECTION = re.compile(rf"\W*{_ENTRY}", re.IGNORECASE)
_KINDS = {
    "name": ("name", "signal", "signalname", "channelname", "label", "bezeichnung", "title"),
    "unit": ("unit", "units", "einheit", "dimension"),
    "factor": ("factor", "faktor", "scale", "scalefactor", "scaling", "scalingfactor", "slope", "resolution", "gain"),
    "offset": ("offset", "addoffset", "intercept"),
}
_KIND_OF = {word: kind for kind, words in _KINDS.items() for word in words}


def kind_of(word: str) -> str:
    """What a word states of a channel, as one of the fields of `Channel`; empty for anything else."""
    return _KIND_OF.get(re.sub(r"[\W_]", "", word.lower()).removesuffix("s"), "")


class Channel(NamedTuple):
    """What is stated of one column."""

    name: str
    unit: str
    factor: str  # as it stands there; empty: none
    offset: str


def channels_above(lines: Sequence[str], width: int) -> tuple[list[Channel], frozenset[int]]:
    """The columns that blocks describe, in order, and the lines (from 0) that do; none unless it is all `width`."""
    found: dict[int, dict[str, str]] = {}
    used, inside = set[int](), 0
    for at, line in enumerate(lines):
        section = _SECTION.fullmatch(line)
        if section is not None:
            inside = int(section["number"] or len(found) + 1)
            found.setdefault(inside, {})
        elif _OTHER_SECTION.fullmatch(line):
            inside = 0
        match = _NUMBERED.fullmatch(line) or _NAMED.fullmatch(line) or (inside and _IN_SECTION.fullmatch(line)) or None
        if match is None or section is not None:
            continue
        stated = match.groupdict()
        number = int(stated.get("number", inside))
        if kind := kind_of(stated.get("key", "name")):
            found.setdefault(number, {}).setdefault(kind, match["value"].strip(" \"'"))
            used.add(at)
    channels = [Channel(*(stated.get(kind, "") for kind in _KINDS)) for _, stated in sorted(found.items())]
    whole = len(channels) == width and all(channel.name for channel in channels)
    return (channels, frozenset(used)) if whole else ([], frozenset())


def called_by_number(names: Sequence[str], lines: Sequence[str]) -> tuple[str, ...]:
    """Names of which some are only a channel's number, `Kanal 1`, by what lines above say of it."""
    found = {int(match["number"]): match["value"] for line in lines if (match := _NAMED.fullmatch(line)) is not None}
    numbers = [_NUMBER.fullmatch(name) for name in names]
    return tuple(
        name if match is None else found.get(int(match["number"]), name)
        for name, match in zip(names, numbers, strict=True)
    )
