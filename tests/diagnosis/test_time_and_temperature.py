"""What goes with time beside what goes with temperature, and in the wheel's next record."""

from __future__ import annotations

import functools
import math

import pytest

import rw_ekf
from rw_ekf.diagnosis.result import Diagnosis
from rw_ekf.log_replay import replay_log
from rw_ekf.logs.wheel_log import WheelLog
from rw_ekf.wheel.model_file import WheelModel
from tests.diagnosis.chamber import COULOMB, ramp, wheel_log


def diagnosed(log: WheelLog, model: WheelModel | None = None) -> Diagnosis:
    """What is found in a log, beside a model."""
    return rw_ekf.diagnose(log, model=model, progress=False)


def test_a_coulomb_friction_that_is_exponential_needs_no_drift() -> None:
    """By a half over 24 K: a straight line through it left a friction that settles, and told its slope wrong."""
    found = diagnosed(wheel_log(1, slopes={"coulomb_temperature": -0.03}))
    assert found.verdict["effects"] == ["coulomb_temperature"], found.verdict["statement"]
    reported = next(c for c in found.document()["candidates"] if c["effect"] == "coulomb_temperature")["parameters"]
    assert reported["law"]["value"] == "exponential"
    assert abs(reported["slope_1_K"]["value"] + 0.03) < 3.0 * reported["slope_1_K"]["std"]


def test_a_periodic_torque_is_named_beside_a_temperature_that_only_rises() -> None:
    """A sine of twelve periods is no smooth function of the temperature, though time is one."""
    found = diagnosed(
        wheel_log(
            2, slopes={"viscous_temperature": -0.02}, chamber=ramp,
            torque=lambda t: 0.06 * COULOMB * math.sin(2.0 * math.pi * t / 50.0),
        )
    )  # fmt: skip
    assert {"viscous_temperature", "external_torque"} <= set(found.verdict["effects"]), found.verdict["statement"]


@functools.cache
def begun() -> Diagnosis:
    """The diagnosis of a torque that begins and stays, made once."""
    return diagnosed(wheel_log(3, torque=lambda t: 0.1 * COULOMB if t > 250.0 else 0.0))


@pytest.mark.xdist_group("begun")
def test_a_torque_that_begins_and_stays_is_a_change() -> None:
    """A spell has an end, which this record does not show; a curve over time is no rival of a step."""
    assert begun().verdict["effects"] == ["change"], begun().verdict["statement"]


def brown_out(begins_s: float) -> WheelLog:
    """The motor gain is 8 % less for a minute."""
    return wheel_log(int(begins_s), gain=lambda t: 0.92 if begins_s < t < begins_s + 60.0 else 1.0)


def test_what_came_and_went_is_no_part_of_the_next_record() -> None:
    """The same brown-out later in another record: the model's own, at its own time, stood in the way."""
    first = diagnosed(brown_out(200.0))
    assert first.verdict["effects"] == ["spell"], first.verdict["statement"]
    again = diagnosed(brown_out(400.0), first.model)
    assert again.verdict["effects"] == ["spell"], again.verdict["statement"]


def test_a_filter_follows_what_its_model_does_not_know() -> None:
    """A torque that begins in the next record: refused readings and resets, or more torque noise and a sentence."""
    model = rw_ekf.fit(wheel_log(5), noise=True).model
    run = replay_log(wheel_log(6, torque=lambda t: -0.2 * COULOMB if t > 300.0 else 0.0), None, model)
    assert run.statistics.rejected + run.statistics.reseeded <= 6
    assert 0.8 < run.statistics.nis_sum / run.statistics.used < 1.2
    assert any("what the model given does not know" in text for text in run.warnings)


@pytest.mark.xdist_group("begun")
def test_a_change_in_the_model_hides_no_other_in_the_next_record() -> None:
    """What came and stayed is an offset there, and the next step is told as one."""
    first = begun()
    stayed = wheel_log(12, torque=lambda t: 0.1 * COULOMB)
    assert diagnosed(stayed, first.model).verdict["kind"] == "adequate"
    another = wheel_log(13, torque=lambda t: (0.1 if t < 300.0 else 0.25) * COULOMB)
    again = diagnosed(another, first.model)
    assert again.verdict["effects"] == ["change"], again.verdict["statement"]


def test_a_gain_that_changed_in_the_model_s_record_is_no_other_wheel_in_the_next() -> None:
    """Eight per cent less is what the model holds from then on, and what the next record has throughout."""
    first = diagnosed(wheel_log(3, gain=lambda t: 0.92 if t > 250.0 else 1.0))
    assert first.verdict["effects"] == ["change"], first.verdict["statement"]
    again = diagnosed(wheel_log(14, gain=lambda t: 0.92), first.model)
    assert again.verdict["kind"] == "adequate"
    assert "changed since" not in again.verdict["statement"]
    before = diagnosed(wheel_log(15), first.model)
    assert before.verdict["kind"] == "adequate", before.verdict["statement"]
