"""Days of a fleet that are diagnosed: which they are, what is found in them, and that nothing is done twice."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rw_ekf
from rw_ekf.cli import main
from rw_ekf.diagnosis.log_diagnosis import diagnose_log
from rw_ekf.diagnosis.result import Diagnosis
from rw_ekf.errors import BadInputError
from rw_ekf.fleet.diagnoses import Diagnosable, diagnose_windows, read_diagnoses, windows_wanted
from rw_ekf.fleet.executors import ProcessExecutor
from rw_ekf.fleet.folder import FleetFolder, fleet_folder
from rw_ekf.fleet.index import built_index, read_index
from rw_ekf.fleet.plan import FleetSettings
from rw_ekf.fleet.wheel_trends import trends_of
from rw_ekf.fleet.window_diagnosis import WindowTask, diagnose_window
from rw_ekf.fleet.windows import Window, windows_of
from rw_ekf.wheel.model_file import read_model
from tests.contract import check_document
from tests.fleet.fleets import run_with
from tests.fleet.test_fleet_run import MODEL
from tests.fleet.test_trends import wheel_days

pytestmark = pytest.mark.xdist_group("fleet")
_EFFECT_FROM = 4  # of the days of the wheel "drags": from then on its drag has a quadratic part


@pytest.fixture(scope="module")
def logs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two wheels over seven days; one gets an undeclared drag on the fifth. Written by the simulator of one wheel."""
    here = tmp_path_factory.mktemp("diagnosed") / "logs"
    for wheel, effect in (("drags", ["quadratic_drag"]), ("sound", [])):
        for day in range(7):
            effects = effect if day >= _EFFECT_FROM else []
            log = rw_ekf.simulate("identification", effects=effects, seed=day)
            (here / wheel).mkdir(parents=True, exist_ok=True)
            log.save(here / wheel / f"2026-03-{day + 1:02d}.parquet")
    return here


def _finding(folder: FleetFolder, executor: Any, *windows: Window, settings: FleetSettings | None = None) -> Any:
    index = read_index(folder)
    assert index is not None
    return diagnose_windows(Diagnosable.of(folder, index, settings or FleetSettings()), (windows, 0), executor)


@pytest.mark.slow
def test_an_undeclared_drag_is_found_on_the_days_that_have_it(logs: Path, executor: Any) -> None:
    """The fleet asks by itself for a day that has it, the diagnosis names it, and the model it leaves can be read.

    Before that day, and on the sound wheel, nothing is found; a second run does nothing.
    """
    folder = fleet_folder(logs)
    run_with(executor, logs)
    wanted, _ = windows_of(rw_ekf.fleet.trends(logs).worst_first, 10)
    assert {window.wheel for window in wanted} == {"drags"}
    assert any(window.day >= f"2026-03-{_EFFECT_FROM + 1:02d}" for window in wanted)
    early = Window("drags", "2026-03-02", "drags/2026-03-02.parquet", "to compare")
    sound = Window("sound", "2026-03-06", "sound/2026-03-06.parquet", "to compare")
    found = _finding(folder, executor, *wanted, early, sound)
    check_document(found.document())
    assert found.whole
    for window in found.windows:
        late = window.wheel == "drags" and window.day > f"2026-03-{_EFFECT_FROM:02d}"
        assert (window.kind, window.effects) == (("effect", ("quadratic_drag",)) if late else ("adequate", ())), window
        if late:
            assert window.model is not None
            assert read_model(folder.path / window.model).effects.size == 1
    again = _finding(folder, executor, *wanted, early, sound)
    assert (again.computed, again.windows) == (0, found.windows)
    assert read_diagnoses(folder)["drags"] == [window for window in found.windows if window.wheel == "drags"]


@pytest.mark.slow
def test_what_was_cut_short_changed_or_failed(logs: Path, tmp_path: Path) -> None:
    """A window without its document is done again to the same bytes, a damaged one too; what cannot be done says why.

    A shorter call forgets nothing of an earlier one. A damaged list is made anew. A log that changed is not looked at
    before its new result, nor are results of other settings, and of the old one nothing is told any more.
    """
    here = tmp_path / "logs"
    (here / "sound").mkdir(parents=True)
    for day in (1, 2):
        name = f"2026-03-{day:02d}.parquet"
        (here / "sound" / name).write_bytes((logs / "sound" / name).read_bytes())
    assert rw_ekf.fleet.run(here, workers=1).whole
    folder = fleet_folder(here)
    windows = [Window("sound", f"2026-03-0{day}", f"sound/2026-03-0{day}.parquet", "asked") for day in (1, 2)]
    with ProcessExecutor(1) as executor:
        first = _finding(folder, executor, *windows)
        path = folder.path / str(first.windows[0].diagnosis)
        before = path.read_bytes()
        path.unlink()
        (folder.path / str(first.windows[1].diagnosis)).write_bytes(before[: len(before) // 2])
        second = _finding(folder, executor, *windows)
        assert (second.computed, second.windows) == (2, first.windows)
        assert path.read_bytes() == before
        (other,) = _finding(folder, executor, replace(windows[0], day="2026-03-09")).windows
        assert other.status == "failed: sound/2026-03-01.parquet: has no row of 2026-03-09"
        assert [each.day for each in read_diagnoses(folder)["sound"]] == ["2026-03-01", "2026-03-02"]
        folder.diagnosed.write_text('{"windows": [{}]}')
        assert read_diagnoses(folder) == {}
        assert main(["fleet", "trends", str(here)]) == 0
        assert _finding(folder, executor, windows[0]).computed == 0
    changed = here / "sound" / "2026-03-02.parquet"
    content = changed.read_bytes()
    changed.write_bytes(content[:500] + bytes(64) + content[564:])
    index = built_index(here, read_index(folder), keep_gone=True)
    wanted = windows_wanted(Diagnosable.of(folder, index, FleetSettings()), rw_ekf.fleet.trends(here).worst_first, 9)
    assert wanted == ([], 0)
    others = Diagnosable.of(folder, index, FleetSettings(columns_text="others"))
    with pytest.raises(BadInputError, match="no result in it is of these logs"):
        windows_wanted(others, [], 9)
    assert not rw_ekf.fleet.run(here, workers=1).whole
    assert [each.day for each in read_diagnoses(folder)["sound"]] == ["2026-03-01"]


@pytest.mark.slow
def test_a_full_disk_is_no_result(logs: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where the model cannot be written there is no document either, so that the next run does the window again."""
    (log,) = (log for log in built_index(logs).logs if log.log == "drags/2026-03-06.parquet")
    task = WindowTask(str(logs), str(tmp_path / "here" / "diagnosis.json"), log, "2026-03-06")

    def no_room(path: Path, text: str, **options: object) -> None:
        raise BadInputError(f"{path}: cannot be written (No space left on device)")

    found: list[Diagnosis] = []

    def diagnosed_once(*wanted: Any) -> Diagnosis:
        found[:] = found or [diagnose_log(*wanted)]
        return found[0]

    monkeypatch.setattr("rw_ekf.diagnosis.log_diagnosis.diagnose_log", diagnosed_once)
    with monkeypatch.context() as full:
        full.setattr("rw_ekf.logs.atomic.write_text", no_room)
        with pytest.raises(BadInputError, match=r"model\.yaml: cannot be written"):
            diagnose_window(task)
    assert list((tmp_path / "here").iterdir()) == []
    assert diagnose_window(task) == "ok"


def test_windows_are_the_days_that_ask() -> None:
    """A step: the day after it and the day before; a day far off; alarms; a residual that is none more often than by
    chance; and each wheel's first before anyone's second."""
    rng = np.random.default_rng(3)
    value = 0.6 + 0.001 * rng.standard_normal(60)
    stepped, far, alarmed = value.copy(), value.copy(), wheel_days(value, 0.001)
    stepped[30:] *= 1.2
    far[20] *= 1.3
    alarmed.alarms[:] = 0.0
    alarmed.alarms[[7, 11]] = 2.0
    noisy, chance = wheel_days(value, 0.001), wheel_days(value, 0.001)
    noisy.not_noise[[3, 40, 50]] = True
    chance.not_noise[5] = True
    all_days = {"S": wheel_days(stepped, 0.001), "F": wheel_days(far, 0.001), "A": alarmed, "N": noisy, "C": chance}
    wheels = trends_of([replace(days, wheel=name) for name, days in all_days.items()], {}).wheels
    found, _ = windows_of(wheels, 100)
    by_wheel = {name: [(each.day, each.why) for each in found if each.wheel == name] for name in all_days}
    day = all_days["S"].day
    assert by_wheel["S"][0] == (day[30], "the first day after a step of motor_gain")
    assert day[29] in [each for each, _ in by_wheel["S"][1:]]
    assert by_wheel["F"] == [(day[20], "motor_gain is far off the days around it")]
    assert by_wheel["A"] == [(day[11], "the watch raised 2 alarms on it")]
    assert by_wheel["N"] == [(day[50], "its residual is no noise, as on 3 of 60 days")]
    assert by_wheel["C"] == []
    few, more = windows_of(wheels, 3)
    assert [window.wheel for window in few] == ["S", "F", "A"]
    assert more == len(found) - 3


def test_wheels_that_are_passed_over_are_named(logs: Path, tmp_path: Path) -> None:
    """One whose results are of no model where it is given one now, and one that has none where the other has."""
    here = tmp_path / "logs"
    for wheel in ("drags", "sound"):
        (here / wheel).mkdir(parents=True)
        (here / wheel / "2026-03-01.parquet").write_bytes((logs / wheel / "2026-03-01.parquet").read_bytes())
    assert rw_ekf.fleet.run(here, workers=1).whole
    reported = rw_ekf.fleet.diagnose(here, workers=1)
    assert (reported.without_results, reported.without_model) == ((), ())
    models = tmp_path / "models"
    models.mkdir()
    MODEL.save(models / "drags.yaml")
    reported = rw_ekf.fleet.diagnose(here, model=models, workers=1)
    check_document(reported.document())
    assert (reported.document()["without_results"], reported.document()["without_model"]) == (["drags"], ["sound"])
    passed, alone = reported.text().splitlines()[-2:]
    assert passed.startswith("  1 wheel (drags) passed over, for no result of theirs is of these settings: `fleet run`")
    assert alone == "  1 wheel (sound) without a model in --model: judged from their first log on"


def test_wrong_words_are_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Nothing run yet; --most of another action; --most 0."""
    for arguments, stated in (
        (["fleet", "diagnose", str(tmp_path)], "has no results yet"),
        (["fleet", "trends", str(tmp_path), "--most", "3"], "--most 3: counts the windows of `fleet diagnose`"),
        (["fleet", "diagnose", str(tmp_path), "--most", "0"], "1 or more"),
    ):
        assert main(arguments) == 2
        assert stated in capsys.readouterr().err


def test_the_command_has_the_document(logs: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A sound wheel asks for nothing: an empty document, and a sentence."""
    here = tmp_path / "logs" / "sound"
    here.mkdir(parents=True)
    for path in sorted((logs / "sound").iterdir()):
        (here / path.name).write_bytes(path.read_bytes())
    assert rw_ekf.fleet.run(tmp_path / "logs", workers=1).whole
    capsys.readouterr()
    assert main(["fleet", "diagnose", str(tmp_path / "logs"), "--workers", "1", "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    check_document(document)
    assert (document["windows"], document["left_out"]) == ([], 0)
    assert (
        rw_ekf.fleet.diagnose(tmp_path / "logs", workers=1).text().endswith("no alarm, residual or trend asks for one")
    )
