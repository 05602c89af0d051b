"""Diagnoses of logs with something odd about them that is no effect: the verdict does not change."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rw_ekf.diagnosis.log_diagnosis import diagnose_log
from rw_ekf.diagnosis.prepare.source import source_of
from rw_ekf.diagnosis.prepare.split import split_record
from rw_ekf.effects.catalogue import CATALOGUE
from rw_ekf.errors import LogError
from rw_ekf.logs.wheel_log import WheelLog
from rw_ekf.model.effect import Term
from rw_ekf.model.state import FrictionParameters
from rw_ekf.wheel.effect_table import EffectSet
from rw_ekf.wheel.model_file import WheelModel, read_model
from tests.diagnosis.simulated import TRUTH, diagnosed_once, log_of, simulated
from tests.wheel.test_walk import injected

pytestmark = pytest.mark.xdist_group("rough logs")  # some are diagnosed once for several tests

DRAG = injected("quadratic_drag")


def diagnosed(log: WheelLog, model: WheelModel | None = None) -> dict[str, Any]:
    """The document."""
    return diagnose_log(log, model=model).document()


@pytest.mark.slow
@pytest.mark.parametrize("part", ["fit", "heldout"])
def test_a_few_spiked_readings_hide_nothing(part: str) -> None:
    """Ten readings in six thousand that no wheel can have, on either part: drag is named, figures are sane."""
    log = log_of(simulated([DRAG], seed=21))
    split = split_record(log.time_s, log.segment, log.speed_rad_s, "blocks", 0.1)
    speed = log.speed_rad_s.copy()
    speed[np.flatnonzero(getattr(split, part))[100::300]] += 30.0
    document = diagnosed(replace(log, speed_rad_s=speed))
    assert document["verdict"]["effects"] == ["quadratic_drag"], document["verdict"]["statement"]
    assert document["after"]["free_run_rms_rpm"] < 1.3
    assert document["after"]["one_step_rms_rpm"] < 1.1


@pytest.mark.slow
@pytest.mark.parametrize("name", ["external_torque", "drag_spike"])
def test_the_clock_of_a_log_may_begin_anywhere(name: str) -> None:
    """Seconds since 1970 or since the start: the same effect with the same size, an onset on the log's own clock."""
    log, since_start = diagnosed_once(injected(name))
    since_1970 = diagnose_log(replace(log, time_s=log.time_s + 1.76e9))
    sizes, onsets = [], []
    for begins_s, document in ((0.0, since_start.document()), (1.76e9, since_1970.document())):
        assert document["verdict"]["effects"] == [name], document["verdict"]["statement"]
        found = next(item for item in document["candidates"] if item["effect"] == name)["parameters"]
        sizes.append(found["amplitude_rad_s2"]["value"])
        onsets.append(found["onset_s"]["value"] - begins_s if "onset_s" in found else 0.0)
    assert sizes[1] == pytest.approx(sizes[0], rel=0.02)
    assert onsets[1] == pytest.approx(onsets[0], abs=0.2)


@pytest.mark.slow
def test_readings_without_noise_are_no_accusation() -> None:
    """A healthy wheel read perfectly differs from the model by the integration's own error, which is no structure."""
    document = diagnosed(log_of(simulated(seed=1, noise_rpm=0.0)))
    assert document["verdict"]["kind"] == "adequate", document["verdict"]["statement"]


@pytest.mark.slow
def test_a_model_without_viscous_friction_is_a_place_to_start_from() -> None:
    """A parameter that is exactly zero in a model file has a width all the same."""
    known = TRUTH.parameters
    covariance = tuple(tuple(float(v) for v in row) for row in np.diag([0.1, 1e-6, 1e-3, 1e-2]))
    model = WheelModel(
        FrictionParameters(known.motor_gain, 0.0, known.coulomb, known.static), covariance, TRUTH.stribeck.omega_s
    )
    document = diagnosed(log_of(simulated(seed=4, samples=3000)), model)
    assert document["verdict"]["kind"] == "adequate", document["verdict"]["statement"]


@pytest.mark.slow
def test_a_given_effect_that_is_not_missed_is_no_error() -> None:
    """A model that claims an offset which is not there, on a log with drag: drag is found."""
    claimed = EffectSet((Term.of(CATALOGUE["offset_torque"], value=0.001, std=0.01),))
    covariance = tuple(tuple(float(v) for v in row) for row in np.diag([0.1, 1e-6, 1e-3, 1e-2, 1e-4]))
    model = WheelModel(TRUTH.parameters, covariance, TRUTH.stribeck.omega_s, effects=claimed)
    document = diagnosed(log_of(simulated([DRAG], seed=31)), model)
    assert "quadratic_drag" in document["verdict"]["effects"], document["verdict"]["statement"]


@pytest.mark.slow
@pytest.mark.parametrize("name", ["quadratic_drag", "actuator_lag", "drag_spike"])
def test_the_loop_closes(tmp_path: Path, name: str) -> None:
    """Diagnosed again with the model that the diagnosis wrote, read back from its file, the log is explained."""
    log, found = diagnosed_once(injected(name))
    assert found.model is not None, found.document()["verdict"]["statement"]
    path = tmp_path / "augmented-model.yaml"
    path.write_text(found.model.to_text(), encoding="utf-8")
    document = diagnosed(log, read_model(path))
    assert document["verdict"]["kind"] == "adequate", document["verdict"]["statement"]
    assert document["before"]["free_run_rms_rpm"] < 1.3


def test_a_log_given_twice_is_refused_and_two_runs_of_one_motion_are_not() -> None:
    """The same rows under another name would count twice; other noise on the same motion is another run."""
    first = log_of(simulated(["offset_torque"], seed=1, profile="P1"))
    again, other = replace(first, name="copy.csv"), log_of(simulated(["offset_torque"], seed=2, profile="P1"))
    with pytest.raises(LogError, match=r"copy\.csv: 3000 of its 3000 rows are rows of"):
        source_of([first, again])
    assert source_of([first, other]).samples == len(first) + len(other)
