"""One wheel of a file that holds several, asked for by its name: `rw_ekf.read(..., wheel=...)`."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import rw_ekf

_ROWS = 60


def _speed_rad_s(wheel: int) -> rw_ekf.Log:
    """A log of a wheel that is told from another's by its speed."""
    time_s = 0.1 * np.arange(_ROWS)
    return rw_ekf.Log.from_arrays(time_s, speed_rad_s=wheel + np.sin(time_s), current_A=0.1 * np.cos(time_s))


def _influx(*runs: tuple[str, str, int]) -> str:
    """What `output.influx` leaves of runs (wheel, run, number), one file after the other as a server exports them."""
    lines = []
    for wheel, run, number in runs:
        for i in range(_ROWS):
            tags, stamp = f"wheel={wheel},run={run}", 1_800_000_000_000_000_000 + i * 100_000_000
            speed = number + np.sin(0.1 * i)
            lines.append(
                f"rw_ekf_sample,{tags} time_s={0.1 * i},speed_rad_s={speed},current_command_A=0.1,current_A=0.1,"
                f"command_delay_s=0.01,segment=0i {stamp}"
            )
            lines.append(f"rw_ekf_estimate,{tags} time_s={0.1 * i},speed_rad_s={speed},coulomb=0.5 {stamp}")
    return "\n".join(lines) + "\n"


def test_a_wheel_of_an_influx_file_of_several(tmp_path: Path) -> None:
    """By its name, or by its run's where it has several; without a name nobody is guessed."""
    path = tmp_path / "bus.lp"
    path.write_text(_influx(("rw-x", "a_rw-x", 10), ("rw-y", "a_rw-y", 20), ("rw-y", "b_rw-y", 30)))
    assert rw_ekf.read(path, wheel="rw-x").speed_rad_s[0] == 10.0
    assert rw_ekf.read(path, wheel="b_rw-y").speed_rad_s[0] == 30.0
    with pytest.raises(rw_ekf.Error, match="several logs of 'rw-y', 2 groups"):
        rw_ekf.read(path, wheel="rw-y")
    with pytest.raises(rw_ekf.Error, match="nothing in it is of a wheel 'rw'"):
        rw_ekf.read(path, wheel="rw")
    with pytest.raises(rw_ekf.Error):
        rw_ekf.read(path)


def test_a_wheel_of_a_table_with_a_column_that_tells_them_apart(tmp_path: Path) -> None:
    """In a file and in memory the rows are those that `only` of a column map takes; a number is one too."""
    first, second = _speed_rad_s(1), _speed_rad_s(2)
    columns = {
        "time_s": np.repeat(first.time_s, 2),
        "wheel_id": np.tile([1, 2], _ROWS),
        "speed_rad_s": np.ravel(np.column_stack([first.speed_rad_s, second.speed_rad_s])),
        "current_A": np.repeat(first.current_A, 2),
    }
    path, map_path = tmp_path / "two.csv", tmp_path / "map.yaml"
    np.savetxt(path, np.column_stack(list(columns.values())), delimiter=",", header=",".join(columns), comments="")
    map_path.write_text("only: {column: wheel_id, value: 2}\n")
    for log in (rw_ekf.read(path, wheel=2), rw_ekf.read(columns, wheel="2"), rw_ekf.read(path, map_path)):
        np.testing.assert_allclose(log.speed_rad_s, second.speed_rad_s, atol=1e-12)
    with pytest.raises(rw_ekf.Error, match="'wheel_id' holds 1, 2"):
        rw_ekf.read(path, wheel=3)
