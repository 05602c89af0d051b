"""A run of a fleet: by either executor the same bytes, nothing twice, and a change undoes only what depends on it."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from dataclasses import replace
from datetime import UTC, date, datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest

import rw_ekf
from rw_ekf.filter.belief import DEFAULT_PRIOR
from rw_ekf.fleet.between_logs import Carry, first_start, next_start
from rw_ekf.fleet.executors import Done, Executor
from rw_ekf.fleet.folder import fleet_folder
from rw_ekf.fleet.index import built_index
from rw_ekf.fleet.manifest import read_manifest
from rw_ekf.fleet.plan import EVERY_WHEEL, FleetSettings
from rw_ekf.fleet.simulation import FIRST_DAY, FleetShape, truth_of
from rw_ekf.log_replay import replay_log
from rw_ekf.wheel.model_file import WheelModel
from tests.fleet.fleets import make_fleet, run_with, stamps_of, sums_of
from tests.spikes.runs import write_run

pytestmark = pytest.mark.xdist_group("fleet")

MODEL = WheelModel(DEFAULT_PRIOR.parameters, tuple(map(tuple, DEFAULT_PRIOR.parameter_covariance.tolist())), 0.42)


class InThisProcess:
    """An executor for tests that need none: each task when it is asked for."""

    cores = 1

    def __init__(self, most: int | None = None) -> None:
        self._waiting: list[tuple[str, Any, Any]] = []
        self._most = most  # tasks until the power is cut
        self.in_flight_at_most = 0

    def submit(self, key: str, function: Any, argument: Any) -> None:
        self._waiting.append((key, function, argument))
        self.in_flight_at_most = max(self.in_flight_at_most, len(self._waiting))

    def as_completed(self) -> Any:
        done = 0
        while self._waiting:
            if self._most is not None and done == self._most:
                raise KeyboardInterrupt
            key, function, argument = self._waiting.pop(0)
            done += 1
            yield Done(key, function(argument))

    def __enter__(self) -> InThisProcess:
        return self

    def __exit__(self, *rest: object) -> None:
        """Nothing to end."""


@pytest.fixture(scope="module")
def reference(logs: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """What a plain run of the fleet leaves."""
    here = copied(logs, tmp_path_factory.mktemp("reference"))
    assert run_with(InThisProcess(), here).whole
    return sums_of(fleet_folder(here))


@pytest.fixture
def fleet(logs: Path, tmp_path: Path) -> Path:
    """A copy of the logs that a test may change."""
    return copied(logs, tmp_path)


def copied(logs: Path, to: Path) -> Path:
    return Path(shutil.copytree(logs, to / "logs", ignore=shutil.ignore_patterns("fleet")))


def test_both_executors_leave_the_same_bytes(executor: Executor, fleet: Path, reference: dict[str, str]) -> None:
    """A task's result does not depend on who did it, nor on how many at a time; and a second run does nothing."""
    done = run_with(executor, fleet)
    assert (done.computed, done.whole, len(done.entries)) == (9, True, 9)
    folder = fleet_folder(fleet)
    assert sums_of(folder) == reference
    before = stamps_of(folder)
    again = run_with(executor, fleet)
    assert (again.computed, again.whole) == (0, True)
    assert stamps_of(folder) == before


def test_the_estimates_are_the_wheel_s(fleet: Path) -> None:
    """Motor gain and Coulomb friction of the simulated wheels lie within what the results say of themselves."""
    run_with(InThisProcess(), fleet)
    shape = FleetShape(3, 3, seed=4)
    for number in range(3):
        truth = truth_of(shape, number)
        (path, *_) = sorted(fleet_folder(fleet).results.glob(f"wheel={truth.wheel}/day={FIRST_DAY}/*"))
        (row,) = pq.ParquetFile(path).read().to_pylist()
        assert abs(row["motor_gain"] - truth.motor_gain) < 5.0 * row["std_motor_gain"]
        assert row["own_std_coulomb"] < 0.01 * row["own_coulomb"]
        assert row["coulomb"] == pytest.approx(truth.coulomb, rel=0.03)  # 0.3 % from day to day, 8 K of a season
        assert row["nis_mean"] == pytest.approx(1.0, abs=0.1)


@pytest.mark.parametrize("tasks", [0, 1, 2])
def test_what_an_ended_run_left_is_gone_on_from(fleet: Path, reference: dict[str, str], tasks: int) -> None:
    """After an interrupt the rest is done, what stood is not touched, and all is as if nothing had happened."""
    with pytest.raises(KeyboardInterrupt):
        run_with(InThisProcess(tasks), fleet)
    folder = fleet_folder(fleet)
    before = stamps_of(folder)
    assert len(before) == 3 * tasks  # a task is a wheel here
    done = run_with(InThisProcess(), fleet)
    assert done.computed == 9 - len(before)
    assert sums_of(folder) == reference
    assert before.items() <= stamps_of(folder).items()


def test_results_without_a_manifest_are_taken_up(fleet: Path) -> None:
    """The manifest is an account: torn or gone it is made again from the results, which are not computed again."""
    run_with(InThisProcess(), fleet)
    folder = fleet_folder(fleet)
    whole = read_manifest(folder.manifest)
    folder.manifest.write_bytes(folder.manifest.read_bytes()[:-40])
    assert len(read_manifest(folder.manifest)) == 8
    folder.manifest.write_bytes(b"")
    done = run_with(InThisProcess(), fleet)
    assert (done.computed, done.whole) == (0, True)
    assert {key: replace(entry, seconds=None) for key, entry in whole.items()} == read_manifest(folder.manifest)


def test_a_changed_log_undoes_what_follows_of_its_wheel(fleet: Path, reference: dict[str, str]) -> None:
    """The second day of one wheel: that day and the third are new, the first and all other wheels stay."""
    run_with(InThisProcess(), fleet)
    folder = fleet_folder(fleet)
    before = stamps_of(folder)
    changed = fleet / "wheel=W00001" / f"{FIRST_DAY + timedelta(days=1)}.parquet"
    table = pq.ParquetFile(changed).read()
    pq.write_table(table.slice(0, table.num_rows - 100), changed)
    assert run_with(InThisProcess(), fleet).computed == 2
    after = stamps_of(folder)
    assert len(after) == len(before) == 9
    gone = sorted(set(before) - set(after))
    assert [name.split("/")[:2] for name in gone] == [
        ["wheel=W00001", f"day={FIRST_DAY + timedelta(days=day)}"] for day in (1, 2)
    ]
    assert all(after[name] == before[name] for name in set(before) & set(after))


def test_a_result_that_is_lost_is_made_again(fleet: Path, reference: dict[str, str]) -> None:
    """In the middle of a wheel's days too: the very bytes, from the day before, and nothing else."""
    run_with(InThisProcess(), fleet)
    folder = fleet_folder(fleet)
    (lost,) = (folder.results / "wheel=W00002" / f"day={FIRST_DAY + timedelta(days=1)}").iterdir()
    lost.unlink()
    assert run_with(InThisProcess(), fleet).computed == 1
    assert sums_of(folder) == reference


def test_logs_that_are_gone_keep_their_results(fleet: Path, reference: dict[str, str]) -> None:
    """Somebody moved the old logs to tape: what came of them stays, and the next day goes on from it."""
    run_with(InThisProcess(), fleet)
    (fleet / "wheel=W00000" / f"{FIRST_DAY}.parquet").unlink()
    done = run_with(InThisProcess(), fleet)
    assert (done.computed, done.whole) == (0, True)
    assert sums_of(fleet_folder(fleet)) == reference


def test_a_copy_of_a_log_is_not_filtered_twice(fleet: Path, reference: dict[str, str]) -> None:
    """Under another name in the wheel's folder: it is told, and the results are those without it."""
    day = fleet / "wheel=W00000" / f"{FIRST_DAY}.parquet"
    shutil.copy(day, day.with_name(f"{FIRST_DAY}-again.parquet"))
    done = run_with(InThisProcess(), fleet)
    assert done.left_out == (f"wheel=W00000/{FIRST_DAY}-again.parquet: is a copy of wheel=W00000/{FIRST_DAY}.parquet",)
    assert sums_of(fleet_folder(fleet)) == reference


def test_a_changed_model_undoes_the_wheels_that_start_from_it(fleet: Path) -> None:
    """One wheel gets a model of its own: its three days are new; the others' stay. Another version of it: once more."""
    run_with(InThisProcess(), fleet)
    folder = fleet_folder(fleet)
    before = stamps_of(folder)
    own = FleetSettings(models={"W00001": MODEL})
    assert run_with(InThisProcess(), fleet, own).computed == 3
    after = stamps_of(folder)
    assert {name for name in before if name in after} == {name for name in before if "W00001" not in name}
    assert run_with(InThisProcess(), fleet, own).computed == 0
    for_all = FleetSettings(models={"W00001": MODEL, EVERY_WHEEL: replace(MODEL, stribeck_speed_rad_s=0.4)})
    assert run_with(InThisProcess(), fleet, for_all).computed == 6


def test_a_log_that_fails_is_a_row_and_the_run_goes_on(fleet: Path) -> None:
    """A torn file: `failed: ` and why, the days after it go on from the day before it, the rest is untouched."""
    torn = fleet / "wheel=W00001" / f"{FIRST_DAY + timedelta(days=1)}.parquet"
    torn.write_bytes(torn.read_bytes()[:500])
    done = run_with(InThisProcess(), fleet)
    assert not done.whole
    assert [(entry.wheel, entry.day) for entry in done.failed] == [("W00001", "2026-01-02")]
    assert "damaged or incomplete" in done.failed[0].status
    assert str(fleet) not in done.failed[0].status
    (path,) = (fleet_folder(fleet).results / "wheel=W00001" / "day=2026-01-02").iterdir()
    (row,) = pq.ParquetFile(path).read().to_pylist()
    assert row["status"] == done.failed[0].status
    assert row["coulomb"] is None
    assert run_with(InThisProcess(), fleet).failed == done.failed
    assert sum(entry.status == "ok" for entry in done.entries) == 8


def test_a_wheel_goes_on_from_the_day_before(tmp_path: Path) -> None:
    """Two days: the second begins from the first one's belief, wider by the gap; so it knows more than a day alone.

    What a log alone says is the belief less what it began with, against a filter that began from nothing.
    """
    here = make_fleet(tmp_path / "two", wheels=1, days=2, spikes_per_100_days=0.0)
    reported = FleetSettings(models={EVERY_WHEEL: replace(MODEL, speed_noise_rad_s=0.105, acceleration_noise=0.00314)})
    run_with(InThisProcess(), here, reported)
    alone = make_fleet(tmp_path / "one", wheels=1, days=2, spikes_per_100_days=0.0)
    (alone / "wheel=W00000" / "2026-01-01.parquet").unlink()
    run_with(InThisProcess(), alone, reported)

    def second(directory: Path) -> dict[str, Any]:
        (path,) = (fleet_folder(directory).results / "wheel=W00000" / "day=2026-01-02").iterdir()
        (row,) = pq.ParquetFile(path).read().to_pylist()
        return dict(row)

    carried, single = second(here), second(alone)
    assert carried["std_static"] < single["std_static"]
    for name in ("motor_gain", "viscous", "coulomb", "static"):
        assert carried[f"own_{name}"] == pytest.approx(single[name], abs=0.5 * single[f"std_{name}"])
        assert carried[f"own_std_{name}"] == pytest.approx(single[f"std_{name}"], rel=0.2)


def test_a_log_over_midnight_is_two_days(tmp_path: Path) -> None:
    """Its rows of either day stand in that day's partition, the second goes on from the first."""
    here = make_fleet(tmp_path / "logs", wheels=1, days=1)
    folder = here / "wheel=W00000"
    (folder / "2026-01-01.parquet").rename(folder / "2026-01-01T23-55-00Z.parquet")
    done = run_with(InThisProcess(), here)
    assert (done.computed, done.whole) == (1, True)
    rows = {
        path.parent.name: pq.ParquetFile(path).read().to_pylist()[0]
        for path in fleet_folder(here).results.rglob("part-*")
    }
    assert set(rows) == {"day=2026-01-01", "day=2026-01-02"}
    assert [rows[day]["samples"] for day in sorted(rows)] == [3000, pytest.approx(3000, abs=200)]
    assert rows["day=2026-01-02"]["begins_utc"].isoformat() == "2026-01-02T00:00:00+00:00"
    assert run_with(InThisProcess(), here).computed == 0


def test_spikes_that_the_watch_reported_stand_in_the_results(tmp_path: Path) -> None:
    """Of the run's events, on their day; changed events are taken up; nobody watched: no number."""
    write_run(tmp_path / "logs", 0.0, 1.0, [0.1, 0.2])
    write_run(tmp_path / "logs", 1.0, 1.0, [], watched=False)
    assert run_with(InThisProcess(), tmp_path / "logs").whole

    def spikes() -> list[int | None]:
        files = sorted(fleet_folder(tmp_path / "logs").results.rglob("part-*"), key=lambda path: path.parent.name)
        return [pq.ParquetFile(path).read().to_pylist()[0]["spikes"] for path in files]

    assert spikes() == [2, None]
    write_run(tmp_path / "logs", 0.0, 1.0, [0.1, 0.2, 0.3])
    assert run_with(InThisProcess(), tmp_path / "logs").computed == 2
    assert spikes() == [3, None]


def test_a_log_of_another_wheel_under_a_wheel_s_name_is_left_out(tmp_path: Path) -> None:
    """Of three runs in a folder one has another serial number: it is named, and the others are the wheel's."""
    for day, serial in ((0.0, 4), (1.0, 6), (2.0, 4), (3.0, None)):
        write_run(tmp_path / "wheel=A", day, 1.0, [], serial=serial)
    index = built_index(tmp_path)
    assert len(index.logs) == 3
    (stated,) = index.left_out
    assert "is of the wheel with serial number 6, and A has 4" in stated


def test_no_more_than_a_window_is_in_flight(tmp_path: Path) -> None:
    """Four tasks a core, however many wheels there are."""
    here = tmp_path / "logs"
    for number in range(9):
        (here / f"W{number}").mkdir(parents=True)
        (here / f"W{number}" / "2026-01-01.csv").write_text("time_s,speed_rad_s,current_command_A\n0,1,0\n", "ascii")
    executor = InThisProcess()
    done = run_with(executor, here)
    assert executor.in_flight_at_most == 4
    assert len(done.entries) == 9


def test_the_manifest_says_what_was_done(fleet: Path) -> None:
    """A line a log: hashes, version, rows, seconds, status; in the order of wheels and days."""
    run_with(InThisProcess(), fleet)
    lines = [json.loads(line) for line in fleet_folder(fleet).manifest.read_text().splitlines()]
    assert [(line["wheel"], line["day"]) for line in lines] == sorted(
        (f"W0000{number}", str(date(2026, 1, day))) for number in range(3) for day in (1, 2, 3)
    )
    assert {len(line["input_hash"]) for line in lines} == {64}
    assert len({line["model_hash"] for line in lines}) == 1
    assert all(line["rows"] > 5000 and line["seconds"] > 0.0 and line["status"] == "ok" for line in lines)
    assert np.isfinite([line["seconds"] for line in lines]).all()


@pytest.mark.parametrize("is_noisy", [lambda day: day >= 2, lambda day: day < 2], ids=["later", "at first"])
def test_a_day_whose_readings_are_noisier_is_filtered_with_its_own_noise(
    tmp_path: Path, is_noisy: Callable[[int], bool]
) -> None:
    """The readings have five times the noise from a day on, or up to it: none are lost, and every gain holds."""
    more = {"spikes_per_100_days": 0.0, "ageing_share": 0.0, "failing_share": 0.0}
    logs = make_fleet(tmp_path / "fleet", wheels=1, days=5, **more)
    rng = np.random.default_rng(3)
    for day, path in enumerate(sorted(logs.rglob("*.parquet"))):
        if is_noisy(day):
            table = pq.read_table(path)
            speed = table.column("speed_rad_s").to_numpy()
            noisier = speed + 5.0 * np.pi / 30.0 * rng.standard_normal(speed.size)
            pq.write_table(table.set_column(table.column_names.index("speed_rad_s"), "speed_rad_s", [noisier]), path)
    run_with(InThisProcess(), logs)
    rows = [row for path in fleet_folder(logs).results.rglob("part-*") for row in pq.read_table(path).to_pylist()]
    truth = truth_of(FleetShape(1, 5, seed=4, lost_share=0.0, **more), 0).motor_gain
    assert len(rows) == 5
    for row in rows:
        assert row["rejected"] < 0.01 * row["samples"]
        assert 0.8 < row["nis_mean"] < 1.25
        assert abs(row["own_motor_gain"] - truth) < 4.0 * row["own_std_motor_gain"]


def test_a_wheel_that_has_changed_since_its_model_is_followed_from_the_first_day_on() -> None:
    """Coulomb friction 8 % higher than in the model given, as by a few kelvin: 24 sigmas off where that was sure."""
    model = rw_ekf.fit(rw_ekf.simulate("P1", wheel=(14.0, 0.003, 0.5, 0.6), seed=1, duration_s=600.0)).model
    true, begins, carry = (14.0, 0.003, 0.54, 0.648), datetime(2026, 1, 1, tzinfo=UTC), None
    for day in range(2):
        log = rw_ekf.simulate("P1", wheel=true, seed=10 + day, duration_s=600.0)
        start = first_start(log, None, model) if carry is None else next_start(log, None, carry, begins)
        run = replay_log(log, setup=start.setup)
        stds = np.sqrt(np.diag(run.belief.parameter_covariance))
        assert np.all(np.abs(np.array(run.belief.parameters) - true) < 3.0 * stds), day
        carry = Carry(run.model, start.origin, begins + timedelta(seconds=600.0))
        begins += timedelta(days=1)
