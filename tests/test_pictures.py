"""The picture of a run."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

from rw_ekf.cli import main
from rw_ekf.log_replay import replay_log
from rw_ekf.logs.picture_file import save_picture
from rw_ekf.logs.wheel_log import WheelLog
from rw_ekf.pictures import run_figure
from tests.truth import run_of


def test_a_replayed_log_becomes_a_png_with_its_curves(tmp_path: Path) -> None:
    """A PNG is written whole, for a wheel and a foreign plant of an odd name, gaps and a rejected reading included."""
    run = run_of("S3", 1)
    speed = run.course.speed_rad_s.copy()
    speed[100:110] = np.nan
    speed[300] += 100.0
    n = speed.size
    log = WheelLog(
        "s3.csv", run.course.time_s, speed, run.current_A, "current_command_A", np.zeros(n), np.zeros(n, np.int64)
    )
    replayed = replay_log(log, with_columns=True)
    assert replayed.columns is not None
    odd = os.fsdecode(b"co$t_{_$ gr\xf6sse.csv")  # a formula that is none, and a byte that is no UTF-8
    for name, wheel_units, title in (("wheel.png", True, ""), ("plant.png", False, odd)):
        path = tmp_path / name
        figure = run_figure(log, replayed.columns, truth={"motor_gain": 15.205}, wheel_units=wheel_units, title=title)
        save_picture(figure, path)
        content = path.read_bytes()
        assert content.startswith(b"\x89PNG\r\n")
        assert content.rstrip().endswith(b"IEND\xaeB`\x82")
        width = int.from_bytes(content[16:20], "big")
        assert width >= 1000
    assert sorted(p.name for p in tmp_path.iterdir()) == ["plant.png", "wheel.png"]


@pytest.mark.parametrize(("name", "begins"), [("a.png", b"\x89PNG"), ("a.SVG", b"<?xml"), ("a.pdf", b"%PDF")])
def test_a_picture_holds_what_its_suffix_says(name: str, begins: bytes, tmp_path: Path) -> None:
    """Each suffix has its own format, in capitals too."""
    save_picture(Figure(), tmp_path / name)
    assert (tmp_path / name).read_bytes().startswith(begins)


@pytest.mark.parametrize(
    "wanted", [("replay", "gone.csv", "--picture"), ("flyby", "--out"), ("spikes", "gone", "--out")], ids=lambda v: v[0]
)
@pytest.mark.parametrize("name", ["x.jpg", "x"])
def test_another_suffix_is_refused_before_any_work(
    wanted: tuple[str, ...], name: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """Every verb that writes a picture names the suffixes that there are, in one sentence, before it reads anything."""
    assert main([*wanted, name]) == 2
    assert capsys.readouterr().err == f"rw-ekf: error: {name}: the name of a picture must end in .png, .svg, .pdf\n"
