"""Templates of lines: what an Arduino prints is read, what has lost a digit is not, and no line takes long."""

from __future__ import annotations

import math
import zlib
from collections.abc import Iterator
from re import _parser  # type: ignore[attr-defined]
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rw_ekf.drivers.line.ascii_template import Template

parse, SubPattern = _parser.parse, _parser.SubPattern

# Of `Serial.print`: (template, line, value of x).
PRINTED = [
    ("{x}", "1234", 1234.0),
    ("{x}", "-0.0", 0.0),
    ("{x}", "1.2e-3", 0.0012),
    ("{x}", "+.5E+02", 50.0),
    ("{x}", "   12.", 12.0),
    ("RPM: {x}", "RPM:   1234", 1234.0),
    ("RPM: {x} rpm", "RPM: \t-12.5   rpm", -12.5),
    ("{x:.2f}", "-12.50", -12.5),
    ("{x:d}", "007", 7.0),
    ("{x:08.2f}", "-0012.50", -12.5),
    ("{x:+.1f}", "+3.0", 3.0),
    ("v={_},w={x};", "v=1.0.2-beta 3,w=4;", 4.0),
    ("{x}", "inf", math.inf),
    ("{x}", "-INF", -math.inf),
    ("{x}", "ovf", math.inf),
    ("W {x:text}", "W no. 7b", float(zlib.crc32(b"no. 7b"))),
]
# What is not what was printed: digits, point, sign or word lost or changed, more behind it, another line.
DAMAGED = [
    ("{x:.2f}", "12.5"),
    ("{x:.2f}", "1250"),
    ("{x:.2f}", "12.505"),
    ("{x:08.2f}", "0012.50"),
    ("{x:08.2f}", "00012.5"),
    ("{x:05d}", "0123"),
    ("{x:d}", "12.0"),
    ("{x:+.1f}", "3.0"),
    ("{x}", "12.3.4"),
    ("{x}", "12,3"),
    ("{x}", "0x12"),
    ("{x}", "1_000"),
    ("{x}", "12 34"),
    ("{x}", ""),
    ("{x}", "-"),
    ("{x}", "."),
    ("{x}", "1e"),
    ("{x}", "١٢"),
    ("RPM={x}", "RPN=12"),
    ("RPM={x}", "rpm=12"),
    ("RPM={x}", "RPM=12 RPM=13"),
    ("{x} {y}", "12"),
]


@pytest.mark.parametrize(("template", "line", "value"), PRINTED)
def test_what_an_arduino_prints_is_read(template: str, line: str, value: float) -> None:
    """Signs, exponents, spaces, words around it, words for what is no number."""
    numbers = Template(template).read(line)
    assert numbers == {"x": value}


def test_a_nan_is_read_as_one() -> None:
    """Which no register lets pass."""
    assert math.isnan((Template("{x:.1f}").read("nan") or {})["x"])


@pytest.mark.parametrize(("template", "line"), DAMAGED)
def test_what_is_not_as_it_was_printed_is_no_number(template: str, line: str) -> None:
    """A digit short, a digit too many, another word: none of it is read."""
    assert Template(template).read(line) is None


@given(st.floats(-99999, 99999), st.integers(0, 8))
def test_no_digit_of_a_number_of_fixed_width_is_lost_unseen(value: float, lost: int) -> None:
    """Printed to nine characters with zeros, any one of them lost: no number."""
    template = Template("{x:09.2f}")
    line = template.printed({"x": value})
    assert (template.read(line) or {})["x"] == pytest.approx(value, abs=0.0051)
    assert template.read(line[:lost] + line[lost + 1 :]) is None


@given(st.floats(allow_nan=False, allow_infinity=False, width=32), st.integers(-(10**9), 10**9), st.floats(-1e6, 1e6))
def test_a_line_is_read_as_it_is_printed(any_number: float, whole: int, fixed: float) -> None:
    """Any form; to the digits that it prints."""
    template = Template("A={a} B={b:d},C={c:.3f}")
    numbers = template.read(template.printed({"a": any_number, "b": whole, "c": fixed}))
    assert numbers is not None
    assert numbers["a"] == pytest.approx(any_number, rel=1e-8)
    assert numbers["b"] == whole
    assert numbers["c"] == pytest.approx(fixed, abs=0.00051)


def test_nothing_is_commanded_as_minus_zero() -> None:
    """A small negative current that rounds to zero is a plain zero."""
    assert Template("CUR={x:.2f}").printed({"x": -0.001}) == "CUR=0.00"


def repeats(parsed: Any) -> Iterator[tuple[int, int]]:
    """Least and most of each repetition of a parsed expression that gives back what it took."""
    for operator, argument in parsed:
        if str(operator) in ("MAX_REPEAT", "MIN_REPEAT"):
            yield int(argument[0]), int(argument[1])
        for part in argument if isinstance(argument, tuple | list) else ():
            for inner in part if isinstance(part, list) else [part]:
                if isinstance(inner, SubPattern):
                    yield from repeats(inner)


def test_no_line_is_read_by_trying() -> None:
    """What repeats is taken once and never given back: time is linear in a line's length, whatever stands in it."""
    pattern = Template("A {x} {_} {y:.1f},{z:text};{v:d} {w} {u:+08.2f}")._pattern.pattern
    found = list(repeats(parse(pattern)))
    assert len(found) > 5
    assert all(most <= 1 or least == most for least, most in found)
    assert list(repeats(parse("(?:a+)+b"))) != []  # what the walk is for


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "1 to"),
        ("RPM?\n", "printable"),
        (" RPM?", "space"),
        ("{a}{b}", "without anything between"),
        ("{a", "brace"),
        ("{A}", "names nothing"),
        ("{a:5f}", "no such form"),
        ("{a:.1e}", "no such form"),
        ("{a} {a}", "twice"),
        ("x" * 200, "1 to"),
    ],
)
def test_a_template_that_cannot_be_says_why(text: str, words: str) -> None:
    """In words for whoever wrote the map."""
    with pytest.raises(ValueError, match=words):
        Template(text)
