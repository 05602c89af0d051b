"""What a fleet costs and what it finds, as ratios from one run.

    python -m tools.measure.fleet [--what overhead dask many memory trends remaining rate year]

overhead: wall time of `run_fleet` with two worker processes over that of a plain loop of the same replays, halved.
dask: processor time of a Dask cluster of two workers, client and scheduler included, over that of the plain loop.
many: most resident memory of a Dask scheduler, and of the client, over 10,000 wheels with a log of a minute each.
memory: resident memory of a worker after 50 and after 500 parts.
trends: ageing wheels (Coulomb friction +0.5 % a month over a year) among 200 that are found, healthy ones that are
accused, at the level of daily estimates; and how wide the bands of the rates are against what they miss by.
remaining: how often a limit is reached before and after the band of nine in ten, where wheels wear and wander.
rate: samples a second from Parquet, 2 workers, logs of a day at 10 Hz.
year: six wheels over a year, a log of ten minutes a day, one ageing by 0.5 % of Coulomb friction a month, through the
whole chain by its commands: what is found of each, and the workers' memory as it goes.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from datetime import date
from pathlib import Path
from typing import Any

import dask
import distributed
import numpy as np

from rw_ekf.fleet.between_logs import Carry, first_start, next_start
from rw_ekf.fleet.daily import WheelDays
from rw_ekf.fleet.dask_executor import DASK_SETTINGS, DaskExecutor
from rw_ekf.fleet.executors import ProcessExecutor
from rw_ekf.fleet.fleet_run import run_fleet
from rw_ekf.fleet.folder import FleetFolder
from rw_ekf.fleet.index import FleetIndex, built_index
from rw_ekf.fleet.plan import FleetSettings, plan_of
from rw_ekf.fleet.remaining import limits_of
from rw_ekf.fleet.simulation import FIRST_DAY, FleetShape, name_of, truth_by_day, truth_of, write_days
from rw_ekf.fleet.task import Task, work
from rw_ekf.fleet.trend_findings import finding_kinds
from rw_ekf.fleet.wheel_trends import trends_of
from rw_ekf.log_replay import replay_log
from rw_ekf.log_simulation import simulate
from rw_ekf.logs.metadata import moment_of
from rw_ekf.logs.reader import read_log
from rw_ekf.one_thread import ask_for_one_thread, one_thread

_WHEELS, _DAYS = 10, 10  # of the runs that are timed: the plain loop takes some 15 s
_FLEETS, _AGEING = 4, 10  # of 200 wheels, and how many of them age
_MANY = 10_000  # wheels
_YEAR_SEED = 0  # of which one wheel in six ages and none fails
_TURNS = 3  # of the plain loop and the clusters
_STDS = {"motor_gain": 0.004, "viscous": 1.2e-5, "coulomb": 0.0013, "static": 0.0036}  # of a day: results of `run`


def main() -> None:
    """Measure what was asked for."""
    ask_for_one_thread()
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    what = {
        "overhead": _overhead,
        "dask": _dask,
        "many": _many,
        "memory": _memory,
        "trends": _trends,
        "remaining": _remaining,
        "rate": _rate,
        "year": _year,
    }
    parser.add_argument("--what", nargs="+", choices=list(what), default=list(what))
    for name in parser.parse_args().what:
        with tempfile.TemporaryDirectory() as place:
            what[name](Path(place))


def _overhead(place: Path) -> None:
    index = _index(_logs(place, FleetShape(_WHEELS, _DAYS, seed=2)))
    _plain(index)  # warm: file cache, compiled routines
    plain_s, plain_cpu_s = _timed(lambda: _plain(index))
    with ProcessExecutor(2) as executor:
        _done(index, place / "warm", executor)
        workers = _descendants(os.getpid())
        before = sum(map(_cpu_s, workers))
        fleet_s, client_s = _timed(lambda: _done(index, place / "fleet", executor))
        spent_s = sum(map(_cpu_s, workers)) - before + client_s
    print(
        f"overhead: {len(index.logs)} logs, plain loop {plain_s:.1f} s, two workers {fleet_s:.1f} s: "
        f"{fleet_s / (0.5 * plain_s):.2f} of half of it; processor time {spent_s / plain_cpu_s:.2f} of the loop's"
    )


def _dask(place: Path) -> None:
    """By turns, for processor time grows with what else the machine does: as Dask comes, and as docs/fleet.md says."""
    index = _index(_logs(place, FleetShape(_WHEELS, _DAYS, seed=2)))
    _plain(index)
    for turn in range(_TURNS):
        _, plain_s = _timed(lambda: _plain(index))
        reported = []
        for name, settings in (("as it comes", {}), ("with our settings", DASK_SETTINGS)):
            spent_s, wall_s = _spent_by_dask(index, place / f"{name} {turn}", settings)
            reported.append(f"{name} {spent_s / plain_s:.2f} ({spent_s:.1f} s in {wall_s:.1f} s)")
        print(f"dask: of {plain_s:.1f} s of the plain loop {', '.join(reported)}; load {os.getloadavg()[0]:.1f}")


def _spent_by_dask(index: FleetIndex, place: Path, settings: dict[str, Any]) -> tuple[float, float]:
    """Processor time of two workers, scheduler and client, and wall time, of a run after a first one [s]."""
    with dask.config.set(settings):
        cluster: Any = distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None, silence_logs=50
        )
        try:
            with DaskExecutor(cluster.scheduler_address) as executor:
                _done(index, place / "warm", executor)
                workers = _descendants(os.getpid())
                before = time.process_time() + sum(map(_cpu_s, workers))
                wall_s, _ = _timed(lambda: _done(index, place / "dask", executor))
                return time.process_time() + sum(map(_cpu_s, workers)) - before, wall_s
        finally:
            cluster.close()


def _many(place: Path) -> None:
    """A scheduler and two workers, each a process of its own, as on several machines."""
    log = place / "one.parquet"
    simulate("P1", seed=1, duration_s=60.0).save(log)
    for number in range(_MANY):
        folder = place / "logs" / f"wheel={name_of(number)}"
        folder.mkdir(parents=True)
        os.link(log, folder / "2026-01-01.parquet")
    reported = place / "scheduler.json"
    scheduler = _dask_process("scheduler", "--port", "0", "--no-dashboard", "--scheduler-file", str(reported))
    while not reported.is_file():
        time.sleep(0.1)
    worker = _dask_process("worker", "--scheduler-file", str(reported), "--nworkers", "2", "--nthreads", "1")
    probe = (
        "import sys, rw_ekf; done = rw_ekf.fleet.run(sys.argv[1], scheduler=sys.argv[2]); assert done.whole; "
        "print(len(done.entries), done.seconds)"
    )
    try:
        address = json.loads(reported.read_text())["address"]
        command = [sys.executable, "-c", probe, str(place / "logs"), address]
        with subprocess.Popen(command, stdout=subprocess.PIPE) as client:
            most_mb = 0.0
            while client.poll() is None:
                most_mb = max(most_mb, _peak_mb(client.pid) or 0.0)
                time.sleep(0.2)
            assert client.stdout is not None
            stated = client.stdout.read().decode().strip()
        print(
            f"many: wheels and seconds {stated}: scheduler {_peak_mb(scheduler.pid):.0f} MB at its most, "
            f"client {most_mb:.0f} MB"
        )
    finally:
        for process in (worker, scheduler):
            process.terminate()
            process.wait()


def _dask_process(kind: str, *options: str) -> subprocess.Popen[bytes]:
    command = [sys.executable, "-m", f"distributed.cli.dask_{kind}", *options]
    return subprocess.Popen(command, stderr=subprocess.DEVNULL)


def _peak_mb(pid: int) -> float | None:
    """The largest resident memory of a process so far; None where it has gone."""
    try:
        lines = Path(f"/proc/{pid}/status").read_text().splitlines()
    except OSError:
        return None
    return next((int(line.split()[1]) / 1e3 for line in lines if line.startswith("VmHWM")), None)


def _memory(place: Path) -> None:
    """A process of its own, so that nothing but its tasks is in it."""
    logs = _logs(place, FleetShape(1, 500, seed=3))
    probe = (
        "import sys; from pathlib import Path; from tools.measure.fleet import memory_of; "
        "memory_of(Path(sys.argv[1]), Path(sys.argv[2]))"
    )
    subprocess.run([sys.executable, "-c", probe, str(logs), str(place / "results")], check=True)


def memory_of(logs: Path, results: Path) -> None:
    """Print the resident memory of this process after 50 and after all parts of a wheel."""
    planned = plan_of(_index(logs), FleetSettings())[name_of(0)]
    work(Task(str(logs), str(results), tuple(planned[:50])))
    early = _resident_mb()
    work(Task(str(logs), str(results), tuple(planned[50:]), str(planned[49].path(results))))
    print(f"memory: {early:.0f} MB after 50 parts, {_resident_mb():.0f} MB after {len(planned)}")


def _trends(place: Path) -> None:
    """Some of 200 wheels age, in several fleets; and what rates miss by, in own sigmas, with and without a walk."""
    del place
    found = accused = healthy = 0
    misses: list[float] = []
    with one_thread():
        for seed in range(_FLEETS):
            shape = FleetShape(200, 365, seed=seed, ageing_share=0.0, failing_share=0.0)
            wheels = [daily_estimates(shape, number, 0.5 if number < _AGEING else 0.0) for number in range(200)]
            kinds = [bool(finding_kinds(wheel)) for wheel in trends_of(wheels, {}).wheels]
            found += sum(kinds[:_AGEING])
            accused += sum(kinds[_AGEING:])
            healthy += 200 - _AGEING
        for walk in (0.0, 0.01, 0.03):
            shape = FleetShape(200, 365, seed=99, ageing_share=0.0, failing_share=0.0)
            wheels = [daily_estimates(shape, number, 0.0, walk) for number in range(200)]
            off = [
                w.parameters["coulomb"].fit.rate / w.parameters["coulomb"].fit.rate_std
                for w in trends_of(wheels, {}).wheels
            ]
            misses.append(float(np.sqrt(np.mean(np.square(off)))))
    print(
        f"trends: ageing found {found} of {_FLEETS * _AGEING}, healthy accused {accused} of {healthy} "
        f"({100.0 * accused / healthy:.2f} %); where frictions walk by 0, 1 and 3 % a year rates miss by "
        f"{', '.join(f'{miss:.2f}' for miss in misses)} sigma rms"
    )


def _remaining(place: Path) -> None:
    """A year of days of wheels that wear by 5 to 40 % a year and wander, their courses drawn on for forty years."""
    del place
    days, after, base = 365, 14_600, 0.59
    for walk in (0.0, 0.01, 0.03, 0.06):
        rng = np.random.default_rng(17)
        wheels, courses = [], []
        for number in range(200):
            years = np.arange(days + after) / 365.25
            wander = walk * np.cumsum(rng.standard_normal(days + after)) / np.sqrt(365.25)
            course = base * (1.0 + rng.uniform(0.05, 0.4) * years + wander)
            seen = course[:days] * (1.0 + 0.004 * rng.standard_normal(days))
            estimates = daily_estimates(FleetShape(200, days, seed=17), number, 0.0)
            wheels.append(
                replace(
                    estimates,
                    values={**estimates.values, "coulomb": seen},
                    temperature_degC=np.full(days, np.nan),
                )
            )
            courses.append(course[days:])
        with one_thread():
            found = trends_of(wheels, limits_of(["coulomb=+50%"])).wheels
        early = late = 0
        for wheel, course in zip(found, courses, strict=True):
            left = wheel.parameters["coulomb"].remaining
            assert left is not None
            reached_y = float(np.argmax(course >= left.limit) + 1) / 365.25
            early += reached_y < left.years_05
            late += reached_y > left.years_95
        print(f"remaining: walk {100.0 * walk:.0f} % a year: {early} of 200 earlier than 5 %, {late} later than 95 %")


def daily_estimates(shape: FleetShape, number: int, percent_per_month: float, walk: float = 0.0) -> WheelDays:
    """What a run would find of a simulated wheel, drawn about its truth; walk: relative, per sqrt(year)."""
    truth = replace(truth_of(shape, number), ageing_percent_per_month=percent_per_month)
    course = truth_by_day(shape, truth, number)
    rng = np.random.default_rng([shape.seed, number, 9])
    warmth = course["ambient_degC"] - 20.0
    thins = {"viscous": np.exp(-0.02 * warmth), "coulomb": 1.0 - 0.003 * warmth, "static": 1.0 - 0.003 * warmth}
    values = {}
    for name, std in _STDS.items():
        walked = 1.0 + walk * np.cumsum(rng.standard_normal(shape.days)) / np.sqrt(365.25)
        values[name] = course[name] * thins.get(name, 1.0) * walked + std * rng.standard_normal(shape.days)
    first = (FIRST_DAY - date(1970, 1, 1)).days
    return WheelDays(
        wheel=truth.wheel,
        time_d=first + np.arange(shape.days, dtype=np.float64),
        day=tuple(str(day) for day in np.datetime64(FIRST_DAY) + np.arange(shape.days)),
        log=("",) * shape.days,
        ok=np.ones(shape.days, dtype=bool),
        status=("ok",) * shape.days,
        values=values,
        stds={name: np.full(shape.days, std) for name, std in _STDS.items()},
        temperature_degC=course["ambient_degC"],
        nis_mean=np.ones(shape.days),
        innovation_rpm=np.ones(shape.days),
        rejected_share=np.zeros(shape.days),
        misread=np.zeros(shape.days, dtype=bool),
        not_noise=np.zeros(shape.days, dtype=bool),
        alarms=np.full(shape.days, np.nan),
        counts={},
    )


def _rate(place: Path) -> None:
    """Days of 864,000 samples, of which each is a log of ten minutes over and over."""
    logs = place / "logs"
    day = simulate("P1", seed=1, duration_s=86_400.0)
    for wheel in range(2):
        folder = logs / f"wheel={name_of(wheel)}"
        folder.mkdir(parents=True)
        day.save(folder / "2026-01-01.parquet")
        for number in range(2, 9):
            shutil.copy(folder / "2026-01-01.parquet", folder / f"2026-01-{number:02d}.parquet")
    index = _index(logs)
    with ProcessExecutor(2) as executor:
        _done(index, place / "warm", executor)
        workers = _descendants(os.getpid())
        before = sum(map(_cpu_s, workers))
        seconds, _ = _timed(lambda: _done(index, place / "rate", executor))
        spent_s = sum(map(_cpu_s, workers)) - before
    samples = len(index.logs) * len(day)
    size = sum(path.stat().st_size for path in (place / "rate").rglob("part-*")) / len(index.logs)
    print(
        f"rate: {samples:.3g} samples in {seconds:.1f} s ({1e8 * seconds / samples:.0f} s for 1e8), processor time "
        f"of the workers {spent_s:.1f} s ({1e6 * spent_s / samples:.2f} us a sample); "
        f"{index.logs[0].bytes / len(day):.1f} bytes a sample, {size:.0f} bytes a result"
    )


def _year(place: Path) -> None:
    """By its commands, as a user has it."""
    logs = str(place / "logs")
    drawn = ("--wheels", "6", "--days", "365", "--seed", str(_YEAR_SEED), "--workers", "1")
    simulated_s, _ = _timed(lambda: _stated("simulate", "fleet", "--out", logs, *drawn))
    began_s = time.perf_counter()
    memory = _watched_run(logs)
    ran_s = time.perf_counter() - began_s
    print(_stated("fleet", "trends", logs), _stated("fleet", "view", logs), sep="\n")
    truth = json.loads(Path(logs, "truth.json").read_text())["truth"]
    reported = json.loads(Path(logs, "fleet", "trends.json").read_text())["wheels"]
    ages = sorted(wheel["wheel"] for wheel in truth if wheel["ageing_percent_per_month"] > 0.0)
    fails = sorted(wheel["wheel"] for wheel in truth if wheel["fails_on"])
    accused = sorted(wheel["wheel"] for wheel in reported if wheel["findings"])
    print(
        f"year: simulated in {simulated_s:.0f} s, filtered in {ran_s:.0f} s; ages {ages}, fails {fails}, findings of "
        f"{accused}; largest worker {', '.join(f'{mb:.0f}' for mb in memory)} MB in the fifths of the run; page "
        f"{Path(logs, 'fleet', 'fleet.html').stat().st_size / 1e3:.0f} kB"
    )


def _watched_run(logs: str) -> list[float]:
    """Filter a fleet by two workers; the most memory of the larger one [MB] in each fifth of its results."""
    seen: list[tuple[int, float]] = []
    with subprocess.Popen(_command("fleet", "run", logs, "--workers", "2"), stdout=subprocess.PIPE, text=True) as run:
        while run.poll() is None:
            largest = max(map(_resident_mb, _descendants(run.pid)), default=0.0)
            seen.append((sum(1 for _ in Path(logs, "fleet", "results").rglob("part-*")), largest))
            time.sleep(2.0)
        assert run.stdout is not None
        print(run.stdout.read().splitlines()[0])
    total = seen[-1][0]
    return [max(mb for count, mb in seen if part <= 5 * count / total <= part + 1) for part in range(5)]


def _stated(*arguments: str) -> str:
    return subprocess.run(_command(*arguments), check=True, stdout=subprocess.PIPE, text=True).stdout.rstrip()


def _command(*arguments: str) -> list[str]:
    return [sys.executable, "-m", "rw_ekf", *arguments]


def _logs(place: Path, shape: FleetShape) -> Path:
    logs = place / "logs"
    logs.mkdir()
    for number in range(shape.wheels):
        write_days((str(logs), shape, number, (0, shape.days)))
    return logs


def _index(logs: Path) -> FleetIndex:
    return built_index(logs)


def _plain(index: FleetIndex) -> None:
    """The same logs, read and replayed one after the other, with the same beginnings; nothing is written."""
    for logs in index.wheels.values():
        carry = None
        for log in logs:
            begins = moment_of(log.begins_utc)
            assert begins is not None
            read = read_log(Path(index.directory) / log.log)
            start = first_start(read, None, None) if carry is None else next_start(read, None, carry, begins)
            with one_thread():
                run = replay_log(read, setup=start.setup)
            carry = Carry(run.model, start.origin, begins)


def _done(index: FleetIndex, place: Path, executor: Any) -> None:
    done = run_fleet(FleetFolder(place), index, FleetSettings(), executor)
    assert done.whole, done.text()


def _timed(what: Callable[[], object]) -> tuple[float, float]:
    """Wall and processor time of this process [s]."""
    began, cpu = time.perf_counter(), time.process_time()
    what()
    return time.perf_counter() - began, time.process_time() - cpu


def _descendants(pid: int) -> list[int]:
    found = []
    for task in Path(f"/proc/{pid}/task").glob("*/children"):
        for child in map(int, task.read_text().split()):
            found += [child, *_descendants(child)]
    return found


def _cpu_s(pid: int) -> float:
    """User and system time of a process [s]."""
    fields = Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def _resident_mb(pid: int | str = "self") -> float:
    """Memory of a process; 0 where it has gone."""
    try:
        return int(Path(f"/proc/{pid}/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 1e6
    except OSError:
        return 0.0


if __name__ == "__main__":
    main()
