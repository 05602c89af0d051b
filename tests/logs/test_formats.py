"""The registry of formats: what it lists, and that nothing of one is loaded for another."""

from __future__ import annotations

import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from rw_ekf.logs.column_map_file import load_column_map
from rw_ekf.logs.formats import listed

LIBRARIES = ("asammdf", "can", "cantools", "h5py", "mcap", "nptdms", "pandas", "python_calamine", "pyulog", "rosbags")


def test_formats_are_listed_with_what_they_need(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each line has a name, a rule, an extra that pyproject.toml has, and whether it is installed."""
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None if name == "pyulog" else object())
    lines = [line.split() for line in listed().splitlines()]
    assert lines[0] == ["format", "recognised", "by", "extra", "installed"]
    assert all(len(line) > 3 for line in lines)
    assert (lines[1][0], lines[-1][0]) == ("parquet", "csv")
    found = {line[0]: line[-2:] for line in lines}
    assert (found["ulog"], found["mdf"], found["lvm"]) == (["ulog", "no"], ["mdf", "yes"], ["-", "yes"])
    project = tomllib.loads((Path(__file__).parents[2] / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    extras = {line[-2] for line in lines[1:]} - {"-"}
    assert extras <= set(project["optional-dependencies"])
    assert project["optional-dependencies"]["logs"] == [f"rw-ekf[{','.join(sorted(extras))}]"]


def test_a_plain_log_loads_no_library(tmp_path: Path) -> None:
    """Reading CSV imports none of the libraries that other formats need."""
    path = tmp_path / "a.csv"
    path.write_text("time_s,speed_rad_s,current_A\n0,1,2\n1,1,2\n")
    code = "import sys; from rw_ekf.logs.reader import read_log; read_log(sys.argv[1]); print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", code, str(path)], capture_output=True, text=True, check=True)
    assert set(done.stdout.split()) & set(LIBRARIES) == set()


def test_the_database_is_beside_the_map(tmp_path: Path) -> None:
    """`dbc` is taken from where the map is, not from where the program runs."""
    path = tmp_path / "map.yaml"
    path.write_text("dbc: sub/wheel.dbc\n")
    assert load_column_map(path).dbc == str(tmp_path / "sub" / "wheel.dbc")
