"""Logs that no diagnosis can judge, or only in part: each gets a verdict or one clear sentence, never a traceback."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rw_ekf.arrays import Float64Array
from rw_ekf.cli import main
from rw_ekf.drivers.sim.plant_batch import simulate_run
from rw_ekf.drivers.sim.plant_effect_text import parse_effects
from tests.commands.documents import diagnosis_document
from tests.commands.logs import plant_columns, write_columns

Columns = dict[str, Float64Array]
TEN_HZ_S: Float64Array = 0.1 * np.arange(3000, dtype=np.float64)


@dataclass(frozen=True)
class Odd:
    """An odd log: how it is made, the verdict's kind, and words of its sentence."""

    make: Callable[[], Columns]
    kind: str
    words: str = ""


def noise(scale: float = 0.1, seed: int = 1) -> Float64Array:
    """Readings of nothing, (3000,)."""
    return scale * np.random.default_rng(seed).standard_normal(TEN_HZ_S.size)


def still(speed: float | Float64Array, current: float | Float64Array = 0.0) -> Columns:
    """A log of given speeds and currents, whatever any wheel would have done."""
    n = TEN_HZ_S.size
    return {
        "time_s": TEN_HZ_S,
        "speed_rad_s": np.broadcast_to(np.asarray(speed, dtype=np.float64), n),
        "current_command_A": np.broadcast_to(np.asarray(current, dtype=np.float64), n),
    }


def driven(
    time_s: Float64Array, current_A: Float64Array, initial_rad_s: float = 0.0, *effects: str, seed: int = 7
) -> Columns:
    """The driver's plant under any current."""
    run = simulate_run(parse_effects(list(effects)), current_A, time_s, seed=seed, initial_speed_rad_s=initial_rad_s)
    return {"time_s": time_s, "speed_rad_s": run.measured_speed_rad_s, "current_command_A": current_A}


def head(count: int) -> Columns:
    """The first rows of a healthy log."""
    return {name: values[:count] for name, values in plant_columns().items()}


def one_way() -> Columns:
    """A wheel that speeds up and slows down but never turns back."""
    return driven(TEN_HZ_S, 0.1 + 0.03 * np.sin(0.2 * TEN_HZ_S), 50.0)


def once_a_second() -> Columns:
    """A quarter of an hour at 1 Hz."""
    time_s: Float64Array = np.arange(900, dtype=np.float64)
    return driven(time_s, 0.12 * np.sin(0.05 * time_s))


def two_segments() -> Columns:
    """Two runs in one log; time starts again."""
    first, second = head(1500), {name: values[:1500] for name, values in plant_columns("P1", seed=5).items()}
    joined = {name: np.concatenate([first[name], second[name]]) for name in first}
    return joined | {"segment": np.repeat([0.0, 1.0], 1500)}


def riddled() -> Columns:
    """A fifth of every column but the time is missing; the currents are slow, so that holding one over is fair."""
    rng = np.random.default_rng(3)
    columns = plant_columns("P1")
    columns |= {
        "temperature_degC": 20.0 + 0.01 * TEN_HZ_S,
        "angle_rad": np.cumsum(columns["speed_rad_s"]) * 0.1,
        "command_delay_s": np.full(TEN_HZ_S.size, 0.0),
    }
    return {
        name: values if name == "time_s" else np.where(rng.random(values.size) < 0.2, np.nan, values)
        for name, values in columns.items()
    }


def with_gap() -> Columns:
    """Five hundred seconds without a row in the middle."""
    columns = plant_columns()
    return columns | {"time_s": TEN_HZ_S + np.where(TEN_HZ_S >= 150.0, 500.0, 0.0)}


ODD_LOGS = {
    "one row": Odd(lambda: head(1), "insufficient_excitation", "1 speed reading"),
    "50 rows, too short to split": Odd(lambda: head(50), "insufficient_excitation", "50 speed readings"),
    "all samples missing": Odd(lambda: still(np.nan), "insufficient_excitation", "0 speed readings"),
    "constant speed": Odd(lambda: still(100.0, 0.06), "insufficient_excitation", "hardly changes"),
    "constant speed under noise": Odd(lambda: still(100.0 + noise(), 0.06), "insufficient_excitation", "hardly"),
    "speed all zero": Odd(lambda: still(0.0), "insufficient_excitation", "hardly changes"),
    "speed all zero under a strong current": Odd(
        lambda: still(0.0, 0.2 * np.sin(TEN_HZ_S)), "insufficient_excitation", "hardly changes"
    ),
    "held below break-away": Odd(
        lambda: still(noise(), 0.02 * np.sin(TEN_HZ_S)), "insufficient_excitation", "hardly changes"
    ),
    "one direction": Odd(one_way, "adequate"),
    "NaN in every column": Odd(riddled, "adequate"),
    "two segments": Odd(two_segments, "adequate"),
    "1 Hz": Odd(once_a_second, "adequate"),
    "a gap of 500 s": Odd(with_gap, "adequate"),
}


def diagnosed(capsys: pytest.CaptureFixture[str], log: Path, *arguments: str) -> dict[str, Any]:
    """The document of a diagnosis in this process, where every warning is an error."""
    assert main(["diagnose", str(log), *arguments, "--json"]) == 0
    out, errors = capsys.readouterr()
    assert errors == ""
    return diagnosis_document(out)


@pytest.mark.parametrize("name", ODD_LOGS)
def test_an_odd_log_gets_its_verdict_and_its_files(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str
) -> None:
    """Exit status 0, a whole document, the verdict expected with a sentence that says why, and a report of it."""
    odd = ODD_LOGS[name]
    log = write_columns(tmp_path / "log.csv", odd.make())
    document = diagnosed(capsys, log, "--out", str(tmp_path / "out"))
    verdict = document["verdict"]
    assert verdict["kind"] == odd.kind, verdict["statement"]
    assert odd.words in verdict["statement"]
    figures = {*document["before"].values(), *document["after"].values()}
    if odd.kind == "insufficient_excitation":
        assert "rw-ekf excite identification" in verdict["statement"]
        assert figures == {None}
    else:
        assert None not in figures
    assert {"report.html", "diagnosis.json"} <= {path.name for path in (tmp_path / "out").iterdir()}


@pytest.mark.slow
def test_a_coast_down_tells_drag_and_says_that_it_cannot_tell_the_gain(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """No current at all, down from 300 rad/s and back from -300: windage is named, the motor gain is not claimed."""
    effect = "quadratic_drag:coefficient_1_rad=5e-06"
    nothing = np.zeros(1000)
    runs = [  # each with a noise of its own: one that repeats every run is a line of the spectrum
        driven(TEN_HZ_S[:1000], nothing, speed, effect, seed=seed)
        for seed, speed in enumerate((300.0, -300.0, 150.0, -150.0))
    ]
    columns = {name: np.concatenate([run[name] for run in runs]) for name in runs[0]}
    columns["segment"] = np.repeat(np.arange(4.0), 1000)
    document = diagnosed(capsys, write_columns(tmp_path / "coast.csv", columns))
    assert any("motor gain cannot be identified" in text for text in document["warnings"])
    assert document["verdict"]["effects"] == ["quadratic_drag"]
    decisions = {candidate["effect"]: candidate["decision"] for candidate in document["candidates"]}
    for name in ("motor_saturation", "current_deadzone", "transport_delay"):
        assert decisions[name].startswith("not testable: ")


REFUSED: dict[str, tuple[tuple[str, ...], str]] = {
    "a log that is not there": (("nowhere.csv",), "nowhere.csv: no such file"),
    "a directory for a log": ((".",), "is a directory"),
    "a model that is not there": (("log.csv", "--model", "none.yaml"), "none.yaml: no such file"),
    "a model with an unknown effect": (("log.csv", "--model", "magic.yaml"), "magic.yaml:9:13: effects.0.effect must"),
    "a column map that is not there": (("log.csv", "--columns", "none.yaml"), "none.yaml: no such file"),
    "a configuration that is not there": (("log.csv", "--config", "none.yaml"), "none.yaml: no such file"),
    "a file for a directory": (("log.csv", "--out", "log.csv"), "log.csv: cannot be a directory"),
    "a place under a file": (("log.csv", "--out", "log.csv/deeper"), "log.csv/deeper: cannot be a directory"),
    "a place where nobody may write": (("log.csv", "--out", "/proc/diagnosis"), "/proc/diagnosis: cannot be"),
    "a report over its own log": (("report.html", "--out", "."), "report.html: is also read"),
}

MAGIC = """\
schema: rw_ekf.model/1
stribeck: {speed_rad_s: 0.42, law: gauss}
parameters:
  motor_gain: {value: 15.2, std: 0.1}
  viscous: {value: 0.003, std: 0.001}
  coulomb: {value: 0.59, std: 0.01}
  static: {value: 0.6, std: 0.01}
effects:
  - effect: magic
    coefficient: {name: a, value: 1.0, std: 0.1, unit: s}
    constants: {}
covariance:
  - [0.01, 0, 0, 0]
  - [0, 1.0e-6, 0, 0]
  - [0, 0, 1.0e-4, 0]
  - [0, 0, 0, 1.0e-4]
"""


@pytest.mark.parametrize("name", REFUSED)
def test_what_cannot_be_done_is_refused_before_the_work(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    """Status 2, one sentence with the name and what is wrong, the same as a document, and no diagnosis begun."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(
        "rw_ekf.diagnosis.log_diagnosis.diagnose_log", lambda *_, **__: pytest.fail("the work was begun")
    )
    for log in ("log.csv", "report.html"):
        write_columns(tmp_path / log, head(120))
    (tmp_path / "magic.yaml").write_text(MAGIC, encoding="utf-8")
    arguments, expected = REFUSED[name]
    assert main(["diagnose", *arguments, "--json"]) == 2
    out, errors = capsys.readouterr()
    assert json.loads(out)["exit_status"] == 2
    assert expected in errors
    assert errors.startswith("rw-ekf: error: ")
    assert errors.count("\n") == 1
    assert len((tmp_path / "log.csv").read_text(encoding="utf-8").splitlines()) == 121


def test_an_unknown_split_is_wrong_usage(capsys: pytest.CaptureFixture[str]) -> None:
    """--split thirds: status 2, and the choices there are."""
    assert main(["diagnose", "log.csv", "--split", "thirds"]) == 2
    assert "'blocks', 'halves'" in capsys.readouterr().err
