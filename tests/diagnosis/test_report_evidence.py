"""The picture of evidence: whole SVG, every effect in it, bars and thresholds on one scale."""

from __future__ import annotations

import math
from typing import Any
from xml.etree import ElementTree

import pytest

from rw_ekf.diagnosis.report.diagnosis_page import evidence_picture

_SVG = "{http://www.w3.org/2000/svg}"


def candidate(effect: str, statistic: float | None, decision: str = "not significant", **more: Any) -> dict[str, Any]:
    """A candidate as the document has it."""
    return {"effect": effect, "statistic": statistic, "threshold": 20.0, "p_value": 0.5, "decision": decision, **more}


def drawn(*candidates: dict[str, Any]) -> ElementTree.Element:
    """The picture, read back."""
    content = evidence_picture({"candidates": list(candidates)})
    assert content is not None
    return ElementTree.fromstring(content)


def texts(picture: ElementTree.Element) -> list[str]:
    """Its words, in order."""
    return ["".join(found.itertext()) for found in picture.iter(f"{_SVG}text")]


def bars(picture: ElementTree.Element) -> list[float]:
    """Widths of the bars, from above."""
    return [float(found.attrib["width"]) for found in picture.iter(f"{_SVG}rect") if found.attrib["width"] != "100%"]


def test_every_effect_has_a_line_the_added_one_first() -> None:
    """What was added leads, those tested follow by falling evidence, those that were not say why."""
    words = texts(
        drawn(
            candidate("cubic_drag", 30.0),
            candidate("torque_ripple", None, "not testable: needs angle_rad, which is not logged"),
            candidate("offset_torque", 25.0, "added", posterior=0.97),
            candidate("actuator_lag", 90.0, "explained by offset_torque"),
        )
    )
    names = [word for word in words if "_" in word and ":" not in word and " " not in word]
    assert names == ["offset_torque", "actuator_lag", "cubic_drag", "torque_ripple"]
    assert "97 %" in words
    assert "not testable: needs angle_rad, which is not logged" in words


def test_bars_and_thresholds_share_a_logarithmic_scale() -> None:
    """A bar at its threshold ends at the tick; equal ratios of evidence are equal lengths; below one is a stub."""
    picture = drawn(
        candidate("cubic_drag", 400.0), candidate("offset_torque", 20.0), candidate("drag_bump", 0.0),
        candidate("drag_spike", -3.0), candidate("friction_lag", math.nan),
    )  # fmt: skip
    widths = bars(picture)
    assert widths[0] == pytest.approx(2.0 * widths[1], abs=0.2)
    assert 0.0 < widths[2] < 4.0
    assert widths[2] == widths[3] == widths[4]
    (ticks,) = {found.attrib["x1"] for found in picture.iter(f"{_SVG}line") if found.attrib["stroke-width"] == "2"}
    first = next(found for found in picture.iter(f"{_SVG}rect") if found.attrib["width"] != "100%")
    assert float(ticks) == pytest.approx(float(first.attrib["x"]) + widths[1], abs=0.2)


@pytest.mark.parametrize("statistic", [1.0, 20.0, 1.0e4, 1.0e9, 1.0e30])
def test_labels_of_the_scale_stay_few(statistic: float) -> None:
    """Nothing beyond the bars' room, and never more than a dozen labels, however strong the evidence."""
    picture = drawn(candidate("cubic_drag", statistic))
    labels = [found for found in picture.iter(f"{_SVG}text") if found.attrib["text-anchor"] == "middle"]
    assert 2 <= len(labels) <= 12
    assert all(176.0 <= float(found.attrib["x"]) <= 430.0 for found in labels)
    assert all(width <= 254.0 for width in bars(picture))


def test_words_are_words_whatever_they_say() -> None:
    """Signs of markup in a decision are told as they are, and long ones end in an ellipsis."""
    words = texts(drawn(candidate("cubic_drag", 5.0, '<b>&"no"'), candidate("drag_bump", 4.0, "because " * 40)))
    assert '<b>&"no"' in words
    assert any(word.endswith("…") and len(word) <= 42 for word in words)


def test_no_candidates_no_picture() -> None:
    """Where nothing was tested there is nothing to draw."""
    assert evidence_picture({"candidates": []}) is None
    assert evidence_picture({}) is None
