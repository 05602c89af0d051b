"""`rw-ekf export`: a log in another format is the same log."""

from __future__ import annotations

import itertools
import os
from pathlib import Path

import numpy as np
import pytest

from rw_ekf.cli import main
from rw_ekf.logs.reader import read_log
from tests.commands.logs import CARRIAGE_MAP, carriage_log, profile_log
from tests.live.bench import document_of, rw_ekf

LATIN = os.fsdecode(b"gr\xf6sse")  # a name that is no text where names are UTF-8


@pytest.mark.parametrize("chain", list(itertools.permutations([".csv", ".parquet", ".mat"], 2)))
def test_a_log_survives_two_conversions(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], chain: tuple[str, str]
) -> None:
    """Through any two formats every number comes back to the last bit."""
    first = profile_log(tmp_path / "first.csv", samples=500)
    paths = [str(first)]
    for number, suffix in enumerate(chain):
        paths.append(str(tmp_path / f"copy{number}{suffix}"))
        assert main(["export", paths[-2], paths[-1], "--json"]) == 0
        document = document_of(capsys.readouterr().out)
        assert (document["schema"], document["samples"], document["out"]) == ("rw_ekf.export/1", 500, paths[-1])
    one, two = read_log(first), read_log(paths[-1])
    for name in ("time_s", "speed_rad_s", "current_A", "segment", "command_delay_s"):
        assert np.array_equal(getattr(one, name), getattr(two, name)), name
    assert two.drive == "current_command_A"


def test_a_foreign_log_is_exported_under_the_contract_s_names(tmp_path: Path) -> None:
    """After export no column map is needed any more."""
    log, columns, out = carriage_log(tmp_path / "c.csv"), tmp_path / "map.yaml", tmp_path / "c.parquet"
    columns.write_text(CARRIAGE_MAP, encoding="utf-8")
    assert main(["export", str(log), str(out), "--columns", str(columns)]) == 0
    assert np.array_equal(read_log(out).current_A, read_log(log, columns).current_A)


@pytest.mark.parametrize("suffix", [".csv", ".parquet", ".mat"])
def test_a_name_in_another_encoding_names_that_very_file(tmp_path: Path, suffix: str) -> None:
    """Whatever bytes a name has, the table goes into the file of that name, none beside it, and is read from there."""
    log, place = profile_log(tmp_path / "log.csv", samples=300), tmp_path / LATIN
    place.mkdir()
    out, rows = place / f"{LATIN}{suffix}", place / f"rows{LATIN}{suffix}"
    assert main(["export", str(log), str(out)]) == 0
    assert main(["replay", str(out), "--out", str(rows)]) == 0
    assert sorted(place.iterdir()) == sorted([out, rows])
    assert np.array_equal(read_log(out).speed_rad_s, read_log(log).speed_rad_s)
    assert rows.stat().st_size > out.stat().st_size


def test_such_a_name_is_printed_and_stands_in_a_table(tmp_path: Path) -> None:
    r"""On a strict standard output, and in the first column of several logs, the foreign byte stands as \udcf6."""
    logs = [profile_log(tmp_path / f"{name}.csv", samples=300) for name in ("a", LATIN)]
    out = tmp_path / f"{LATIN}.out.csv"
    strict = {**os.environ, "PYTHONIOENCODING": "utf-8:strict"}
    done = rw_ekf("export", str(logs[1]), str(out), env=strict)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout == f"{tmp_path}/gr\\udcf6sse.out.csv: 300 samples\n"
    assert main(["replay", *map(str, logs), "--out", str(out)]) == 0
    assert f'"{tmp_path}/gr\\udcf6sse.csv",' in out.read_text(encoding="utf-8").splitlines()[-1]
