"""A model that a diagnosis wrote, put to its own record and to the wheel's next one: it does not contradict itself."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import rw_ekf
from rw_ekf.diagnosis.result import Diagnosis
from rw_ekf.log_replay import replay_log
from rw_ekf.logs.wheel_log import WheelLog
from rw_ekf.model.state import CK13_STATISTICAL, STATE_SIZE
from rw_ekf.units import RAD_S_PER_RPM
from rw_ekf.wheel.model_file import model_from_data


def without_angle(effect: str, seed: int, begins_s: float = 0.0) -> WheelLog:
    """Ten minutes of the simulated wheel, its angle not logged; from another time on its clock begins at zero."""
    log = rw_ekf.simulate("identification", effects=[effect], seed=seed)
    first = int(np.searchsorted(log.time_s, begins_s))
    rows = log.rows(slice(first, None))
    channels = {name: values for name, values in rows.channels.items() if name != "angle_rad"}
    return replace(rows, time_s=rows.time_s - rows.time_s[0], channels=channels)


def in_whole_rpm(seed: int) -> WheelLog:
    """A healthy wheel whose telemetry rounds to whole rpm."""
    log = rw_ekf.simulate("identification", seed=seed, speed_noise_rpm=0.1)
    return replace(log, speed_rad_s=np.round(log.speed_rad_s / RAD_S_PER_RPM) * RAD_S_PER_RPM)


@pytest.fixture(scope="module")
def rounded() -> Diagnosis:
    """The grid of whole rpm is in the model."""
    found = rw_ekf.diagnose(in_whole_rpm(5), progress=False)
    assert found.model is not None
    assert found.model.effects.ids == ("speed_quantisation",)
    return found


def test_a_grid_is_diagnosed_with_again(rounded: Diagnosis) -> None:
    """It has no coefficient that a filter knows; a diagnosis with it ended with an error."""
    again = rw_ekf.diagnose(in_whole_rpm(6), model=rounded.model, progress=False)
    assert again.verdict["kind"] == "adequate", again.verdict["statement"]


def test_a_model_with_a_grid_is_compared(rounded: Diagnosis) -> None:
    """With one that a fit of the same wheel wrote; the four parameters are what both have."""
    fitted = rw_ekf.fit(in_whole_rpm(6)).model
    compared = rw_ekf.compare(fitted, rounded)
    assert [item.name for item in compared.differences] == ["motor_gain", "viscous", "coulomb", "static"]


RIPPLE = "torque_ripple:order=1,amplitude_rad_s2=0.06"


@pytest.fixture(scope="module")
def turning() -> Diagnosis:
    """A ripple is found without a logged angle."""
    found = rw_ekf.diagnose(without_angle(RIPPLE, 7), progress=False)
    assert found.verdict["effects"] == ["torque_ripple"]
    return found


@pytest.mark.parametrize("seed", [7, 8])
def test_a_ripple_explains_its_record_and_the_next(turning: Diagnosis, seed: int) -> None:
    """Along an angle that is integrated from speeds; another record begins elsewhere in the turn."""
    again = rw_ekf.diagnose(without_angle(RIPPLE, seed, 20.0 * (seed - 7)), model=turning.model, progress=False)
    assert again.verdict["kind"] == "adequate", again.verdict["statement"]


def test_a_filter_follows_a_ripple_whose_angle_is_lost(turning: Diagnosis) -> None:
    """Sine and cosine turn as the phase is lost: the innovations are white, and nothing is gated."""
    run = replay_log(without_angle(RIPPLE, 8, 20.0), None, turning.model)
    assert run.statistics.nis_sum / run.statistics.used == pytest.approx(1.0, abs=0.06)
    assert run.statistics.rejected <= 2
    assert not any("not noise" in text for text in run.warnings)


def test_a_periodic_torque_has_another_phase_in_the_next_record() -> None:
    """Its frequency stays the model's: with the phase held to the first record's, another frequency took its place."""
    torque = "external_torque:frequency_Hz=0.02,amplitude_rad_s2=0.05"
    found = rw_ekf.diagnose(without_angle(torque, 3), progress=False)
    assert found.verdict["effects"] == ["external_torque"]
    run = replay_log(without_angle(torque, 4, 20.0), None, found.model)
    assert run.statistics.nis_sum / run.statistics.used == pytest.approx(1.0, abs=0.06)
    assert not any("external_torque" in text or "contradict" in text for text in run.warnings)


def test_a_law_that_the_next_record_denies_leaves_no_sigmas_behind() -> None:
    """A model of a straight line that was taken for an exponential: its numbers are those of the wrong law."""
    line = "coulomb_temperature:slope_1_K=-0.01"
    found = rw_ekf.diagnose(rw_ekf.simulate("identification", effects=[line], seed=5), progress=False)
    assert found.model is not None
    document = found.model.document()
    document["effects"][0]["constants"]["law"] = 1.0
    run = replay_log(
        rw_ekf.simulate("identification", effects=[line], seed=6), None, model_from_data(document, lambda path: "model")
    )
    place = STATE_SIZE
    assert abs(run.belief.mean[place] + 0.01) < 4.0 * run.belief.std[place]
    assert abs(run.belief.parameters.coulomb - CK13_STATISTICAL.coulomb) < 4.0 * run.belief.parameter_std.coulomb
