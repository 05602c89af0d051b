"""A bearing that follows its thermometer late, on a wheel simulated here: the lag is found, and carried on."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

import rw_ekf
from rw_ekf.diagnosis.result import Diagnosis
from rw_ekf.errors import ConfigError
from rw_ekf.log_replay import replay_log
from rw_ekf.logs.wheel_log import WheelLog
from rw_ekf.starting_point import setup_of_model
from rw_ekf.wheel.model_file import WheelModel

LAG_S = 90.0
SLOPES = {"viscous_temperature": -0.02, "coulomb_temperature": -0.006}  # 1/K
GAIN, VISCOUS, COULOMB, STATIC, STRIBECK = 30.0, 0.02, 0.55, 0.66, 0.42
STEP_S = 0.005


def wheel_log(seed: int, *, lag_s: float, slopes: dict[str, float], noise_rpm: float = 1.0) -> WheelLog:
    """Ten minutes at 10 Hz in a chamber that is warmed by 24 K and cooled again; Euler, no code of the package.

    The torque is new each moment by .01 rad/s per sqrt(s); the thermometer reads to .05 K.
    """
    rng, n = np.random.default_rng(seed), 6000
    current = np.repeat(rng.uniform(-0.1, 0.1, n // 200), 200).round(4)
    chamber = 20.0 + 12.0 * (1.0 - np.cos(2.0 * math.pi * np.arange(n) / 10.0 / rng.uniform(400.0, 600.0)))
    kicks = 0.01 * math.sqrt(0.1) * rng.standard_normal(n)
    speed, body, found = 0.0, chamber[0], np.empty(n)
    inner = round(0.1 / STEP_S)
    for i in range(n):
        found[i] = speed
        speed += kicks[i]
        for _ in range(inner):
            body += (chamber[i] - body) * (STEP_S / lag_s if lag_s else 1.0)
            warm = body - 20.0
            viscous = VISCOUS * math.exp(slopes.get("viscous_temperature", 0.0) * warm)
            dry = 1.0 + slopes.get("coulomb_temperature", 0.0) * warm
            torque = GAIN * current[i] - viscous * speed
            if speed == 0.0 and abs(torque) <= STATIC * dry:
                continue
            way = math.copysign(1.0, speed if speed != 0.0 else torque)
            friction = dry * COULOMB + (STATIC - COULOMB) * math.exp(-((speed / STRIBECK) ** 2))
            moved = speed + STEP_S * (torque - way * friction)
            speed = 0.0 if moved * way < 0.0 else moved
    readings = found + noise_rpm * math.pi / 30.0 * rng.standard_normal(n)
    return rw_ekf.read({
        "time_s": np.arange(n) / 10.0, "speed_rad_s": readings, "current_A": current,
        "temperature_degC": chamber + 0.05 * rng.standard_normal(n),
    })  # fmt: skip


@pytest.fixture(scope="module")
def late() -> Diagnosis:
    """Both frictions go with a temperature that acts by a minute and a half later."""
    return rw_ekf.diagnose(wheel_log(1, lag_s=LAG_S, slopes=SLOPES), progress=False)


def test_the_lag_is_found_with_what_goes_by_it(late: Diagnosis) -> None:
    """Lag and slopes within three of their sigmas, none of them beyond a tenth; nothing else is named."""
    assert sorted(late.verdict["effects"]) == sorted(SLOPES)
    found = {entry["effect"]: entry["parameters"] for entry in late.document()["candidates"]}
    for name, slope in SLOPES.items():
        told, lag = found[name]["slope_1_K"], found[name]["temperature_lag_s"]
        assert abs(told["value"] - slope) < 3.0 * told["std"] < 0.3 * abs(slope)
        assert abs(lag["value"] - LAG_S) < 3.0 * lag["std"] < 0.3 * LAG_S
    assert "follows the log's with a lag of" in late.verdict["statement"]


def test_a_filter_follows_the_next_record_with_it(late: Diagnosis, tmp_path: Path) -> None:
    """The model's file holds the lag, and the innovations of another record are white; a filter online has the same."""
    assert late.model is not None
    late.model.save(tmp_path / "m.yaml")
    model = WheelModel.load(tmp_path / "m.yaml")
    assert model.temperature_lag_s == pytest.approx(LAG_S, rel=0.1)
    log = wheel_log(2, lag_s=LAG_S, slopes=SLOPES)
    run = replay_log(log, None, model)
    assert run.statistics.nis_sum / run.statistics.used == pytest.approx(1.0, abs=0.06)
    assert not any("not noise" in text for text in run.warnings)
    setup = setup_of_model(model, 0.1, 0.01, 0.1)
    whole, online = (replay_log(log, setup=setup, online=online) for online in (False, True))
    assert online.belief.mean == pytest.approx(whole.belief.mean, rel=1e-9)


def test_diagnosed_again_with_it_nothing_is_missing(late: Diagnosis) -> None:
    """The next record, diagnosed with the model, lacks nothing, and the model that is written has the lag still."""
    assert late.model is not None
    again = rw_ekf.diagnose(wheel_log(3, lag_s=LAG_S, slopes=SLOPES), model=late.model, progress=False)
    assert again.verdict["kind"] == "adequate", again.verdict["statement"]


@pytest.mark.parametrize("slopes", [{}, SLOPES])
def test_no_lag_is_seen_where_there_is_none(slopes: dict[str, float]) -> None:
    """A wheel without laws of the temperature, and one whose thermometer is the bearing's."""
    found = rw_ekf.diagnose(wheel_log(4, lag_s=0.0, slopes=slopes), progress=False)
    assert sorted(found.verdict["effects"]) == sorted(slopes)
    assert "lag of" not in found.verdict["statement"]
    assert found.model is None or found.model.temperature_lag_s == 0.0


def test_a_lag_below_zero_is_refused(late: Diagnosis, tmp_path: Path) -> None:
    """With file, line and column."""
    assert late.model is not None
    file = tmp_path / "m.yaml"
    text = late.model.to_text()
    file.write_text("\n".join("temperature_lag_s: -3.0" if "lag_s" in row else row for row in text.splitlines()))
    with pytest.raises(ConfigError, match=r"m\.yaml:\d+:\d+: temperature_lag_s"):
        WheelModel.load(file)
