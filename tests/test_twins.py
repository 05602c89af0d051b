"""Simulated twins of measured records through the shipped maps: what is read, what the diagnosis makes of it.

The twins (`tests.twins`) have the files' format and the physics that is published of them. The records themselves are
judged by `make proof-measured`.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rw_ekf.diagnosis.log_diagnosis import diagnose_log
from rw_ekf.diagnosis.result import Diagnosis
from rw_ekf.logs.reader import read_log
from rw_ekf.logs.wheel_log import WheelLog
from rw_ekf.settings.resources import config_resource
from tests import twins
from tools.proof.measured import main


def read(folder: Path, record: str, columns: str) -> WheelLog:
    return read_log(folder / record, config_resource(f"columns-{columns}"))


def diagnosed(log: WheelLog) -> tuple[Diagnosis, dict[str, dict[str, float]], dict[str, dict[str, Any]]]:
    """The diagnosis, its parameters, and the numbers of the effects that were added."""
    diagnosis = diagnose_log(log)
    document = diagnosis.document()
    parameters = document["parameters"]["after"] or document["parameters"]["before"]
    added = {one["effect"]: one["parameters"] for one in document["candidates"] if one["decision"] == "added"}
    return diagnosis, parameters, added


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("records")


def twin(folder: Path, write: Callable[[Path], None], record: str, columns: str) -> WheelLog:
    if not (folder / record).is_file():
        write(folder)
    return read(folder, record, columns)


@pytest.fixture(scope="module")
def dyno(folder: Path) -> WheelLog:
    return twin(folder, twins.write_dyno, "dyno_motor/data_concat.csv", "dyno-motor")


@pytest.fixture(scope="module")
def prbs(folder: Path) -> WheelLog:
    return twin(folder, lambda place: twins.write_prbs(place, seconds=40.0), *PRBS)


@pytest.fixture(scope="module")
def pendulum(folder: Path) -> WheelLog:
    return twin(folder, lambda place: twins.write_pendulum(place, seconds=40.0), *PENDULUM)


@pytest.fixture(scope="module")
def dspace(folder: Path) -> WheelLog:
    return twin(folder, twins.write_dspace, "dspace_motor/dataset.mat", "dspace-motor")


PRBS = ("prbs_motor/DCmotor_prbs_open_exp.csv", "prbs-motor")
PENDULUM = ("pendulum/measured_data.csv", "pendulum")


def test_the_dynamometer_s_units_and_sign(dyno: WheelLog) -> None:
    """Seconds, radians; an effort with the sign of the motion that it causes; stamps 16 to 91 ms apart."""
    step = np.diff(dyno.time_s)
    assert [step.min(), step.max()] == pytest.approx([0.016, 0.091])
    turned = np.diff(dyno.channels["angle_rad"])
    assert np.corrcoef(turned, dyno.speed_rad_s[1:] * step)[0, 1] > 0.99
    assert np.corrcoef(np.sign(dyno.current_A[:-1]), np.diff(dyno.speed_rad_s))[0, 1] > 0.0
    assert np.abs(dyno.current_A).max() == 1.0


def test_an_effort_against_the_motion_is_said(dyno: WheelLog, folder: Path, tmp_path: Path) -> None:
    """Without the minus in the map the log is misread, and the sentence has the line that mends it."""
    shipped = config_resource("columns-dyno-motor").read_text()
    (tmp_path / "map.yaml").write_text(shipped.replace("scale: -1.0", "scale: 1.0"))
    log = read_log(folder / "dyno_motor" / "data_concat.csv", tmp_path / "map.yaml")
    statement = diagnose_log(log).verdict["statement"]
    assert "misread" in statement
    assert "opposite directions" in statement
    assert "scale: -1" in statement


@pytest.mark.slow
def test_the_dynamometer_s_gain_falls_with_the_effort(dyno: WheelLog) -> None:
    """Gain, friction and the share that is lost at full effort."""
    diagnosis, parameters, added = diagnosed(dyno)
    assert diagnosis.verdict["kind"] == "effect"
    assert parameters["motor_gain"]["value"] == pytest.approx(twins.DYNO_GAIN, rel=0.02)
    assert parameters["viscous"]["value"] == pytest.approx(twins.DYNO_VISCOUS, rel=0.05)
    assert parameters["coulomb"]["value"] == pytest.approx(twins.DYNO_COULOMB, rel=0.03)
    assert set(added) == {"motor_saturation"}
    assert added["motor_saturation"]["slope_1_A"]["value"] == pytest.approx(twins.DYNO_SATURATION, rel=0.1)


@pytest.mark.slow
def test_the_geared_motor_s_commands_are_a_row_late(prbs: WheelLog) -> None:
    """Delay and grid are named; gain and friction are those of the motor, which without them are 30 % off."""
    diagnosis, parameters, added = diagnosed(prbs)
    assert diagnosis.verdict["kind"] == "effect"
    assert set(added) == {"transport_delay", "speed_quantisation"}
    assert added["transport_delay"]["delay_s"]["value"] == pytest.approx(twins.PRBS_LATE_S, abs=1.0e-3)
    grid = added["speed_quantisation"]["grid_rad_s"]["value"]
    assert grid == pytest.approx(twins.PRBS_GRID_DEG_S * twins.DEG, rel=1.0e-3)
    assert parameters["motor_gain"]["value"] == pytest.approx(twins.PRBS_GAIN, rel=0.02)
    assert parameters["viscous"]["value"] == pytest.approx(twins.PRBS_VISCOUS, rel=0.02)
    assert parameters["coulomb"]["value"] == pytest.approx(twins.PRBS_COULOMB, rel=0.05)


@pytest.mark.slow
def test_the_tool_judges_a_record_beside_its_rivals(prbs: WheelLog, folder: Path, tmp_path: Path) -> None:
    """Of the geared motor: no rival, a row's delay known to each, does better; table and document say so."""
    assert main(["--data", str(folder), "--only", "prbs", "--out", str(tmp_path)]) == 0
    (record,) = json.loads((tmp_path / "measured.json").read_text())["records"]
    assert record["samples"] == len(prbs)
    assert record["ours_over_best"] <= 1.05
    assert record["holds"] is True
    assert all("1 rows late" in rival["how"] for rival in record["rivals"])
    assert "prbs_motor" in (tmp_path / "measured.md").read_text()


@pytest.mark.slow
def test_the_pendulum_s_gravity_is_a_torque_of_the_angle(pendulum: WheelLog) -> None:
    """A torque of order one, of gravity's size, nothing at the bottom."""
    assert pendulum.drive == "current_A"
    diagnosis, parameters, added = diagnosed(pendulum)
    assert diagnosis.verdict["kind"] == "effect"
    assert set(added) == {"torque_ripple"}
    ripple = {name: one["value"] for name, one in added["torque_ripple"].items()}
    assert ripple["order"] == 1.0
    assert ripple["amplitude_rad_s2"] == pytest.approx(twins.GRAVITY, rel=0.02)
    assert ripple["phase_rad"] == pytest.approx(0.0, abs=0.05)
    assert parameters["motor_gain"]["value"] == pytest.approx(twins.PENDULUM_GAIN, rel=0.02)
    assert parameters["viscous"]["value"] == pytest.approx(twins.PENDULUM_VISCOUS, rel=0.1)


def test_a_dspace_recording_is_read(dspace: WheelLog) -> None:
    """Structs within a struct: time, speed and command by the names that ControlDesk gave them."""
    assert dspace.drive == "current_command_A"
    assert dspace.rate_hz == pytest.approx(100, rel=0.01)
    assert dspace.rows_read == round(24.0 / twins.DSPACE_ROW_S)
    assert np.abs(dspace.current_A).max() == pytest.approx(0.75)
    assert 150.0 < np.abs(dspace.speed_rad_s).max() < 200.0


@pytest.mark.slow
def test_the_dspace_motor_s_commands_are_late(dspace: WheelLog) -> None:
    """Dead time, gain and friction."""
    diagnosis, parameters, added = diagnosed(dspace)
    assert diagnosis.verdict["kind"] == "effect"
    assert "transport_delay" in added
    assert added["transport_delay"]["delay_s"]["value"] == pytest.approx(twins.DSPACE_LATE_S, abs=2.0e-3)
    assert parameters["motor_gain"]["value"] == pytest.approx(twins.DSPACE_GAIN, rel=0.03)
    assert parameters["viscous"]["value"] == pytest.approx(twins.DSPACE_VISCOUS, rel=0.03)
    assert parameters["coulomb"]["value"] == pytest.approx(twins.DSPACE_COULOMB, rel=0.1)
