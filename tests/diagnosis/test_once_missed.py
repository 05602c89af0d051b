"""Wheels of the proof whose effect was once missed or named beside another: what they have is what is named, alone."""

from __future__ import annotations

import pytest

from rw_ekf.diagnosis.log_diagnosis import diagnose_log
from rw_ekf.diagnosis.report.words import Units, headline_of
from tools.proof.marks import case_called
from tools.proof.plants import log_of

pytestmark = pytest.mark.slow


@pytest.mark.parametrize(
    ("case", "seed", "effect"),
    [
        ("id-1rpm-061-drag_bump", 6, "drag_bump"),  # its height and its width are one question: so no size was known
        ("id-1rpm-057-coulomb_drift", 6, "coulomb_drift"),  # was a law of temperature, and another that mended it
        ("id-1rpm-014-drag_spike", 9, "drag_spike"),  # 12 s long: half of its seconds said nothing of the rest
        ("id-1rpm-039-speed_quantisation", 9, "speed_quantisation"),  # 10 rpm; "depends on low speed, angle"
        ("id-1rpm-039-speed_quantisation", 13, "speed_quantisation"),  # a ripple, then a Stribeck curve beside it
        ("id-1rpm-057-coulomb_drift", 9, "coulomb_drift"),  # was a law of temperature that was less likely by 15
        ("id-5rpm-022-viscous_asymmetry", 16, "viscous_asymmetry"),  # unexplained: the base fit missed the break-away
        ("p12-1rpm-056-drag_spike", 9, "drag_spike"),  # was a friction that drifts, by a tenth of evidence
        ("id-5rpm-011-presliding_hysteresis", 18, "presliding_hysteresis"),  # by its slopes too small
        ("id-5rpm-012-friction_lag", 19, "friction_lag"),  # its fit stood where it began: a bristle 13 less likely
        ("p12-1rpm-017-external_torque", 19, "external_torque"),  # half a line off a harmonic: not even looked at
        ("p12-1rpm-038-external_torque", 6, "external_torque"),  # near a harmonic of the current; was torque noise
        ("elsewhere-038-external_torque", 23, "external_torque"),  # was a friction that wanders, with a chance of .0009
        ("elsewhere-038-external_torque", 24, "external_torque"),  # the same, of 90 s: neither half predicts the other
        ("elsewhere-061-drag_bump", 24, "drag_bump"),  # "adequate", with a chance of less than 1 % that it is
        ("id-1rpm-214-viscous_temperature", 61, "viscous_temperature"),  # refused: no noise is left to its model
        ("p12-1rpm-004-viscous_temperature", 61, "viscous_temperature"),  # 34 % per kelvin: a dry friction, and a bump
        ("id-5rpm-015-coulomb_drift", 25, "coulomb_drift"),  # wandered while the wheel warmed up: a law of temperature
        ("elsewhere-039-speed_quantisation", 24, "speed_quantisation"),  # taken for a filter in the sensor
        ("elsewhere-058-stribeck_shape", 31, "stribeck_shape"),  # "needs a reversal": three starts and stops, one way
        ("p12-1rpm-016-stribeck_shape", 33, "stribeck_shape"),  # stood behind a bump that no machine has
        ("elsewhere-053-presliding_hysteresis", 31, "presliding_hysteresis"),  # the same
    ],
)
def test_the_effect_is_named_alone(case: str, seed: int, effect: str) -> None:
    """One effect, and no other, of a wheel with one; and its posterior says so."""
    document = diagnose_log(log_of(case_called(case, seed))).document()
    assert document["verdict"]["effects"] == [effect]
    assert document["verdict"]["posterior"][effect] > 0.8


def test_a_constant_torque_that_a_law_stood_for_alone_is_named_beside_what_is_found_next() -> None:
    """A torque by the size of the current explains 12 more than it, of a wheel whose gain rises too; both, 12 less."""
    document = diagnose_log(log_of(case_called("pairs-035-motor_gain_temperature+offset_torque", 7703))).document()
    assert sorted(document["verdict"]["effects"]) == ["motor_gain_temperature", "offset_torque"]


def test_an_event_and_a_law_that_are_nearly_as_likely_are_both_told() -> None:
    """A motor gain that rises was a spike because that explained 5 more of 35; but a spike has more to choose from."""
    document = diagnose_log(log_of(case_called("id-5rpm-006-motor_gain_temperature", 10))).document()
    verdict = document["verdict"]
    assert verdict["effects"] == ["motor_gain_temperature"]
    assert verdict["indistinguishable"] == [["motor_gain_temperature", "drag_spike"]]
    assert verdict["posterior"]["motor_gain_temperature"] > verdict["posterior"]["drag_spike"] > 0.02


@pytest.mark.parametrize(
    ("case", "seed"), [("pairs-003-drag_spike+quadratic_drag", 11), ("id-1rpm-036-coulomb_drift", 9)]
)
def test_a_friction_that_wanders_is_one_effect_however_many_its_pieces(case: str, seed: int) -> None:
    """Named for a weak spike, or because it wanders: its probability is not that of thirty effects at once."""
    verdict = diagnose_log(log_of(case_called(case, seed))).document()["verdict"]
    assert verdict["effects"] == ["coulomb_drift"]
    assert verdict["posterior"]["coulomb_drift"] > 0.8


def test_what_one_effect_does_as_well_as_two_is_a_law_before_it_is_an_event() -> None:
    """A friction that runs in from the log's start is no spike in its first second, though one fits by 1 better."""
    verdict = diagnose_log(log_of(case_called("id-1rpm-036-coulomb_drift", 11))).document()["verdict"]
    assert verdict["effects"] == ["coulomb_drift"]


def test_a_bump_that_shrank_to_what_no_reading_resolves_is_fitted_from_a_wider_place() -> None:
    """Where noise makes a narrow one likelier by 1, what is found is the wide one that there is, within two sigma."""
    document = diagnose_log(log_of(case_called("id-5rpm-019-drag_bump", 24))).document()
    assert document["verdict"]["effects"] == ["drag_bump"]
    found = next(item for item in document["candidates"] if item["effect"] == "drag_bump")["parameters"]
    for name, truth in (("amplitude_rad_s2", 0.0377), ("speed_rad_s", 45.6), ("width_rad_s", 24.1)):
        assert abs(found[name]["value"] - truth) < 2.0 * found[name]["std"], name


def test_a_drag_that_half_of_a_short_log_cannot_predict_is_named_with_what_is_like_it() -> None:
    """90 s of one-way turning know two laws of drag, and say by how much held-out errors are blurred."""
    document = diagnose_log(log_of(case_called("elsewhere-045-cubic_drag", 23))).document()
    verdict = document["verdict"]
    assert set(verdict["indistinguishable"][0]) >= {"quadratic_drag", "cubic_drag"}
    assert verdict["posterior"]["none"] < 0.05
    assert "knows them poorly" in verdict["statement"]
    assert {tuple(item["effects"]) for item in document["explanations"]} >= {("quadratic_drag",), ("cubic_drag",)}
    assert "quadratic drag or cubic drag" in headline_of(document, Units(wheel=True, inertia_kg_m2=None))


@pytest.mark.parametrize(
    ("case", "effect"),
    [
        ("elsewhere-010-transport_delay", "transport_delay"),  # 2.60 -> 1.12 rpm, refused for 9 % one step ahead
        ("elsewhere-030-actuator_lag", "actuator_lag"),  # refused by a half that knows too little; a walk was named
    ],
)
def test_a_late_reading_is_named_though_one_step_ahead_says_otherwise(case: str, effect: str) -> None:
    """What is as good as certain on the whole record is one of three ways of being late, and nothing else."""
    verdict = diagnose_log(log_of(case_called(case, 31))).document()["verdict"]
    late = {"transport_delay", "actuator_lag", "speed_averaging"}
    assert verdict["kind"] == "effect"
    assert len(verdict["effects"]) == 1
    assert set(verdict["effects"]) <= late
    assert effect in verdict["indistinguishable"][0]
    assert set(verdict["indistinguishable"][0]) <= late
