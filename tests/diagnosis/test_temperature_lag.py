"""A bearing that follows its thermometer late, on a wheel simulated here: the lag is found, and carried on."""

from __future__ import annotations

import math
from dataclasses import replace
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
from tests.diagnosis.chamber import wheel_log

LAG_S = 90.0
SLOPES = {"viscous_temperature": -0.02, "coulomb_temperature": -0.006}  # 1/K


@pytest.fixture(scope="module")
def late() -> Diagnosis:
    """Both frictions go with a temperature that acts by a minute and a half later."""
    return rw_ekf.diagnose(wheel_log(1, lag_s=LAG_S, slopes=SLOPES), progress=False)


def test_the_lag_is_found_with_what_goes_by_it(late: Diagnosis) -> None:
    """Lag and slopes within three of their sigmas, none of them beyond a tenth; nothing else is named."""
    assert sorted(late.verdict["effects"]) == sorted(SLOPES)
    found = {entry["effect"]: entry["parameters"] for entry in late.document()["candidates"]}
    for name, slope in SLOPES.items():
        reported, lag = found[name]["slope_1_K"], found[name]["temperature_lag_s"]
        assert abs(reported["value"] - slope) < 3.0 * reported["std"] < 0.3 * abs(slope)
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


def test_a_lag_is_seen_in_a_record_that_only_warms_up() -> None:
    """Time is a function of the temperature there, with the lag and without: that is no reason to doubt the lag."""
    log = wheel_log(7, lag_s=60.0, slopes=SLOPES, chamber=lambda t: 44.0 - 24.0 * math.exp(-t / 200.0))
    found = rw_ekf.diagnose(log, progress=False)
    assert "follows the log's with a lag of" in found.verdict["statement"]
    assert found.model is not None
    assert found.model.temperature_lag_s == pytest.approx(60.0, rel=0.15)


def later(log: WheelLog, begins_s: float) -> WheelLog:
    """The same from a time on, its clock begun anew: the bearing is not as warm as its thermometer."""
    rows = log.rows(slice(int(np.searchsorted(log.time_s, begins_s)), None))
    return replace(rows, time_s=rows.time_s - rows.time_s[0])


def test_a_record_may_begin_in_the_middle_of_a_cycle(late: Diagnosis) -> None:
    """With the model of another one: a drift with the lag's time constant, or a body that was 5 K behind."""
    log = later(wheel_log(8, lag_s=LAG_S, slopes=SLOPES), 120.0)
    again = rw_ekf.diagnose(log, model=late.model, progress=False)
    assert again.verdict["kind"] == "adequate", again.verdict["statement"]
    run = replay_log(log, None, late.model)
    assert run.statistics.nis_sum / run.statistics.used == pytest.approx(1.0, abs=0.06)
    assert not any("not noise" in text for text in run.warnings)


def test_rows_that_are_lost_do_not_warm_the_bearing() -> None:
    """Eight seconds of telemetry are missing in the middle of a cycle."""
    log = wheel_log(9, lag_s=LAG_S, slopes=SLOPES)
    kept = np.flatnonzero((log.time_s < 250.0) | (log.time_s > 258.0))
    found = rw_ekf.diagnose(log.rows(kept), progress=False)
    assert sorted(found.verdict["effects"]) == sorted(SLOPES), found.verdict["statement"]


def test_a_temperature_that_a_model_needs_and_a_log_has_not_is_told(late: Diagnosis) -> None:
    """Throughout, or for two minutes in which it changed."""
    log = wheel_log(10, lag_s=LAG_S, slopes=SLOPES)
    bare = replay_log(replace(log, channels={}), None, late.model)
    assert any("goes with the temperature, which this log has not" in text for text in bare.warnings)
    hole = np.where((log.time_s > 100.0) & (log.time_s < 220.0), np.nan, log.channels["temperature_degC"])
    holed = replace(log, channels={**log.channels, "temperature_degC": hole})
    assert any("the temperature is not known from 100" in text for text in replay_log(holed, None, late.model).warnings)
