"""Templates of lines: `RPM={speed:.1f}` prints numbers and reads them back, in time linear in a line's length.

    {name}          any number as C prints it: 1234  -0.0  1.2e-3  nan  inf  ovf, with spaces before it
    {name:.1f}      a number with one digit behind the point, no more and no fewer
    {name:d}        a whole number
    {name:08.1f}    as .1f, zeros before it up to eight characters, so that no digit can be lost unseen; 06d alike
    {name:text}     any text up to the character that follows: as a number its CRC-32, which distinguishes texts
    {_}             any text, ignored
    {address:02d}   the wheel's address on its line, in two digits; another wheel's line is not this one's

A space stands for one or more; anything else stands for itself.
"""

from __future__ import annotations

import math
import re
import zlib
from collections.abc import Mapping
from typing import NamedTuple

ADDRESS = "address"  # the place of the wheel's address on its line
LONGEST_LINE = 256  # bytes, without its end
IGNORED, TEXT = "_", "text"
_SLOT = re.compile(r"\{([^{}]*)\}")
_SPEC = re.compile(r"(\+?)(?:0([1-9]\d?))?(?:d|\.([1-9])f)")
_NAME = re.compile(r"[a-z][a-z0-9_]*|_")
_ODD = r"[+-]?(?:nan|inf(?:inity)?|ovf)"  # an Arduino prints ovf beyond 2^32
_ANY = r"[+-]?(?:\d++(?:\.\d*+)?+|\.\d++)(?:e[+-]?\d++)?+"


class Slot(NamedTuple):
    """A place in a template. digits: behind the point; None where any number may stand. width: of zeros before it."""

    name: str
    spec: str
    digits: int | None = None
    width: int = 0
    signed: bool = False  # a + before what is not negative

    def printed(self, number: float) -> str:
        """The number as it stands in a line."""
        if self.spec == TEXT:
            return f"{number:.0f}"
        if self.digits is None or not math.isfinite(number):
            return f"{number:.9g}"
        shown = round(number, self.digits) + 0.0  # no -0.0
        return f"{shown:{'+' if self.signed else ''}{f'0{self.width}' if self.width else ''}.{self.digits}f}"

    def pattern(self, follows: str) -> str:
        """The regular expression of what may stand here, before the text that follows."""
        if self.name == IGNORED or self.spec == TEXT:
            return f"([^{re.escape(follows[0])}]*+)" if follows else "(.*+)"
        number = _ANY
        if self.digits is not None:
            behind = rf"\.\d{{{self.digits}}}(?!\d)" if self.digits else ""
            number = rf"{'[+-]' if self.signed else '[+-]?'}\d++{behind}"
        return rf"[ \t]*+({number}|{_ODD})"

    def number(self, text: str) -> float | None:
        """The number that stands there; None where digits of it are missing."""
        if self.spec == TEXT:
            return float(zlib.crc32(text.encode()))
        if text[-1:].isdigit() or text[-1:] == ".":
            return float(text) if len(text) >= self.width else None
        word = text.lower()
        return math.nan if "nan" in word else -math.inf if word.startswith("-") else math.inf


class Template:
    """A line with places for numbers. Raises ValueError, in words for whoever wrote it, for one that cannot be."""

    def __init__(self, text: str) -> None:
        self.text = text
        if not text or not text.isascii() or not text.isprintable() or len(text) > LONGEST_LINE // 2:
            raise ValueError(f"must be 1 to {LONGEST_LINE // 2} printable ASCII characters, without the line's end")
        if text != text.strip():
            raise ValueError("begins or ends with a space; leave it out, spaces around a line are skipped")
        self._parts: list[str | Slot] = []
        at = 0
        for found in _SLOT.finditer(text):
            self._put(text[at : found.start()])
            if self._parts and isinstance(self._parts[-1], Slot):
                raise ValueError(f"{found[0]} follows a place without anything between: where does one end?")
            self._parts.append(_slot(found[1]))
            at = found.end()
        self._put(text[at:])
        self.slots = [part for part in self._parts if isinstance(part, Slot)]
        names = [slot.name for slot in self.slots if slot.name != IGNORED]
        if len(names) != len(set(names)):
            raise ValueError("has a place of the same name twice")
        self._pattern = re.compile("".join(map(self._matching, range(len(self._parts)))), re.ASCII | re.IGNORECASE)

    def _put(self, literal: str) -> None:
        if "{" in literal or "}" in literal:
            raise ValueError(f"has a brace that encloses no name: {literal!r}; places are {{name}} or {{name:.1f}}")
        if literal:
            self._parts.append(literal)

    def _matching(self, index: int) -> str:
        part = self._parts[index]
        follows = self._parts[index + 1] if index + 1 < len(self._parts) else ""
        if isinstance(part, Slot):
            return part.pattern(follows if isinstance(follows, str) else "")
        words = filter(None, re.split(r"( +)", part))
        return "".join(r"[ \t]++" if word.isspace() else f"(?-i:{re.escape(word)})" for word in words)

    def slot(self, name: str) -> Slot | None:
        """The place of that name, or None."""
        return next((slot for slot in self.slots if slot.name == name), None)

    def printed(self, numbers: Mapping[str, float]) -> str:
        """The line with these numbers; 0 where one is not given."""
        return "".join(
            part if isinstance(part, str) else part.printed(numbers.get(part.name, 0.0)) for part in self._parts
        )

    def read(self, line: str) -> dict[str, float] | None:
        """The numbers of a line by name; None where it is another line."""
        found = self._pattern.fullmatch(line)
        if found is None:
            return None
        numbers: dict[str, float] = {}
        for slot, text in zip(self.slots, found.groups(), strict=True):
            if slot.name == IGNORED:
                continue
            number = slot.number(text)
            if number is None:
                return None
            numbers[slot.name] = number
        return numbers


def _slot(inner: str) -> Slot:
    """A place by what its braces hold."""
    name, colon, spec = inner.partition(":")
    if not _NAME.fullmatch(name):
        raise ValueError(f"{{{inner}}} names nothing: small letters, digits and _, or _ alone for what is ignored")
    if not colon:
        return Slot(name, "")
    if spec == TEXT:
        return Slot(name, TEXT)
    found = _SPEC.fullmatch(spec)
    if name == IGNORED or found is None:
        raise ValueError(f"{{{inner}}} has no such form: .1f (digits behind the point), d, 08.1f (with zeros), or text")
    return Slot(name, spec, int(found[3] or 0), int(found[2] or 0), bool(found[1]))
