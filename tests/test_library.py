"""`import rw_ekf`: what it offers, that it is what the commands do, and that it leaves the program around it alone."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rw_ekf
from rw_ekf.cli import main
from rw_ekf.learning.aged_model import as_given
from rw_ekf.log_replay import replay_log
from rw_ekf.model.state import PARAMETER_NAMES
from rw_ekf.starting_point import setup_of_model
from rw_ekf.wheel.effect_table import NO_EFFECTS
from tests.learning.test_aged_model import learned
from tests.live.bench import ROOT
from tests.wheel.test_model_file import effect

PUBLIC = [
    "Bench", "Comparison", "Diagnosis", "Error", "Estimate", "Estimator", "Fit",
    "GuessedColumns", "Log", "Model", "Run", "__version__",
    "bench", "compare", "diagnose", "fit", "fleet",
    "guess_columns", "read", "replay", "simulate",
]  # fmt: skip


@pytest.fixture(scope="module")
def log() -> rw_ekf.Log:
    """A minute of a simulated wheel with windage."""
    return rw_ekf.simulate("P1", effects=["quadratic_drag"], seed=3, duration_s=120.0)


def stated(capsys: pytest.CaptureFixture[str], *arguments: str) -> str:
    """What a command prints."""
    assert main(list(arguments)) == 0
    return capsys.readouterr().out


def without_times(document: dict[str, object]) -> dict[str, object]:
    return {key: value for key, value in document.items() if key != "seconds"}


def test_the_public_names_are_these() -> None:
    """Nobody adds one, or drops one, without saying so here."""
    assert dir(rw_ekf) == PUBLIC
    for name in PUBLIC:
        assert getattr(rw_ekf, name) is not None
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        getattr(rw_ekf, "nothing")  # noqa: B009


def test_importing_it_loads_nothing_and_sets_nothing() -> None:
    """Neither numpy nor a variable of the linear algebra; the command sets them for its own process."""
    probe = (
        "import os, sys; before = dict(os.environ); import rw_ekf; assert before == dict(os.environ);"
        "print('numpy' in sys.modules, rw_ekf.Error.__name__)"
    )
    unset = {name: value for name, value in os.environ.items() if not name.endswith("_NUM_THREADS")}
    done = subprocess.run(
        [sys.executable, "-c", probe], capture_output=True, text=True, cwd=ROOT, check=True, env=unset
    )
    assert done.stdout.strip() == "False RwEkfError"


def test_its_functions_return_what_the_commands_print(
    log: rw_ekf.Log, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """replay (with rows and without), fit and diagnose of one file: the same document, and the same text."""
    path = str(tmp_path / "log.csv")
    log.save(path)
    same = rw_ekf.read(path)
    for verb, found, more in (
        ("replay", rw_ekf.replay(same), ()),
        ("replay", rw_ekf.replay(same), ("--out", str(tmp_path / "rows.csv"))),
        ("fit", rw_ekf.fit(same, noise=True), ("--noise",)),
        ("diagnose", rw_ekf.diagnose(path), ()),
    ):
        for part in found.document().values():
            if isinstance(part, dict):
                part.clear()  # what is done to a document is not done to what it is of
        document = json.loads(stated(capsys, verb, path, *more, "--json"))
        assert without_times(json.loads(found.to_json())) == without_times(document)
        assert stated(capsys, verb, path, *more) == found.text() + "\n"
        assert Path(path).name in repr(found)
        assert "<pre>" in found._repr_html_()
        assert found.plot().axes if not isinstance(found, rw_ekf.Fit) else True
    found_columns = rw_ekf.guess_columns(path).document()
    assert found_columns == json.loads(stated(capsys, "columns", path, "--json"))
    rows = rw_ekf.read(path, None)
    assert rw_ekf.replay(rows).table.num_rows == len(log)


def test_a_log_of_arrays_is_the_log_of_the_file(log: rw_ekf.Log, tmp_path: Path) -> None:
    """Arrays by keyword, a file, its table: the same numbers; and the rules of a file hold for arrays too."""
    log.save(tmp_path / "log.parquet")
    other = rw_ekf.Log.from_arrays(log.time_s, speed_rad_s=log.speed_rad_s, current_command_A=log.current_A)
    read = rw_ekf.read(tmp_path / "log.parquet")
    for one in (other, read):
        assert np.array_equal(one.speed_rad_s, log.speed_rad_s)
        assert np.array_equal(one.current_A, log.current_A)
    assert read.table.column_names == log.table.column_names
    assert json.loads(other.to_json())["columns"]["time_s"][-1] == log.time_s[-1]
    assert "<table>" in log._repr_html_()
    with pytest.raises(rw_ekf.Error, match="unequal length"):
        rw_ekf.Log.from_arrays([0.0, 1.0], speed_rpm=[1.0], current_A=[0.0, 0.0])
    with pytest.raises(rw_ekf.Error, match="speed_rad_s or speed_rpm is missing"):
        rw_ekf.Log.from_arrays([0.0, 1.0], current_A=[0.0, 0.0])


def test_an_own_loop_is_the_replay_of_its_log(log: rw_ekf.Log, tmp_path: Path) -> None:
    """`Estimator.step` from a model, sample by sample: the rows of a replay that believes the model as a run does."""
    model = rw_ekf.fit(log).model
    model.save(tmp_path / "model.yaml")
    assert rw_ekf.Model.load(tmp_path / "model.yaml").parameters == model.parameters
    constants = setup_of_model(model, 0.1, 0.003, 0.1).constants
    setup = setup_of_model(as_given(model, constants), 0.1, 0.003, 0.1)
    run = replay_log(log, setup=setup, with_columns=True)
    assert run.columns is not None
    estimator = rw_ekf.Estimator(model)
    found = [estimator.step(*row) for row in zip(log.time_s, log.speed_rad_s, log.current_A, strict=True)]
    for name in ("speed_rad_s", *PARAMETER_NAMES):
        for column, values in ((name, [e.mean for e in found]), (f"std_{name}", [e.std for e in found])):
            assert [getattr(v, name) for v in values] == pytest.approx(run.columns[column], rel=1e-9), column
    assert found[-1].friction_torque_rad_s2(30.0).std > 0.0
    with pytest.raises(rw_ekf.Error, match="unknown key gain"):
        rw_ekf.Estimator(gain=(1.0, 1.0))


@pytest.mark.parametrize(
    "wheel", [(14.0, 0.003, 0.54, 0.648), (14.0, 0.0039, 0.5, 0.6), (14.14, 0.003, 0.5, 0.6)],
    ids=["coulomb +8 %", "viscous +30 %", "gain +1 %"],
)  # fmt: skip
def test_an_own_loop_follows_a_wheel_that_has_changed_since_its_model(wheel: tuple[float, ...]) -> None:
    """As a few kelvin change it; where the model was believed to its last digit, by up to 37 of its sigmas wrong."""
    model = rw_ekf.fit(rw_ekf.simulate("P1", wheel=(14.0, 0.003, 0.5, 0.6), seed=1, duration_s=600.0)).model
    log = rw_ekf.simulate("P1", wheel=wheel, seed=2, duration_s=600.0)
    estimator = rw_ekf.Estimator(model)
    for row in zip(log.time_s, log.speed_rad_s, log.current_A, strict=True):
        estimate = estimator.step(*row)
    for name, true in zip(PARAMETER_NAMES, wheel, strict=True):
        assert abs(getattr(estimate.mean, name) - true) < 3.0 * getattr(estimate.std, name), name
    assert estimator.findings == []


def test_an_own_loop_leaves_behind_what_belonged_to_the_record_of_its_model() -> None:
    """A drag that fell on one moment of that log falls on none of this loop, and `findings` says so."""
    model = learned(1.0e-3, effect("drag_spike"))
    plain = rw_ekf.Estimator(replace(model, effects=NO_EFFECTS, covariance=tuple(r[:4] for r in model.covariance[:4])))
    estimator = rw_ekf.Estimator(model)
    for time_s in np.arange(1200, 1300) / 10.0:  # around the onset that it had, 123.4 s
        found, without = (loop.step(float(time_s), 30.0, 0.05) for loop in (estimator, plain))
    assert found.values == without.values
    assert estimator.findings == ["drag_spike belongs to the record it was found in and is not carried into this run"]


def test_what_a_run_and_a_diagnosis_found_is_there_by_name(log: rw_ekf.Log) -> None:
    """Arrays of a run are its table's columns; candidates and probabilities the document's, curves what is drawn."""
    run = rw_ekf.replay(log)
    offset = rw_ekf.simulate("P1", effects=["offset_torque:torque_rad_s2=0.1"], seed=3, duration_s=120.0)
    found = rw_ekf.diagnose(offset)
    assert list(run.estimates) == ["speed_rad_s", *PARAMETER_NAMES]
    for name, values in (*run.estimates.items(), ("innovation_rad_s", run.innovation)):
        assert np.array_equal(values, run.table[name].to_numpy(), equal_nan=True)
    document = found.document()
    assert found.candidates == document["candidates"]
    assert found.probabilities == document["verdict"]["posterior"]
    assert found.verdict["effects"] == ["offset_torque"]
    (curve,) = found.curves
    assert len(curve.x) == len(curve.y) == len(curve.error) > 5
    assert curve.law_x is not None
    assert curve.law_y is not None
    assert len(curve.law_x) == len(curve.law_y) > 5
    still = rw_ekf.Log.from_arrays(log.time_s, speed_rad_s=0.0 * log.speed_rad_s, current_A=log.current_A)
    nothing = rw_ekf.diagnose(still)
    assert (nothing.candidates, nothing.probabilities, nothing.curves) == ([], {}, [])


def test_a_friction_torque_is_told_where_somebody_gave_the_inertia(log: rw_ekf.Log) -> None:
    """In N m it is the inertia times that per unit inertia; a default that nobody gave is refused."""
    assumed = rw_ekf.fit(log).model
    assert assumed.inertia_is_assumed
    with pytest.raises(rw_ekf.Error, match="inertia, which is not known: give the Estimator `inertia_kg_m2`"):
        rw_ekf.Estimator(assumed).step(0.0, 1.0, 0.1).friction_torque()
    known = replace(assumed, inertia_kg_m2=2.0e-3, inertia_is_assumed=False)
    for estimator, inertia in (
        (rw_ekf.Estimator(assumed, inertia_kg_m2=1.0e-3), 1.0e-3),
        (rw_ekf.Estimator(known), 2.0e-3),
        (rw_ekf.Estimator(known, inertia_kg_m2=1.0e-3), 1.0e-3),
        (rw_ekf.Estimator(inertia_kg_m2=1.0e-3), 1.0e-3),
    ):
        estimate = estimator.step(0.0, 1.0, 0.1)
        torque, per_inertia = estimate.friction_torque(30.0), estimate.friction_torque_rad_s2(30.0)
        assert torque == pytest.approx((inertia * per_inertia.value, inertia * per_inertia.std))
    with pytest.raises(rw_ekf.Error, match="inertia_kg_m2 must be above 0"):
        rw_ekf.Estimator(inertia_kg_m2=0.0)


def test_two_models_are_told_apart(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Fits of two logs of one wheel agree; one of a wheel with twice the friction is far off and less likely.

    The command says the same of files, of a run's log, whose model lies beside it, and of a diagnosis's folder.
    """
    plain = [rw_ekf.fit(rw_ekf.simulate("P1", seed=seed, duration_s=120.0)) for seed in (5, 6)]
    same = rw_ekf.compare(plain[0], plain[1])
    assert max(abs(item.sigmas) for item in same.differences) < 4.0
    from rw_ekf.model.state import CK13_STATISTICAL

    rough = CK13_STATISTICAL._replace(coulomb=2.0 * CK13_STATISTICAL.coulomb, static=2.0 * CK13_STATISTICAL.static)
    other = rw_ekf.fit(rw_ekf.simulate("P1", wheel=rough, seed=7, duration_s=120.0))
    third = rw_ekf.simulate("P1", seed=8, duration_s=120.0)
    found = rw_ekf.compare(plain[0], other.model, on=third)
    assert next(item.sigmas for item in found.differences if item.name == "coulomb") < -10.0
    assert found.log_likelihoods is not None
    assert found.log_likelihoods[0] > found.log_likelihoods[1] + 10.0
    assert "the first is likelier" in found.text()
    third.save(tmp_path / "third.csv")
    plain[0].model.save(tmp_path / "run.model.yaml")
    other.model.save(tmp_path / "augmented-model.yaml")
    names = ["compare", str(tmp_path / "run.csv"), str(tmp_path), "--on", str(tmp_path / "third.csv")]
    document = {**found.document(), "log": str(tmp_path / "third.csv")}
    assert json.loads(stated(capsys, *names, "--json")) == document
    assert stated(capsys, *names[:3]).splitlines() == found.text().splitlines()[:-1]


def test_a_bench_is_held_from_a_script_without_a_guard(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Its processes do not run the script again; the document is the command's, the table has its rows."""
    script, short = tmp_path / "script.py", tmp_path / "short.yaml"
    short.write_text(
        "{wheel: {start_rpm: 60.0}, control: {settling_s: 20.0}, cycle: {duration_s: 141.0}}\n", encoding="utf-8"
    )
    script.write_text(
        "import rw_ekf\n"
        "steps = []\n"
        f"found = rw_ekf.bench(schemes=['pid_current', 'dmc'], scenario={str(short)!r}, progress=steps.append)\n"
        "assert len(steps) == 4, steps\n"
        "assert found.table.num_rows == 4\n"
        "print(found.to_json())\n",
        encoding="utf-8",
    )
    done = subprocess.run([sys.executable, str(script)], capture_output=True, text=True, check=False, cwd=ROOT)
    assert done.returncode == 0, done.stderr
    wanted = ("bench", "--scenario", str(short), "--schemes", "pid_current", "dmc", "--json")
    assert json.loads(done.stdout) == json.loads(stated(capsys, *wanted))


def test_the_bench_says_at_once_what_it_will_do(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The first line on standard error, also of a pipe: runs, schemes, and about how long."""
    short = "{wheel: {start_rpm: 60.0}, control: {settling_s: 20.0}, cycle: {duration_s: 141.0}}\n"
    (tmp_path / "short.yaml").write_text(short, encoding="utf-8")
    assert main(["bench", "--scenario", str(tmp_path / "short.yaml"), "--schemes", "pid_current"]) == 0
    first = next(line for line in capsys.readouterr().err.splitlines() if "compiling" not in line)
    assert re.match(r"rw-ekf: bench: 2 runs of 141 s with 1 schemes?, about \d+ s on a desktop computer", first)


def test_what_cannot_be_done_is_an_error_with_the_command_s_sentence(
    log: rw_ekf.Log, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A file that is not there, a profile, an effect, a model: rw_ekf.Error; nothing is printed, nothing exits."""
    for call, match in (
        (lambda: rw_ekf.read(tmp_path / "none.csv"), "no such file"),
        (lambda: rw_ekf.simulate("nothing"), "there is no profile"),
        (lambda: rw_ekf.simulate("P1", effects=["nothing"]), "nothing"),
        (lambda: rw_ekf.replay(log, tmp_path / "none.yaml"), "no such file"),
    ):
        with pytest.raises(rw_ekf.Error, match=match):
            call()
    assert capsys.readouterr() == ("", "")


@pytest.mark.parametrize(
    ("function", "given", "words"),
    [
        ("fit", {"method": "ols"}, "method: invalid choice: 'ols' .choose from 'least-squares', "),
        ("diagnose", {"split": "thirds"}, "split: invalid choice: 'thirds' .choose from 'blocks', "),
        ("bench", {"seeds": 0}, "seeds: 0 is no whole number from 1 to 1000"),
        ("bench", {"seeds": 1.5}, "seeds: 1.5 is no whole number"),
        ("bench", {"schemes": []}, "schemes: none is named; there are pid_current"),
        ("bench", {"schemes": ["nonsense"]}, "^schemes: 'nonsense': there is no such scheme; there are pid_current"),
        ("bench", {"schemes": [3]}, "schemes: names are wanted, in a list; found int 3"),
        ("bench", {"effects": "foo"}, "unknown effect 'foo' in 'foo'"),
        ("simulate", {"effects": [3]}, "effects: names are wanted, in a list; found int 3"),
        ("simulate", {"effects": "foo"}, "unknown effect 'foo' in 'foo'"),
        ("simulate", {"effects": "cubic_drag:coefficient_s_rad2=1e9"}, "beyond all numbers"),
        ("simulate", {"seed": -1}, "seed must be at least 0, found -1"),
        ("simulate", {"seed": 1.5}, "seed must be a whole number, found 1.5"),
        ("simulate", {"duration_s": "10s"}, "duration_s must be a number, found the text '10s'"),
        ("simulate", {"duration_s": 1e12}, "1e.12 s at 10 Hz are no log"),
        ("simulate", {"speed_noise_rpm": np.nan}, "speed_noise_rpm must be a finite number"),
        ("simulate", {"stribeck_speed_rpm": 0}, "stribeck_speed_rpm must be above 0, found 0"),
        ("simulate", {"amplitude_A": "a"}, "amplitude_A must be a number"),
        ("simulate", {"foo": 1}, "unknown key foo"),
        ("simulate", {"wheel": "x"}, "a wheel is its motor_gain, .* found str"),
        ("simulate", {"wheel": (15.0, -1.0, 0.5, 0.6)}, "wheel: viscous must be at least 0"),
        ("read", {"source": "x" * 300 + ".csv"}, "304 characters that are no path: a log is wanted, by its path"),
        ("read", {"source": "time_s,speed\n0,1\n"}, "'time_s,speed.n0,1.n': 17 characters that are no path"),
        ("read", {"source": "https://a.b/c.csv"}, "^https://a.b/c.csv: is an address"),
        ("read", {"source": {"t": [0.0]}, "columns": {"time_s": "t"}}, "a column map is wanted, by its path"),
        ("guess_columns", {"source": 3}, "a log is a path, a table or a mapping of names to arrays; found int"),
        ("fit", {"configuration": {}}, "a configuration is wanted, by its path; found dict"),
        ("fit", {"logs": b"x.csv"}, "a log is wanted, or the path of one; found bytes"),
        ("diagnose", {"effect_file": {}}, "an effect file is wanted, by its path; found dict"),
        ("diagnose", {"progress": 3}, "progress: True, False or a function of a text is wanted; found 3"),
        ("Estimator", {"speed_noise_rpm": 0}, "Estimator: speed_noise_rpm must be above 0, found 0"),
        ("Estimator", {"acceleration_noise_rpm_per_sqrt_s": -1}, "must be at least 0, found -1"),
        ("Estimator", {"period_s": np.inf}, "period_s must be a finite number"),
        ("Estimator", {"coulomb": 0.6}, "coulomb must be a list, found 0.6 .value and std"),
        ("Estimator", {"coulomb": (0.6, -0.1)}, "coulomb.1 must be above 0, found -0.1"),
        ("Estimator", {"coulomb": (np.nan, 0.1)}, "coulomb.0 must be a finite number"),
        ("Estimator", {"speed_rad_s": (1.0, 2.0)}, "unknown key speed_rad_s"),
    ],
)  # fmt: skip
def test_an_argument_that_cannot_be_is_refused_before_any_work(
    log: rw_ekf.Log, function: str, given: dict[str, Any], words: str
) -> None:
    """By one sentence that names it; where the command has it too, by the command's."""
    firsts: dict[str, list[object]] = {"fit": [log], "diagnose": [log], "simulate": ["P1"]}
    with pytest.raises(rw_ekf.Error, match=words):
        getattr(rw_ekf, function)(*(() if "logs" in given else firsts.get(function, [])), **given)


def test_results_are_written_by_a_path_or_not_at_all(log: rw_ekf.Log) -> None:
    """What is none, and a name that no file can have."""
    model = rw_ekf.fit(log).model
    assert model in {model}
    for call in (log.save, model.save, rw_ekf.Model.load):
        with pytest.raises(rw_ekf.Error, match="304 characters that are no path"):
            call("y" * 300 + ".csv")
    for load in (model.save, rw_ekf.Model.load):
        with pytest.raises(rw_ekf.Error, match="by its path; found NoneType"):
            load(None)  # type: ignore[arg-type]


def test_what_a_program_asks_of_numpy_changes_nothing(log: rw_ekf.Log) -> None:
    """An underflow is an error to some; here it is none."""
    with np.errstate(all="raise"):
        found, fit = rw_ekf.diagnose(log), rw_ekf.fit(log)
        assert rw_ekf.compare(fit, fit, on=log).log_likelihoods
        assert rw_ekf.replay(rw_ekf.simulate("P1", duration_s=20.0), fit).table.num_rows == 200
        rw_ekf.Estimator(fit).step(0.0, 1.0e-200, 0.0)
    assert found.to_json() == rw_ekf.diagnose(log).to_json()


def test_a_log_in_which_nothing_moves_has_a_summary(log: rw_ekf.Log) -> None:
    """And one without a speed judges no model, and is no model likelier than itself."""
    still = rw_ekf.Log.from_arrays(log.time_s, speed_rad_s=0.0 * log.speed_rad_s, current_A=log.current_A)
    text = rw_ekf.fit(still).summary().text()
    assert "free run - %, one step ahead - %" in text
    assert "nan" not in text
    fit = rw_ekf.fit(log)
    blind = replace(log, speed_rad_s=np.nan * log.speed_rad_s)
    with pytest.raises(rw_ekf.Error, match="simulated P1: the filter uses none of its readings"):
        rw_ekf.compare(fit, fit, on=blind)
    assert rw_ekf.compare(fit, fit, on=log).text().endswith(": both are as likely")


def test_a_name_or_a_wheel_may_be_given_in_more_than_one_form() -> None:
    """One effect as a text, none as None; a wheel by name, in order, from numpy."""
    short = {"profile": "P1", "duration_s": 20.0}
    drag = rw_ekf.simulate(**short, effects="quadratic_drag").speed_rad_s  # type: ignore[arg-type]
    assert np.array_equal(drag, rw_ekf.simulate(**short, effects=["quadratic_drag"]).speed_rad_s)  # type: ignore[arg-type]
    numbers = (14.0, 0.003, 0.5, 0.6)
    by_name = rw_ekf.simulate(**short, wheel=dict(zip(PARAMETER_NAMES, numbers, strict=True)), effects=None)  # type: ignore[arg-type]
    in_order = rw_ekf.simulate(**short, wheel=numbers, seed=np.int64(0))  # type: ignore[arg-type]
    assert np.array_equal(by_name.speed_rad_s, in_order.speed_rad_s)


@pytest.mark.parametrize(
    ("reading", "conditions", "words"),
    [
        ((np.nan, 1.0, 0.1), {}, "time_s is nan: give a finite number"),
        ((None, 1.0, 0.1), {}, "time_s is None"),
        ((0.3, "1", 0.1), {}, "speed_rad_s is '1': give a finite number, or None where there was none"),
        ((0.3, np.inf, 0.1), {}, "speed_rad_s is inf"),
        ((0.3, 1.0, np.nan), {}, "current_A is nan"),
        ((0.3, 1.0, None), {}, "current_A is None"),
        ((0.3, 1.0, 0.1), {"temperature_degC": "20"}, "temperature_degC is '20'"),
        ((0.3, 1.0, 0.1), {"segment": 0.5}, "segment is 0.5: a whole number is wanted"),
        ((0.3, 1.0, 0.1), {"temperature": 20.0}, "unknown condition temperature; did you mean 'temperature_degC'"),
    ],
)
def test_a_step_that_is_refused_leaves_the_filter_as_it_was(
    reading: tuple[Any, Any, Any], conditions: dict[str, Any], words: str
) -> None:
    """Whatever of it is no number, and the next reading is taken as if it had never been."""
    one, other = rw_ekf.Estimator(), rw_ekf.Estimator()
    for estimator in (one, other):
        for time_s, speed in zip((0.0, 0.1, 0.2), [*np.ma.array([1.0, 9.0], mask=[False, True]), None], strict=True):
            estimator.step(time_s, speed, 0.1)
    with pytest.raises(rw_ekf.Error, match=words):
        one.step(*reading, **conditions)
    assert one.step(0.3, 1.2, 0.1).values == other.step(0.3, 1.2, 0.1).values


@pytest.mark.parametrize(
    "missing",
    [np.float32("nan"), np.float16("nan"), np.array(np.nan), np.array(np.nan, np.float32), np.ma.array(9.0, mask=True)],
)
def test_a_missing_reading_is_missing_whatever_its_type(missing: Any) -> None:
    """NaN of numpy's narrower types and in an array without dimensions, and what is masked there, are as NaN is."""
    one, other = rw_ekf.Estimator(), rw_ekf.Estimator()
    for estimator, gap in ((one, missing), (other, float("nan"))):
        estimator.step(0.0, 1.0, 0.1)
        estimator.step(0.1, gap, 0.1, temperature_degC=gap)
    single: Any = np.array(1.5, np.float32)
    assert one.step(0.2, single, 0.1).values == other.step(0.2, 1.5, 0.1).values


@pytest.mark.parametrize("speed", [np.array([1.0, 2.0]), [1.0], np.array([1.0]), np.nan, np.float32("inf"), "1"])
def test_friction_at_what_is_no_speed_is_refused_in_a_sentence(speed: Any) -> None:
    """Several speeds, NaN or infinity: rw_ekf.Error in place of numbers that are none; one of numpy's is taken."""
    estimate = rw_ekf.Estimator(inertia_kg_m2=1.5e-3).step(0.0, 1.0, 0.1)
    for asked in (estimate.friction_torque_rad_s2, estimate.friction_torque):
        with pytest.raises(rw_ekf.Error, match=r"speed_rad_s is .*: give one finite number"):
            asked(speed)
    one: Any = np.array(2.0)
    assert estimate.friction_torque_rad_s2(one) == estimate.friction_torque_rad_s2(2.0)


def test_a_diagnosis_leaves_what_the_command_leaves(log: rw_ekf.Log, tmp_path: Path) -> None:
    """`report` writes the page into a folder; the model, where there is one, goes on to replay and Estimator."""
    found = rw_ekf.diagnose([log])
    files = found.report(tmp_path)
    assert (tmp_path / "report.html") in files
    for name in ("x.html", "x.PDF"):
        with pytest.raises(rw_ekf.Error, match=f"{name}: a report is a folder, with its page in it as report.html"):
            found.report(tmp_path / name)
        assert not (tmp_path / name).exists()
    assert json.loads((tmp_path / "diagnosis.json").read_text(encoding="utf-8")) == json.loads(found.to_json())
    assert found.table.num_rows == len(log)
    if found.model is not None:
        rw_ekf.replay(log, found)
        rw_ekf.Estimator(found)
    else:
        with pytest.raises(rw_ekf.Error, match="found no model"):
            rw_ekf.replay(log, found)


def test_a_folder_called_drivers_is_in_nobodys_way(tmp_path: Path) -> None:
    """A lab's own package of that name stands first on the path; rw_ekf has its drivers within."""
    (tmp_path / "drivers").mkdir()
    (tmp_path / "drivers" / "__init__.py").write_text("raise SystemExit('the lab's')\n", encoding="utf-8")
    code = f"import sys; sys.path[:0] = [{str(tmp_path)!r}]; import rw_ekf; rw_ekf.simulate('P1', duration_s=20.0)"
    path = os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")])
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", code],
        capture_output=True, text=True, cwd=tmp_path, check=False, env={**os.environ, "PYTHONPATH": path},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr


def test_drivers_of_a_checkout_are_those_of_the_package() -> None:
    """`import drivers` gives the same modules, not second ones whose classes are others."""
    code = (
        "import drivers.sim.faults as one, rw_ekf.drivers.sim.faults as two, sys; assert one is two;"
        "assert sys.modules['drivers'] is sys.modules['rw_ekf.drivers']; print(one.__spec__.name)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=ROOT, check=True)
    assert done.stdout.strip() == "rw_ekf.drivers.sim.faults"


def test_several_logs_are_fitted_as_one(log: rw_ekf.Log) -> None:
    """Twice the readings, each log with its own start; what is no log is an error of the package."""
    both = rw_ekf.fit([log, rw_ekf.simulate("P1", effects=["quadratic_drag"], seed=4, duration_s=120.0)])
    one = rw_ekf.fit(log)
    assert both.samples == 2 * one.samples
    assert both.belief.mean[1] == pytest.approx(one.belief.mean[1], rel=0.01)  # the gain; the first is the speed
    for nothing in ([], [None], 3):
        with pytest.raises(rw_ekf.Error, match="log"):
            rw_ekf.fit(nothing)  # type: ignore[arg-type]
    none: Any
    for judge in (rw_ekf.fit, rw_ekf.diagnose):
        for none in ([], ()):
            with pytest.raises(rw_ekf.Error, match="no log was given: name one, or several of one wheel"):
                judge(none)
        with pytest.raises(
            rw_ekf.Error, match=r"simulated P1, log 2: 1200 of its 1200 rows are rows of log 1, time and"
        ):
            judge([log, log])
    with pytest.raises(rw_ekf.Error, match="a model is wanted"):
        rw_ekf.compare(1, 2)  # type: ignore[arg-type]
