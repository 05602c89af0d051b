"""Which held-out figures may refuse an effect."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from rw_ekf.diagnosis.checks import confirmation
from rw_ekf.diagnosis.checks.heldout import Performance

BEFORE = {
    "one_step_rms_rpm": 1.00, "horizon_1s_rms_rpm": 1.0, "horizon_20s_rms_rpm": 1.5, "free_run_rms_rpm": 2.0,
    "nis_mean": 1.1,
}  # fmt: skip


def refusal(monkeypatch: pytest.MonkeyPatch, **after: float) -> str | None:
    """What is said of an effect that changes these figures."""
    less: Any = "less"
    more: Any = "more"
    nothing: Any = None
    figures = {less: BEFORE, more: {**BEFORE, **after}}
    monkeypatch.setattr(confirmation, "performance", lambda _, fit: Performance(figures[fit], nothing, np.zeros(0)))
    return confirmation._worse(nothing, less, more)


def test_an_effect_that_halves_the_free_run_is_not_refused_for_its_nis(monkeypatch: pytest.MonkeyPatch) -> None:
    """A motor gain by temperature, 2.0 -> 0.4 rpm, whose NIS rose as it leaves no torque noise to hide anything."""
    assert refusal(monkeypatch, free_run_rms_rpm=0.4, nis_mean=1.9, one_step_rms_rpm=1.09) is None


def test_one_that_helps_less_is(monkeypatch: pytest.MonkeyPatch) -> None:
    """The same NIS with a free run nearer by a third, or by nothing, refuses."""
    assert refusal(monkeypatch, free_run_rms_rpm=1.35, nis_mean=1.9) == "NIS goes from 1.1 to 1.9"
    assert refusal(monkeypatch, nis_mean=1.9) == "NIS goes from 1.1 to 1.9"


def test_errors_far_ahead_refuse_even_so(monkeypatch: pytest.MonkeyPatch) -> None:
    """Whatever the free run gains, an error 20 s ahead that grows is held against an effect."""
    said = refusal(monkeypatch, free_run_rms_rpm=0.4, horizon_20s_rms_rpm=1.8)
    assert said is not None
    assert "20 s ahead grows by 20 %" in said


@pytest.mark.parametrize(
    ("own", "other", "kind", "chosen"),
    [(0.02, 0.001, "blocks", "own"), (0.66, 0.07, "blocks", "other"), (0.07, 0.66, "blocks", "own"),
     (0.66, 0.07, "halves", "own")],
)  # fmt: skip
def test_numbers_come_from_the_part_that_knows_them(
    monkeypatch: pytest.MonkeyPatch, own: float, other: float, kind: str, chosen: str
) -> None:
    """The other part is fitted where it knows a model better and the own not well enough; halves stay as they are."""

    class Way:
        def __init__(self, name: str) -> None:
            self.name = name
            self.split = SimpleNamespace(kind=kind)

        def exchanged(self) -> Way:
            return Way("other")

    fit: Any = None
    way: Any = Way("own")
    monkeypatch.setattr(confirmation, "for_want_of_knowledge", lambda way, _: {"own": own, "other": other}[way.name])
    found: Any = confirmation.better_known(way, fit)
    assert found.name == chosen
