"""An effect is named only if its size is one that a machine can have, and if no held-out figure gets worse."""

from __future__ import annotations

from dataclasses import replace

import pytest

from rw_ekf.diagnosis.checks.confirmation import worsened
from rw_ekf.diagnosis.prepare.preparation import prepare
from rw_ekf.diagnosis.prepare.source import source_of
from rw_ekf.effects.catalogue import CATALOGUE, FORMULAS
from rw_ekf.likelihood.fitting import fit_model
from rw_ekf.likelihood.gauss_newton import Start
from rw_ekf.model.effect import RecordFacts, Term
from rw_ekf.model.state import CK13_STATISTICAL
from tests.diagnosis.simulated import TRUTH, log_of, simulated

WHEEL = RecordFacts(
    first_s=0.0,
    last_s=600.0,
    period_s=0.1,
    top_speed_rad_s=250.0,
    top_current_A=0.3,
    friction=CK13_STATISTICAL,
    stribeck_speed_rad_s=0.42,
    stribeck_law=0,
    speed_noise_rad_s=0.1,
    reversals=10,
    temperature_range_K=8.0,
    angle=True,
)
CARRIAGE = replace(
    WHEEL, top_speed_rad_s=0.15, top_current_A=60.0, stribeck_speed_rad_s=1e-3, speed_noise_rad_s=1e-4, period_s=0.01,
    friction=CK13_STATISTICAL._replace(motor_gain=0.01, viscous=2.0, coulomb=0.2, static=0.25),
)  # fmt: skip


@pytest.mark.parametrize("facts", [WHEEL, CARRIAGE], ids=["wheel", "carriage"])
@pytest.mark.parametrize("name", [effect.id for effect in FORMULAS])
def test_the_largest_size_is_well_above_the_smallest(name: str, facts: RecordFacts) -> None:
    """On a wheel and on a carriage driven by newtons every effect has room between what matters and what can be."""
    effect = CATALOGUE[name]
    assert effect.largest(facts) > 3.0 * effect.smallest(facts) > 0.0


@pytest.mark.parametrize(
    ("name", "value", "shape", "expected"),
    [
        ("drag_spike", 0.1, (80.0, 60.0, 0.0), True),
        ("drag_spike", 11.4, (80.0, 60.0, 0.0), False),  # in Coulomb frictions
        ("drag_spike", 0.5, (80.0, 0.4, 0.0), False),  # gone within four samples
        ("coulomb_drift", -0.0005, (0.0, 0.0, 0.0), True),
        ("coulomb_drift", -0.002, (0.0, 0.0, 0.0), False),  # dry friction would drive
        ("coulomb_drift", 0.01, (0.0, 0.0, 0.0), False),
        ("stribeck_shape", 2.0, (0.0, 0.0, 0.0), True),
        ("stribeck_shape", 0.05, (0.0, 0.0, 0.0), False),  # crossed within a sample
        ("stribeck_shape", 300.0, (0.0, 0.0, 0.0), False),  # not over at the top speed
        ("drag_bump", 0.1, (90.0, 12.0, 0.0), True),
        ("drag_bump", 0.1, (90.0, 0.3, 0.0), False),  # between two readings
        ("drag_bump", 0.1, (90.0, 85.0, 0.0), False),  # a law of its own
        ("drag_bump", 0.1, (248.0, 12.0, 0.0), False),  # one flank only
    ],
)
def test_a_size_that_no_machine_has_or_no_record_shows_is_refused(
    name: str, value: float, shape: tuple[float, float, float], expected: bool
) -> None:
    """In shares of Coulomb friction: tenths are possible, elevenfold jumps not, nor what readings do not resolve."""
    term = Term(CATALOGUE[name], (value * CK13_STATISTICAL.coulomb,), (0.0,), shape)
    assert TRUTH.with_terms(term).possible(name, WHEEL) is expected


@pytest.mark.parametrize("name", ["stribeck_shape", "presliding_hysteresis", "friction_lag"])
def test_what_shows_near_rest_needs_a_reversal_or_slow_motion(name: str) -> None:
    """Starts and stops of a wheel that turns one way only show it; one that is never near rest does not."""
    fast = replace(WHEEL, reversals=0, slow_samples=3)
    assert "a start or a stop" in (CATALOGUE[name].untestable(fast) or "")
    assert CATALOGUE[name].untestable(replace(fast, slow_samples=80)) is None
    assert CATALOGUE["offset_torque"].untestable(replace(fast, slow_samples=80)) is not None
    assert CATALOGUE[name].untestable(replace(fast, reversals=1)) is None


def test_worse_figures_are_told() -> None:
    """One-step errors 7.6 % larger, or a NIS that leaves 1, are named; better ones are not."""
    before = {"one_step_rms_rpm": 1.0, "free_run_rms_rpm": 5.0, "nis_mean": 1.02}
    assert worsened(before, {**before, "one_step_rms_rpm": 1.076}, 0.07, 1.35) == "the one-step error grows by 7.6 %"
    assert worsened(before, {**before, "nis_mean": 1.56}, 0.07, 1.35) == "NIS goes from 1.02 to 1.56"
    assert worsened(before, {**before, "free_run_rms_rpm": 1.0, "nis_mean": 0.99}, 0.03, 1.15) is None
    assert worsened(before, {**before, "horizon_1s_rms_rpm": 9.0}, 0.03, 1.15) is None


def test_two_tones_nearer_than_the_record_tells_apart_are_not_known() -> None:
    """One tone of 300 s fitted is known; as two, .2 mHz apart, they are large one against the other."""
    run = simulated(["external_torque:amplitude_rad_s2=0.05,frequency_Hz=0.02"], seed=5, samples=3000)
    base = prepare(source_of([log_of(run)]), None, None, "blocks").base

    def sigmas(*frequencies_Hz: float) -> float:
        tones = [Term(CATALOGUE["external_torque"], (0.02, 0.01), (0.1, 0.1), (f, 0.0, 0.0)) for f in frequencies_Hz]
        start = Start(base.model.with_terms(*tones), base.trajectory, base.noise)
        return fit_model(base.problem, start).sigmas_of("external_torque")

    assert sigmas(0.02) > 50.0
    assert sigmas(0.02, 0.0202) < 0.5
