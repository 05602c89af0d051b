"""One screen of a terminal says what a run does, for any width and whatever is missing."""

from __future__ import annotations

import random
from pathlib import Path

import pytest

from rw_ekf.page.text_screen import picture_of, sparkline
from tests.page.runs import RunOnDisk


def test_a_sparkline_rises_with_its_values() -> None:
    """Eight steps from the lowest to the highest, blanks for gaps, no more places than there are."""
    assert sparkline([0, 1, 2, 3, 4, 5, 6, 7], 80) == "▁▂▃▄▅▆▇█"
    assert sparkline([0.0, None, 1.0], 80) == "▁ █"
    assert sparkline([3.0] * 500, 20) == "▁" * 20
    assert sparkline([None], 9) == ""


@pytest.mark.parametrize("width", [40, 80, 120])
def test_the_screen_fits_its_width(width: int) -> None:
    """State and since when, reason, parameters with sigmas and alarms are there; a dead run is called dead."""
    document = {
        "alive": False, "wheel": "w", "port": "/dev/x", "run_state": "TRACKING", "reason": "r" * 300, "link": None,
        "state": {"speed_rad_s": 10.0, "motor_gain": 15.0, "viscous": None}, "std": {"speed_rad_s": 0.1},
        "alarms": [{"text": "it rubs"}], "recent": {"speed_rad_s": list(range(600))},
    }  # fmt: skip
    text = picture_of((document, "x"), width)
    assert max(map(len, text.splitlines())) <= width
    assert "dead" in text
    assert "95.49 +- 0.9549" in text
    assert "ALARM it rubs" in text
    assert "no run of this configuration" in picture_of((None, "x.state.json"), width)
    began = {"began_utc": "2026-11-27T10:20:00.1Z", "since_utc": "2026-11-27T10:20:28.6Z"}
    alive = picture_of(({**document, **began, "alive": True}, "x"), 120)
    assert "TRACKING since 10:20:28 UTC (28.5 s after the run's start)" in alive


def test_watch_once(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """`rw-ekf watch --once` prints the screen of the run of a daemon, `--json` what it has published."""
    import json
    import shutil

    from rw_ekf.cli import main
    from rw_ekf.settings.load import load_configuration
    from rw_ekf.sinks.run_files import state_path

    run = RunOnDisk(tmp_path / "runs")
    run.add(700)
    run.publish()
    shipped = Path(__file__).parents[2] / "config" / "simulated.yaml"
    text = shipped.read_text() + f"\noutput: {{directory: {tmp_path / 'runs'}}}\n"
    config = tmp_path / "w.yaml"
    config.write_text(text)
    place = state_path(load_configuration(str(config)))
    shutil.move(run.folder / "wheel.state.json", place)
    assert main(["watch", "-c", str(config), "--once"]) == 0
    printed = capsys.readouterr().out
    assert "TRACKING since 10:20:28 UTC" in printed
    assert "█" in printed
    assert main(["watch", "-c", str(config), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["run"]["run_state"] == "TRACKING"


def test_one_outlier_leaves_the_innovation_legible() -> None:
    """Thirty seconds of noise and one reading a hundred sigmas off: a mark in its place, all eighths in the others."""
    rng = random.Random(5)
    values = [rng.gauss(0.0, 0.1) for _ in range(300)]
    values[150] = 10.0
    line = sparkline(values, 100, 2.0 * 1.96 * 0.1)
    assert line[50] == "!"
    assert line.count("!") == 1
    assert len(set(line)) > 5
    assert len(set(sparkline(values, 100))) <= 3
