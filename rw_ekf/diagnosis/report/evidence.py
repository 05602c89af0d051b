"""The evidence for every effect of the catalogue, drawn: a table with bars, as SVG.

A hundred short texts that need no layout take a plotting library a quarter of a second, and as SVG they stay text.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, Literal
from xml.etree.ElementTree import Element, SubElement, tostring

from rw_ekf.diagnosis.report.canvas import AFTER, FRAME, GREY, INK, PALE
from rw_ekf.diagnosis.report.words import gain_text, p_value_text, probability_text, ranked, untestable_reasons
from rw_ekf.diagnosis.standing import Standing, standing_of
from rw_ekf.numbers import number_of

_BARS: dict[Standing, str] = {"added": AFTER, "related": "#7fb2dc", "rejected": "#b4bac2", "untestable": "#b4bac2"}
_STUB = 1.04  # what is less is drawn as that: the scale is logarithmic, from one

# Everything below in CSS pixels.
_WIDTH, _ROW, _ABOVE, _BELOW = 960.0, 25.0, 30.0, 52.0
_LEFT, _RIGHT = 176.0, 430.0  # of the bars
_BAR, _TICK, _GAP, _BASELINE = 16.0, 21.0, 8.0, 4.5
_WORDS, _SMALL = 13.0, 12.0
_DECISION = 42  # characters
_REASON = 92
_COLUMNS: tuple[tuple[float, str, Literal["start", "end"]], ...] = (
    (492.0, "probability", "end"),
    (568.0, "p-value", "end"),
    (668.0, "held-out error", "end"),
    (686.0, "decision", "start"),
)


def evidence_picture(document: Mapping[str, Any]) -> bytes | None:
    """A bar for every candidate that was tested, those that were not below; None without candidates."""
    candidates = list(document.get("candidates") or ())
    tested, reasons = ranked(candidates), untestable_reasons(candidates)
    untested = [(effect, reason) for reason, effects in reasons.items() for effect in effects]
    if not tested and not untested:
        return None
    bottom = _ABOVE + (len(tested) + len(untested)) * _ROW
    height = bottom + _BELOW
    picture = Element(
        "svg",
        {
            "xmlns": "http://www.w3.org/2000/svg",
            "viewBox": f"0 0 {_WIDTH:g} {height:g}",
            "width": f"{_WIDTH:g}",
            "height": f"{height:g}",
            "font-family": "system-ui, sans-serif",
        },
    )
    SubElement(picture, "rect", {"width": "100%", "height": "100%", "fill": "#ffffff"})
    largest = max([20.0, *(_drawn(candidate.get(key)) for candidate in tested for key in ("statistic", "threshold"))])
    scale = _Scale(1.6 * largest)
    scale.draw(picture, bottom)
    for x, heading, anchor in _COLUMNS:
        _write(picture, x, _ABOVE - 11.0, heading, anchor, GREY, size=_SMALL)
    for row, candidate in enumerate(tested):
        _draw_row(picture, scale, _middle(row), candidate)
    for row, (effect, reason) in enumerate(untested, start=len(tested)):
        base = _middle(row) + _BASELINE
        _write(picture, _LEFT - _GAP, base, effect, "end", GREY)
        _write(picture, _LEFT + _GAP, base, _short(f"not testable: {reason}", _REASON), "start", GREY)
    content: bytes = tostring(picture, encoding="utf-8", xml_declaration=True)
    return content


class _Scale:
    """Logarithmic, from 1 at the bars' left."""

    def __init__(self, most: float) -> None:
        self.most = most

    def x(self, statistic: float) -> float:
        """Where a statistic lies."""
        return _LEFT + (_RIGHT - _LEFT) * math.log(statistic) / math.log(self.most)

    def draw(self, picture: Element, bottom: float) -> None:
        """Lines at powers of ten, few enough for their labels, and what the scale is of."""
        decades = range(math.floor(math.log10(self.most)) + 1)
        for decade in decades[:: 1 + len(decades) // 6]:
            x = self.x(10.0**decade)
            _line(picture, x, _ABOVE, x, bottom, PALE, 1.0)
            _line(picture, x, bottom, x, bottom + 4.0, FRAME, 1.0)
            _write(picture, x, bottom + 18.0, f"{10**decade}" if decade < 5 else f"1e{decade}", "middle", INK)
        _line(picture, _LEFT, bottom, _RIGHT, bottom, FRAME, 1.0)
        label = "evidence: twice the gain in log-likelihood"
        _write(picture, 0.5 * (_LEFT + _RIGHT), bottom + 38.0, label, "middle", INK)


def _draw_row(picture: Element, scale: _Scale, middle: float, candidate: Mapping[str, Any]) -> None:
    standing = standing_of(candidate)
    colour, bold = (INK, True) if standing == "added" else ("#3d444c", False)
    end = scale.x(_drawn(candidate.get("statistic")))
    SubElement(
        picture,
        "rect",
        {
            "x": f"{_LEFT:g}",
            "y": f"{middle - 0.5 * _BAR:g}",
            "width": f"{end - _LEFT:.1f}",
            "height": f"{_BAR:g}",
            "fill": _BARS[standing],
        },
    )
    threshold = number_of(candidate.get("threshold"))
    if threshold is not None and threshold > 1.0:
        x = scale.x(threshold)
        _line(picture, x, middle - 0.5 * _TICK, x, middle + 0.5 * _TICK, INK, 2.0)
    base = middle + _BASELINE
    _write(picture, _LEFT - _GAP, base, str(candidate.get("effect")), "end", colour, bold=bold)
    texts: Sequence[str] = (
        probability_text(candidate.get("posterior")),
        p_value_text(candidate.get("p_value")),
        gain_text(candidate),
        _short(str(candidate.get("decision") or ""), _DECISION),
    )
    for (x, _, anchor), text in zip(_COLUMNS, texts, strict=True):
        _write(picture, x, base, text, anchor, colour, bold=bold)


def _middle(row: int) -> float:
    return _ABOVE + (row + 0.5) * _ROW


def _drawn(statistic: object) -> float:
    """A bar's end: a stub for what is missing or hardly above nothing."""
    return max(number_of(statistic) or 0.0, _STUB)


def _line(picture: Element, x: float, y: float, to_x: float, to_y: float, colour: str, width: float) -> None:
    place = {"x1": f"{x:.1f}", "y1": f"{y:.1f}", "x2": f"{to_x:.1f}", "y2": f"{to_y:.1f}"}
    SubElement(picture, "line", {**place, "stroke": colour, "stroke-width": f"{width:g}"})


def _write(
    picture: Element,
    x: float,
    y: float,
    text: str,
    anchor: Literal["start", "middle", "end"],
    colour: str,
    *,
    size: float = _WORDS,
    bold: bool = False,
) -> None:
    style = {"fill": colour, "font-size": f"{size:g}", "text-anchor": anchor}
    if bold:
        style["font-weight"] = "700"
    SubElement(picture, "text", {"x": f"{x:.1f}", "y": f"{y:.1f}", **style}).text = text


def _short(text: str, most: int) -> str:
    return text if len(text) <= most else text[: most - 1].rstrip() + "…"
