"""Wherever a log is read, one in parts, some of them compressed, is the log that it was written as."""

from __future__ import annotations

import gzip
import json
from pathlib import Path

import numpy as np
import pytest

from rw_ekf.cli import main
from rw_ekf.control.commanders import logged_profile
from rw_ekf.logs.part_compression import pack
from rw_ekf.logs.parts import part_path
from rw_ekf.logs.reader import read_log
from rw_ekf.settings.load import load_configuration
from tests.commands.logs import profile_log


@pytest.fixture(scope="module")
def logs(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """The same log in one file, and in three parts: zstd, gzip and plain."""
    directory = tmp_path_factory.mktemp("parts")
    whole = profile_log(directory / "whole.csv", samples=3000)
    header, *rows = whole.read_bytes().splitlines(keepends=True)
    first = directory / "run.csv"
    for number, share in enumerate((rows[:900], rows[900:2100], rows[2100:]), start=1):
        part_path(first, number).write_bytes(b"".join([header, *share]))
    second = part_path(first, 2)
    second.with_name(f"{second.name}.gz").write_bytes(gzip.compress(second.read_bytes()))
    second.unlink()
    pack(first)
    return whole, first


@pytest.mark.parametrize("verb", ["replay", "fit", "diagnose"])
def test_verbs_say_the_same_of_a_log_in_parts(
    logs: tuple[Path, Path], verb: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """Their documents differ in the log's name and in nothing else but seconds."""
    documents = []
    for log in logs:
        assert main([verb, str(log), "--json"]) == 0
        document = json.loads(capsys.readouterr().out.replace(log.name, "LOG"))
        document.pop("seconds", None)
        documents.append(document)
    assert documents[0] == documents[1]


def test_export_joins_the_parts(logs: tuple[Path, Path], tmp_path: Path) -> None:
    """One file comes out that reads as the whole."""
    whole, first = logs
    assert main(["export", str(first), str(tmp_path / "joined.parquet")]) == 0
    joined, log = read_log(tmp_path / "joined.parquet"), read_log(whole)
    assert np.array_equal(joined.time_s, log.time_s)
    assert np.array_equal(joined.speed_rad_s, log.speed_rad_s, equal_nan=True)


def test_a_logged_profile_is_repeated_from_all_parts(logs: tuple[Path, Path], tmp_path: Path) -> None:
    """A configuration takes the run's name, though its first part is compressed; the currents are the whole's."""
    whole, first = logs
    config = tmp_path / "wheel.yaml"
    config.write_text(
        f"wheel: {{port: /dev/null}}\nlimits: {{current_A: 0.6}}\ncommand: {{profile: log, log: {first}}}\n",
        encoding="utf-8",
    )
    assert load_configuration(config).command.log == str(first)
    parts, one = logged_profile(str(first)), logged_profile(str(whole))
    times = np.arange(0.0, 299.0, 0.37)
    assert [parts.current_A(t) for t in times] == [one.current_A(t) for t in times]
