"""The writers of a run, and its metadata."""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path

import pytest

from rw_ekf.errors import BadInputError, ConfigError
from rw_ekf.logs.log_columns import LOG_COLUMNS
from rw_ekf.logs.metadata import RunMetadata, metadata_path, read_metadata, utc_text, write_metadata
from rw_ekf.logs.reader import read_log
from rw_ekf.logs.writer import EstimateWriter, SampleWriter, cell
from rw_ekf.records import (
    Believed,
    Estimate,
    Innovation,
    IssuedCommand,
    Outcome,
    WheelIdentity,
    WheelSample,
    WheelState,
)

MEAN = WheelState(1.0, 15.2, 0.003, 0.58, 0.6)


def test_a_run_reads_back_exactly_while_it_is_written(tmp_path: Path) -> None:
    """Proves that each line is on its way to the disk at once and that every float is the same one."""
    path = tmp_path / "run.csv"
    with SampleWriter(path) as writer:
        writer.write(WheelSample(0.1, 1 / 3, temperature_degC=20.01, status=3), IssuedCommand(0.1 + 0.2, 0.0123))
        writer.write(WheelSample(0.2, None, current_A=float("nan")), IssuedCommand(-0.0))
        log = read_log(path)
    assert path.read_text().splitlines()[0] == ",".join(LOG_COLUMNS)
    assert log.speed_rad_s[0] == 1 / 3
    assert log.current_A[0] == 0.1 + 0.2
    assert log.command_delay_s[0] == 0.0123
    assert log.channels["status"][0] == 3.0
    assert log.warnings == ()


def test_without_a_command_the_current_in_force_is_logged(tmp_path: Path) -> None:
    """Proves that a run that never writes logs what telemetry reports."""
    with SampleWriter(tmp_path / "run.csv") as writer:
        writer.write(WheelSample(0.0, 1.0, current_command_A=0.25), None)
    assert read_log(tmp_path / "run.csv").current_A.tolist() == [0.25]


def test_an_existing_log_is_not_overwritten(tmp_path: Path) -> None:
    """Proves that a second run under the same name is refused and the first log stays."""
    path = tmp_path / "run.csv"
    path.write_text("precious")
    with pytest.raises(BadInputError, match="exists already"):
        SampleWriter(path)
    with pytest.raises(BadInputError, match="cannot be written"):
        SampleWriter(tmp_path / "gone" / "run.csv")
    assert path.read_text() == "precious"


def test_estimates_have_the_columns_of_the_contract(tmp_path: Path) -> None:
    """Proves the order of columns, and that a missing sample has no innovation but a reason."""
    path = tmp_path / "estimates.csv"
    test = Innovation(0.1, 0.41, 0.14, 8.4, 15.1, accepted=True)
    with EstimateWriter(path) as writer:
        writer.write(Estimate(0.1, Outcome.UPDATED, MEAN, MEAN, test))
        writer.write(Estimate(0.2, Outcome.MISSING, MEAN, MEAN))
        with pytest.raises(ValueError, match="6 states for 5 columns"):
            writer.write(Estimate(0.3, Outcome.MISSING, MEAN, MEAN, effects={"drag": Believed(1.0, 2.0)}))
        writer.finish()
    header, first, second = path.read_text().splitlines()
    assert header == (
        "time_s,speed_rad_s,motor_gain,viscous,coulomb,static,std_speed_rad_s,std_motor_gain,std_viscous,std_coulomb,"
        "std_static,innovation_rad_s,innovation_std_rad_s,nis,accepted,reason"
    )
    assert first.endswith(",0.41,0.14,8.4,true,")
    assert second.endswith(",,,,false,missing")


def test_the_state_is_written_now_and_then_and_where_something_begins_or_ends(tmp_path: Path) -> None:
    """Of 50 rows at 10 Hz those every two seconds, the first, the last, a new seed and the row before it are full."""
    path = tmp_path / "estimates.csv"
    with EstimateWriter(path, state_every_s=2.0) as writer:
        for i in range(50):
            outcome = Outcome.RESEEDED if i == 33 else Outcome.FIRST if i == 0 else Outcome.UPDATED
            test = Innovation(0.1 * i, 1 / 3, 1 / 7, 1 / 9, 15.1, accepted=True)
            writer.write(Estimate(0.1 * i, outcome, MEAN, MEAN, test))
            assert len(path.read_text().splitlines()) == 1 + i  # the newest row waits
        writer.finish()
        writer.finish()
    table = [row.split(",") for row in path.read_text().splitlines()[1:]]
    full = [i for i, row in enumerate(table) if row[1]]
    assert full == [0, 20, 32, 33, 49]
    for i, row in enumerate(table):
        assert row[0] == f"{0.1 * i!r}".removesuffix(".0")
        assert all(row[1:11]) == (i in full) == bool(row[12])
        assert (float(row[11]), float(row[13]), row[14]) == (1 / 3, 1 / 9, "false" if i == 33 else "true")


def test_whole_numbers_are_written_short_and_read_back_exactly() -> None:
    """No `.0`; every float, tiny, huge or negative zero, comes back bit for bit."""
    assert (cell(28.0), cell(-0.0), cell(1e16), cell(0.1), cell(True), cell(None)) == (
        "28", "-0", "1e+16", "0.1", "true", ""
    )  # fmt: skip
    for value in (28.0, -0.0, 1e300, 5e-324, 0.1 + 0.2, -123456789.0):
        assert float(cell(value)).hex() == value.hex()


def test_metadata_stand_beside_the_log_and_read_back(tmp_path: Path) -> None:
    """Proves the round trip of first sample, identity, configuration and version."""
    log = tmp_path / "run.csv"
    moment = utc_text(datetime(2024, 5, 6, 7, 8, 9, 123456, tzinfo=UTC))
    made = RunMetadata(
        moment, "sim+in-process", "0.1.0", WheelIdentity(6, 1, 42, 3.5), {"limits": {"current_A": 1e-5}, "x": (1, 2)}
    )
    assert write_metadata(log, made) == metadata_path(log) == tmp_path / "run.meta.yaml"
    again = read_metadata(log)
    assert again is not None
    assert again.first_sample_utc == "2024-05-06T07:08:09.123456Z"
    assert again.identity == made.identity
    assert again.configuration == {"limits": {"current_A": 1e-5}, "x": [1, 2]}


def test_metadata_that_are_missing_or_damaged(tmp_path: Path) -> None:
    """Proves that a log without metadata is fine, and that a damaged file is named."""
    assert read_metadata(tmp_path / "run.csv") is None
    (tmp_path / "run.meta.yaml").write_text("a: 1\n")
    with pytest.raises(ConfigError, match=r"run\.meta\.yaml:1:1: first_sample_utc is missing"):
        read_metadata(tmp_path / "run.csv")
    (tmp_path / "run.meta.yaml").write_text("first_sample_utc: x\nidentity: {colour: red}\n")
    with pytest.raises(ConfigError, match="2:1: identity"):
        read_metadata(tmp_path / "run.csv")
