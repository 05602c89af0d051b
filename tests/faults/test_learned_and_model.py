"""Row 28: what was learned is gone on from only where it is this wheel's, whole, and of the same start."""

from __future__ import annotations

import os
import re
import shutil
from collections.abc import Callable
from datetime import timedelta
from pathlib import Path
from typing import Any

import pytest
import yaml

from rw_ekf.commands.inputs import wheel_of_logs
from rw_ekf.drivers.sim.plant_parameters import PlantParameters
from rw_ekf.errors import BadInputError
from rw_ekf.filter.belief import DEFAULT_PRIOR
from rw_ekf.learning.learned_file import read_learned
from rw_ekf.log_replay import replay_log, setup_of_run
from rw_ekf.wheel.model_file import read_model
from tests.faults.rig import BEGAN, LineWheel
from tests.live.bench import rw_ekf
from tests.live.daemon import Ran


@pytest.fixture(scope="module")
def first_run(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """A directory in which a wheel has run for three minutes and left what it learned, and a copy to begin from."""
    where = tmp_path_factory.mktemp("wheel")
    LineWheel(where).run(180.0)
    return where, shutil.copytree(where, where.with_name("as_it_was"))


@pytest.fixture
def wheel(first_run: tuple[Path, Path]) -> LineWheel:
    """A wheel that has run for three minutes, and left what it learned."""
    where, as_it_was = first_run
    shutil.rmtree(where)
    shutil.copytree(as_it_was, where)
    return LineWheel(where)


def stated(ran: Ran, event: str) -> list[str]:
    """Sentences of an event."""
    return [context.get("text", "") for name, context in ran.notes.stated if name == event]


def ran_well(ran: Ran) -> bool:
    """Whether the run did what a run does: the wheel was tracked, driven, left at zero, everything written."""
    outcome = ran.outcome
    return (
        outcome.zero_confirmed
        and not outcome.unwritten
        and outcome.state.state.value == "TRACKING"
        and bool(abs(ran.log.current_A).max() > 0.05)
    )


def test_a_restart_goes_on(wheel: LineWheel) -> None:
    """Row 28: the same wheel ten minutes later starts from what was learned, says so, and knows no less afterwards."""
    before = read_learned(wheel.learned)
    ran = wheel.run(60.0, at=before.saved + timedelta(minutes=10))
    (text,) = stated(ran, "learned_continued")
    assert str(wheel.learned) in text
    assert "saved 10 min ago" in text
    start = ran.outcome.setup.prior
    assert start.parameters == before.model.parameters
    assert ran.outcome.start["from"] == "learned"
    assert ran.outcome.start["age_s"] == pytest.approx(600.0, abs=1.0)
    assert ran.outcome.belief.parameter_std.motor_gain < 0.05
    assert stated(ran, "confirming_sign") == []
    assert ran_well(ran)
    assert read_learned(wheel.learned).saved > before.saved


def test_the_start_of_a_run_stands_beside_its_log(wheel: LineWheel) -> None:
    """Row 28: a replay from STEM.start.yaml says what the run said, begun from the configuration or from learning."""
    again = wheel.run(60.0, at=BEGAN + timedelta(hours=9))
    assert again.outcome.start["from"] == "learned"
    for log in sorted(p for p in (wheel.directory / "runs").glob("*_wheel*.csv") if ".estimates" not in p.name):
        assert replay_of(log) < 1e-6


def replay_of(log: Path) -> float:
    """Largest difference of a replay from its own start to the run's model, in sigmas."""
    from rw_ekf.logs.reader import read_log

    done = replay_log(read_log(log), setup=setup_of_run(log))
    reported = read_model(log.with_suffix(".model.yaml"))
    return max(
        abs(a - b) / s
        for a, b, s in zip(done.belief.parameters, reported.parameters, done.belief.parameter_std, strict=True)
    )


def edited(old: str, new: str) -> Callable[[Path], None]:
    """Put one text for another in the file."""

    def change(path: Path) -> None:
        text = path.read_text(encoding="utf-8")
        assert re.search(old, text)
        path.write_text(re.sub(old, new, text, count=1), encoding="utf-8")

    return change


def torn(path: Path) -> None:
    """Half of it is there."""
    content = path.read_bytes()
    path.write_bytes(content[: len(content) // 2])


def directory_instead(path: Path) -> None:
    """A directory stands in its place."""
    path.unlink()
    path.mkdir()
    (path / "file").write_text("of somebody", encoding="utf-8")


def pipe(path: Path) -> None:
    """A pipe that nobody writes to stands in its place."""
    path.unlink()
    os.mkfifo(path)


def dangling(path: Path) -> None:
    """A link to nowhere stands in its place."""
    path.unlink()
    path.symlink_to(path.parent / "nowhere.yaml")


@pytest.mark.parametrize(
    ("spoil", "words"),
    [
        (torn, "valid|changed|missing|must|expected"),
        (lambda path: path.write_bytes(b""), "empty"),
        (lambda path: path.write_bytes(os.urandom(3000)), "UTF-8|YAML"),
        (directory_instead, "directory"),
        (dangling, "no such file"),
        (pipe, "it is a pipe"),
        (edited(r"motor_gain: \{value: [\d.]+", "motor_gain: {value: 15.3"), "was changed after it was written"),
        (edited(r"coulomb: \{value: [\d.]+", "coulomb: {value: 1.0e+09"), "no machine is like that"),
        (edited(r"viscous: \{value: [\d.]+", "viscous: {value: .nan"), "finite"),
        (edited("rw_ekf.model/1", "rw_ekf.model/7"), "this version of rw_ekf reads"),
        (edited("serial_number: 1,", "serial_number: 2,"), "was changed after it was written"),
    ],
    ids=["torn", "empty", "noise", "directory", "link", "pipe", "edited", "bounds", "nan", "schema", "serial"],
)
def test_a_spoilt_file_is_not_gone_on_from(wheel: LineWheel, spoil: Callable[[Path], None], words: str) -> None:
    """Row 28: torn, edited, unreadable or absurd: from the configuration, the reason said, a good run, a good file."""
    path = wheel.learned
    spoil(path)
    ran = wheel.run(70.0, at=BEGAN + timedelta(hours=1))
    (text,) = stated(ran, "learned_not_used")
    assert "the run starts from the configuration" in text
    assert re.search(words, text)
    assert str(path) in text or "learned" in text
    assert ran.outcome.start["from"] == "configuration"
    assert ran.outcome.start["learned_not_used"] in text
    assert ran.outcome.setup.prior.parameters == DEFAULT_PRIOR.parameters
    assert ran_well(ran)
    assert read_learned(path).model.parameters.motor_gain == pytest.approx(15.205, rel=0.01)
    assert os.path.lexists(ran.outcome.files.replaced)


@pytest.mark.skipif(os.geteuid() == 0, reason="root reads every file")
def test_a_file_that_may_not_be_read_is_not_gone_on_from(wheel: LineWheel) -> None:
    """Row 28: no permission: from the configuration, said."""
    wheel.learned.chmod(0)
    ran = wheel.run(20.0)
    assert "cannot be read" in stated(ran, "learned_not_used")[0]


def test_another_wheel_starts_afresh_and_loses_nothing(wheel: LineWheel) -> None:
    """Row 28: serial number 2 in the same place: from the configuration, moved first, and the other's file is kept."""
    before = wheel.learned.read_text(encoding="utf-8")
    other = LineWheel(wheel.directory, PlantParameters(motor_gain=12.0), serial_number=2)
    ran = other.run(90.0, at=BEGAN + timedelta(hours=1))
    (text,) = stated(ran, "learned_not_used")
    assert "it is of the wheel with serial number 1, and serial number 2 answers" in text
    assert len(stated(ran, "confirming_sign")) == 1
    assert ran_well(ran)
    assert ran.outcome.files.replaced.read_text(encoding="utf-8") == before
    now = read_learned(wheel.learned)
    assert now.wheel.serial_number == 2
    assert now.model.parameters.motor_gain == pytest.approx(12.0, rel=0.02)


@pytest.mark.parametrize(
    ("section", "change"),
    [
        ("filter", {"prior": {"motor_gain": {"value": 15.0, "std": 1.0}}}),
        ("filter", {"speed_noise_rpm": 2.0}),
        ("wheel", {"stribeck_speed_rpm": 5.0}),
    ],
)
def test_another_start_is_another_learning(wheel: LineWheel, section: str, change: dict[str, Any]) -> None:
    """Row 28: prior, noise or Stribeck curve changed: the learning is left; the wheel's sign is known all the same."""
    ran = wheel.run(30.0, at=BEGAN + timedelta(hours=1), **{section: change})  # type: ignore[arg-type]
    assert "is another than it began from" in stated(ran, "learned_not_used")[0]
    assert stated(ran, "confirming_sign") == []
    assert ran_well(ran)


def test_fresh_and_the_key_and_a_model_go_before_what_was_learned(wheel: LineWheel) -> None:
    """Row 28: --fresh, filter.continue_learned false and --model each start elsewhere and say why."""
    model = next((wheel.directory / "runs").glob("*.model.yaml"))
    later = BEGAN + timedelta(hours=1)
    for ran, words in (
        (wheel.run(20.0, at=later, fresh=True), "--fresh"),
        (wheel.run(20.0, at=later, filter={"continue_learned": False}), "filter.continue_learned is false"),
        (wheel.run(20.0, at=later, named=str(model)), "--model was given"),
    ):
        assert words in ran.outcome.start["learned_not_used"]
        assert ran.outcome.start["from"] == ("model" if "model" in words else "configuration")
        assert ran_well(ran)


def test_a_short_test_does_not_replace_what_was_learned(tmp_path: Path) -> None:
    """Row 28: ten minutes stand against six seconds of --fresh; five minutes of it replace them and keep them aside."""
    wheel = LineWheel(tmp_path)
    first = wheel.run(600.0)
    before = wheel.learned.read_bytes()
    later = BEGAN + timedelta(minutes=11)
    short = wheel.run(6.0, at=later, fresh=True)
    assert wheel.learned.read_bytes() == before
    assert "knows the wheel much less well" in sentence_about(short, "learned_not_kept")
    assert wheel.run(10.0, at=later).outcome.start["from"] == "learned"
    long = wheel.run(300.0, at=later, fresh=True)
    assert read_learned(wheel.learned).model.source["log"] == long.outcome.files.log.name
    assert long.outcome.files.replaced.exists()
    assert first.outcome.model == first.outcome.files.model


def test_a_run_that_learned_nothing_leaves_no_model(tmp_path: Path) -> None:
    """Row 28: a wheel at rest for a minute: its log, no model, and nothing to go on from."""
    wheel = LineWheel(tmp_path)
    ran = wheel.run(60.0, command={"profile": "zero"})
    assert ran.outcome.model is None
    assert not ran.outcome.files.model.exists()
    assert not list((tmp_path / "runs").glob("*.learned.yaml"))
    assert "learned nothing" in sentence_about(ran, "learned_not_kept")


def sentence_about(ran: Ran, event: str) -> str:
    """The reason that was given with an event."""
    return next(str(context["reason"]) for name, context in ran.notes.stated if name == event)


def test_an_old_learning_is_believed_less(wheel: LineWheel) -> None:
    """Row 28: after a year the gain is taken over with a sigma of a tenth of it, not with that of yesterday."""
    saved = read_learned(wheel.learned)
    ran = wheel.run(1.0, at=saved.saved + timedelta(days=365))
    began = ran.outcome.setup.prior
    assert began.parameter_std.motor_gain == pytest.approx(0.094 * began.parameters.motor_gain, rel=0.05)
    assert "365 days" in stated(ran, "learned_continued")[0]
    future = wheel.run(1.0, at=BEGAN - timedelta(days=30))
    assert "in the future" in stated(future, "learned_continued")[0]
    assert future.outcome.setup.prior.parameter_std.motor_gain > 0.09 * 15.0


def test_what_changed_while_nobody_watched_is_not_believed_away(wheel: LineWheel) -> None:
    """Row 28: a night later viscous friction is a fifth higher: within five minutes the estimate is within 4 sigma."""
    colder = LineWheel(wheel.directory, PlantParameters(viscous=1.2 * 0.00322), speed_rad_s=100.0)
    ran = colder.run(300.0, at=BEGAN + timedelta(hours=12))
    assert ran.outcome.start["from"] == "learned"
    belief = ran.outcome.belief
    assert abs(belief.parameters.viscous - 1.2 * 0.00322) < 4.0 * belief.parameter_std.viscous
    assert 0.8 < (ran.outcome.statistics.innovation_document()["nis_mean"] or 0.0) < 1.2


def test_a_model_of_another_wheel_does_not_drive(wheel: LineWheel) -> None:
    """Row 28: refused in one sentence, zero alone written; --other-wheel drives; a run that never writes has a note."""
    model = str(next((wheel.directory / "runs").glob("*.model.yaml")))
    other = LineWheel(wheel.directory, serial_number=2)
    hows: list[dict[str, Any]] = [{"named": model}, {"filter": {"model": model}}]
    for how in hows:
        with pytest.raises(BadInputError, match=r"serial number 1, and serial number 2 answers.*--other-wheel"):
            other.run(10.0, **how)
    assert set(other.written_A) <= {0.0}
    driven = other.run(10.0, named=model, other_wheel=True)
    assert len(stated(driven, "model_of_another_wheel")) == 1
    assert driven.outcome.start["from"] == "model"
    assert ran_well(driven)
    beside = other.run(10.0, named=model, command={"profile": "none"})
    assert len(stated(beside, "model_of_another_wheel")) == 1


def test_what_fit_and_diagnose_make_of_a_log_is_its_wheel_s(wheel: LineWheel) -> None:
    """Row 28: run, fit or diagnose, run: the model in between says whose it is; of logs of two wheels nobody's."""
    (log,) = (p for p in (wheel.directory / "runs").glob("*_wheel.csv"))
    out = wheel.directory / "fitted.yaml"
    done = rw_ekf("fit", str(log), "--out", str(out), timeout=300)
    assert done.returncode == 0, done.stderr
    tag = read_model(out).wheel
    assert tag == read_learned(wheel.learned).wheel
    with pytest.raises(BadInputError, match="serial number 1, and serial number 2 answers"):
        LineWheel(wheel.directory, serial_number=2).run(5.0, named=str(out))
    LineWheel(wheel.directory, serial_number=2).run(5.0, output={"directory": str(wheel.directory / "others")})
    (other,) = (wheel.directory / "others").glob("*_wheel.csv")
    assert wheel_of_logs([str(log)]) == tag
    assert wheel_of_logs([str(log), str(other)]) is None
    assert wheel_of_logs([str(log), str(out)]) is None


def test_a_model_that_names_no_wheel_is_taken_with_a_note(wheel: LineWheel) -> None:
    """Row 28: a model of before, or of a fit to a foreign log: taken, said."""
    path = next((wheel.directory / "runs").glob("*.model.yaml"))
    document = yaml.safe_load(path.read_text(encoding="utf-8"))
    assert document.pop("wheel")["serial_number"] == 1
    path.write_text(yaml.safe_dump(document), encoding="utf-8")
    ran = wheel.run(10.0, named=str(path))
    assert "does not say which wheel it is of" in stated(ran, "model_of_unknown_wheel")[0]
    assert ran_well(ran)


def test_a_belief_out_of_bounds_replaces_no_good_file(wheel: LineWheel) -> None:
    """Row 28: a wheel whose gain is another by ten is not learned in silence: said, and the good file stays."""
    before = wheel.learned.read_text(encoding="utf-8")
    strange = LineWheel(
        wheel.directory, PlantParameters(motor_gain=152.05, coulomb=5.863, static=6.037), speed_rad_s=20.0
    )
    ran = strange.run(120.0, at=BEGAN + timedelta(hours=1))
    assert "odd_gain" in ran.notes.events
    assert "learned_not_kept" in ran.notes.events
    assert wheel.learned.read_text(encoding="utf-8") == before
    assert ran.outcome.start["sign_confirmed"] is False
