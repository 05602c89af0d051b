"""A misread log is named with the line of the map that mends it, by every verb, and no healthy log is accused."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from rw_ekf.cli import main
from rw_ekf.errors import LogError
from rw_ekf.identify.misread import misreadings_and_questions
from rw_ekf.logs.reader import read_log
from tests.identify.misread_logs import HEALTHY, MACHINES, MISREADINGS, WHEEL, healthy, misread, motion, write

# What shows in machines of any size; units by size alone only where they would make a wheel of it.
OF_ANY_SIZE = ("sign", "ms", "us", "int16 speed", "clock back", "set-point", "reversed, no time", "swapped")


def sentence_about(log: Path, columns: Path | None) -> str:
    try:
        read = read_log(log, columns)
        found, wanted = misreadings_and_questions(read)
        return " ".join(found or wanted)
    except LogError as error:
        return str(error)


@pytest.mark.parametrize("how", MISREADINGS)
def test_a_misread_log_of_a_wheel_is_named_with_the_line_that_mends_it(how: str, tmp_path: Path) -> None:
    """Each way of misreading is said in one sentence that holds the line of the map."""
    stated = sentence_about(*misread(tmp_path / "log.csv", how, WHEEL, 21))
    assert all(line in stated for line in MISREADINGS[how]), stated
    assert "\n" not in stated


@pytest.mark.parametrize("how", OF_ANY_SIZE)
def test_a_misread_log_of_a_machine_of_another_size_is_named(how: str, tmp_path: Path) -> None:
    """What the motion shows does not depend on the size: a motor with 70 rad/s^2/A that settles in half a second."""
    stated = sentence_about(*misread(tmp_path / "log.csv", how, MACHINES["small motor"], 22))
    assert all(line in stated for line in MISREADINGS[how]), stated


@pytest.mark.parametrize(("name", "kind"), HEALTHY)
def test_a_healthy_log_is_not_accused(name: str, kind: str, tmp_path: Path) -> None:
    """Machines of six sizes, one way, coasting, braking, hardly driven: nothing is said."""
    assert sentence_about(*healthy(tmp_path / "log.csv", name, kind, 23)) == ""


@pytest.mark.parametrize(
    "how", ["sign", "int16 speed", "int16 current", "unsigned current", "reversed", "iso clock back"]
)
def test_the_line_that_is_said_mends_the_log(how: str, tmp_path: Path) -> None:
    """With that line in the map, and nothing else changed, nothing is said any more."""
    log, columns = misread(tmp_path / "log.csv", how, WHEEL, 24)
    assert columns is not None
    line = sentence_about(log, columns).split("`")[1]
    old = {"rate_hz": "time_s", "reverse": "-"}.get(line.split(":")[0], line.split(":")[0])
    kept = [text for text in columns.read_text().splitlines() if not text.startswith(old)]
    columns.write_text("\n".join([*kept, line]) + "\n")
    assert sentence_about(log, columns) == ""


def test_no_verb_builds_on_a_log_with_a_sign_turned(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """All three verbs say the same line; diagnose gives no verdict, and fit writes no model."""
    log, columns = misread(tmp_path / "log.csv", "sign", WHEEL, 25)
    line, model = MISREADINGS["sign"][0], tmp_path / "model.yaml"
    common = [str(log), "--columns", str(columns), "--json"]
    assert main(["replay", *common]) == 0
    assert line in json.loads(capsys.readouterr().out)["logs"][0]["warnings"][0]
    assert main(["fit", *common, "--out", str(model)]) == 1
    assert line in json.loads(capsys.readouterr().out)["warnings"][0]
    assert not model.exists()
    assert main(["diagnose", *common, "--out", str(tmp_path / "report")]) == 0
    document = json.loads(capsys.readouterr().out)
    assert document["verdict"]["kind"] == "insufficient_excitation"
    assert line in document["verdict"]["statement"]
    page = (tmp_path / "report" / "report.html").read_text()
    assert "Mend the column map" in page
    assert "excite identification" not in page


def test_lost_rows_and_rows_out_of_order_are_no_clock_that_was_set(tmp_path: Path) -> None:
    """A pause in which the wheel went on, a row that came late and a clock that began anew are something else."""
    m = motion(WHEEL, "steps", 26)
    columns = {"time_s": m.t, "speed_rad_s": m.reading, "current_A": m.drive}
    there = (m.t < 100.0) | (m.t > 104.0)
    assert sentence_about(*write(tmp_path / "lost.csv", {name: v[there] for name, v in columns.items()})) == ""
    order = np.arange(m.t.size)
    order[[700, 701]] = 701, 700
    assert sentence_about(*write(tmp_path / "late.csv", {name: v[order] for name, v in columns.items()})) == ""
    anew = columns | {"time_s": np.where(m.t < 120.0, m.t, m.t - 120.0)}
    assert "segment" in sentence_about(*write(tmp_path / "anew.csv", anew))
