"""Which held-out figures may refuse an effect."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from rw_ekf.api import simulate
from rw_ekf.diagnosis.checks import confirmation
from rw_ekf.diagnosis.checks.heldout import Performance, performance, performance_by_turns
from rw_ekf.diagnosis.prepare.preparation import Prepared, prepare
from rw_ekf.diagnosis.prepare.source import source_of
from rw_ekf.likelihood.fitting import Fit
from rw_ekf.likelihood.one_step import Record

BEFORE = {
    "one_step_rms_rpm": 1.00, "horizon_1s_rms_rpm": 1.0, "horizon_20s_rms_rpm": 1.5, "free_run_rms_rpm": 2.0,
    "nis_mean": 1.1,
}  # fmt: skip


def prepared(profile: str, seed: int, seconds: float) -> Prepared:
    """A healthy wheel's log."""
    return prepare(source_of([simulate(profile, seed=seed, duration_s=seconds)]), None, None, "blocks")


def refusal(
    monkeypatch: pytest.MonkeyPatch, *, by_turns: bool = False, clearly: bool = False, **after: float
) -> str | None:
    """What is said of an effect that changes these figures."""
    less: Any = "less"
    more: Any = "more"
    nothing: Any = None
    figures = {less: BEFORE, more: {**BEFORE, **after}}
    judge = "performance_by_turns" if by_turns else "performance"
    monkeypatch.setattr(confirmation, judge, lambda _, fit: Performance(figures[fit], nothing, np.zeros(0)))
    return confirmation._worse(nothing, less, more, by_turns=by_turns, clearly=clearly)


def test_an_effect_that_halves_the_free_run_is_not_refused_for_its_nis(monkeypatch: pytest.MonkeyPatch) -> None:
    """A motor gain by temperature, 2.0 -> 0.4 rpm, whose NIS rose as it leaves no torque noise to hide anything."""
    assert refusal(monkeypatch, free_run_rms_rpm=0.4, nis_mean=1.9, one_step_rms_rpm=1.09) is None


def test_one_that_helps_less_is(monkeypatch: pytest.MonkeyPatch) -> None:
    """The same NIS with a free run nearer by a third, or by nothing, refuses."""
    assert refusal(monkeypatch, free_run_rms_rpm=1.35, nis_mean=1.9) == "NIS goes from 1.1 to 1.9"
    assert refusal(monkeypatch, nis_mean=1.9) == "NIS goes from 1.1 to 1.9"


def test_by_turns_errors_far_ahead_decide_wherever_the_free_run_is_nearer(monkeypatch: pytest.MonkeyPatch) -> None:
    """90 s of a torque with a clock: free run 2.33 -> 1.27 rpm, one step 1.11 -> 1.24: no torque noise hides it."""
    assert refusal(monkeypatch, by_turns=True, free_run_rms_rpm=1.2, one_step_rms_rpm=1.12) is None
    assert refusal(monkeypatch, by_turns=False, free_run_rms_rpm=1.2, one_step_rms_rpm=1.12) is not None


@pytest.mark.parametrize(
    ("clearly", "one_step_rpm", "stands"), [(True, 1.12, True), (True, 1.4, False), (False, 1.12, False)]
)
def test_where_no_half_knows_the_numbers_a_figure_has_to_grow_clearly(
    monkeypatch: pytest.MonkeyPatch, clearly: bool, one_step_rpm: float, stands: bool
) -> None:
    """By a third and more; where the halves know them, and do not agree, as much as by either of them."""
    found = refusal(monkeypatch, by_turns=True, clearly=clearly, free_run_rms_rpm=1.95, one_step_rms_rpm=one_step_rpm)
    assert (found is None) is stands


def test_errors_far_ahead_refuse_even_so(monkeypatch: pytest.MonkeyPatch) -> None:
    """Whatever the free run gains, an error 20 s ahead that grows is held against an effect."""
    stated = refusal(monkeypatch, free_run_rms_rpm=0.4, horizon_20s_rms_rpm=1.8)
    assert stated is not None
    assert "20 s ahead grows by 20 %" in stated


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


def test_by_turns_no_stretch_is_foretold_by_itself(monkeypatch: pytest.MonkeyPatch) -> None:
    """Every held-out interval is left out of one fit and no other, with its stretch alone; what was fitted stays in."""
    way = prepared("P1", 3, 240.0)
    records, on_part = [], Fit.on_part

    def noted(fit: Fit, record: Record) -> Fit:
        records.append(record)
        return on_part(fit, record)

    monkeypatch.setattr(Fit, "on_part", noted)
    figures = performance_by_turns(way, way.base).figures
    left_out = np.array([way.record.follows & ~record.follows for record in records if record is not way.fit_part])
    inside = way.split.heldout & np.roll(way.split.heldout, 1) & way.record.follows
    assert left_out.shape[0] == np.unique(way.split.block[way.split.heldout]).size
    assert np.all(left_out.sum(axis=0)[inside] == 1)
    assert not np.any(left_out & (way.split.fit & np.roll(way.split.fit, 1)))
    assert figures["free_run_rms_rpm"] == pytest.approx(1.0, abs=0.1)


def test_numbers_from_all_the_rest_foretell_better_than_those_from_half() -> None:
    """Sixteen wheels for 90 s each: nearer than by half a record, on average of squared errors."""
    gained = []
    for seed in range(100, 116):
        way = prepared("P2", seed, 90.0)
        half, rest = (of(way, way.base).figures["free_run_rms_rpm"] for of in (performance, performance_by_turns))
        gained.append(half**2 - rest**2)
    assert float(np.mean(gained)) > 0.0
