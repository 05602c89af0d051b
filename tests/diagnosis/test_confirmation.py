"""Which held-out figures may refuse an effect."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from rw_ekf.diagnosis.checks import confirmation
from rw_ekf.diagnosis.checks.heldout import Performance
from rw_ekf.units import RAD_S_PER_RPM

BEFORE = {
    "one_step_rms_rpm": 1.00, "horizon_1s_rms_rpm": 1.0, "horizon_20s_rms_rpm": 1.5, "free_run_rms_rpm": 2.0,
    "nis_mean": 1.1,
}  # fmt: skip


def refusal(monkeypatch: pytest.MonkeyPatch, unknown: float = 0.0, **after: float) -> str | None:
    """What is said of an effect that changes these figures; unknown: eq. 10e, for want of knowledge of its numbers."""
    less: Any = "less"
    more: Any = SimpleNamespace(noise=SimpleNamespace(variance=RAD_S_PER_RPM**2))
    nothing: Any = None

    def figures(_: object, fit: object) -> Performance:
        return Performance(BEFORE if fit is less else {**BEFORE, **after}, nothing, np.zeros(0))

    monkeypatch.setattr(confirmation, "performance", figures)
    monkeypatch.setattr(confirmation, "by_fit_part", lambda _, fit: fit)
    monkeypatch.setattr(confirmation, "for_want_of_knowledge", lambda _, fit: 0.0 if fit is less else unknown)
    return confirmation._worse(nothing, less, more)


def test_an_effect_that_halves_the_free_run_is_not_refused_for_its_nis(monkeypatch: pytest.MonkeyPatch) -> None:
    """A motor gain by temperature, 2.0 -> 0.4 rpm, whose NIS rose as it leaves no torque noise to hide anything."""
    assert refusal(monkeypatch, free_run_rms_rpm=0.4, nis_mean=1.9, one_step_rms_rpm=1.09) is None


def test_nor_is_one_whose_figures_want_of_knowledge_explains(monkeypatch: pytest.MonkeyPatch) -> None:
    """A drag by speed, its free run nearer by a third, whose numbers the part that they come from hardly knew."""
    assert refusal(monkeypatch, 0.14, free_run_rms_rpm=1.35, nis_mean=1.9) is None
    assert refusal(monkeypatch, 0.06, one_step_rms_rpm=1.15, nis_mean=1.3) is None


def test_one_that_helps_less_is(monkeypatch: pytest.MonkeyPatch) -> None:
    """The same NIS with a free run nearer by a third, or by nothing, refuses, as does what is more than that."""
    assert refusal(monkeypatch, free_run_rms_rpm=1.35, nis_mean=1.9) == "NIS goes from 1.1 to 1.9"
    assert refusal(monkeypatch, nis_mean=1.9) == "NIS goes from 1.1 to 1.9"
    said = refusal(monkeypatch, 0.01, one_step_rms_rpm=1.2)
    assert said is not None
    assert "one-step error grows" in said


def test_errors_far_ahead_refuse_even_so(monkeypatch: pytest.MonkeyPatch) -> None:
    """Whatever the free run gains, an error 20 s ahead that grows is held against an effect."""
    said = refusal(monkeypatch, free_run_rms_rpm=0.4, horizon_20s_rms_rpm=1.8)
    assert said is not None
    assert "20 s ahead grows by 20 %" in said
