"""Every compensation against every other: schemes x noises x seeds, in as many processes as there are cores."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import as_completed
from dataclasses import dataclass
from functools import partial
from typing import TypeVar

from rw_ekf.attitude_bench.bench_run import BenchRun
from rw_ekf.attitude_bench.bench_start import diagnosed, run_scheme
from rw_ekf.attitude_bench.metrics import Metrics, metrics_of
from rw_ekf.attitude_bench.scenario import Scenario
from rw_ekf.control.compensation.schemes import SCHEMES
from rw_ekf.wheel.model_file import WheelModel
from rw_ekf.worker_pool import workers

Key = TypeVar("Key")
Result = TypeVar("Result")
Condition = tuple[str, float]  # a sweep and its level
Models = Mapping[float, WheelModel]  # what `diagnose` makes of the wheel, by the noise of the readings [rpm]


@dataclass(frozen=True)
class Entry:
    """One run that is to be made: who, at which noise, on the wheel of which seed."""

    scheme: str
    noise_rpm: float
    seed: int


@dataclass(frozen=True)
class Contest:
    """What was run: the figures of every entry, and the course of the first seed's."""

    scenario: Scenario
    seeds: int
    figures: dict[Entry, Metrics]
    courses: dict[Entry, BenchRun]  # of the first seed


def entries_of(schemes: Sequence[str], scenario: Scenario, seeds: int) -> list[Entry]:
    """All runs of a contest, those of one wheel together; seed 0 is left for whoever tunes."""
    return [
        Entry(scheme, noise_rpm, seed)
        for seed in range(1, seeds + 1)
        for noise_rpm in scenario.cycle.speed_noise_rpm
        for scheme in schemes
    ]


def run_entry(entry: Entry, scenario: Scenario, models: Models) -> BenchRun:
    """Run one entry."""
    return run_scheme(SCHEMES[entry.scheme], scenario, entry.noise_rpm, entry.seed, models.get(entry.noise_rpm))


def models_of(schemes: Sequence[str], scenario: Scenario, model: WheelModel | None = None) -> Models:
    """What a diagnosis made of the wheel, by noise: the model given, or one made now where a scheme needs it."""
    noises = scenario.cycle.speed_noise_rpm
    if model is not None:
        return dict.fromkeys(noises, model)
    if not any(SCHEMES[name].parameters_from == "diagnosed" for name in schemes):
        return {}
    found = dict(finished({noise_rpm: partial(diagnosed, scenario, noise_rpm) for noise_rpm in noises}))
    return {noise_rpm: found[noise_rpm] for noise_rpm in noises}


def hold_contest(
    schemes: Sequence[str],
    scenario: Scenario,
    seeds: int,
    models: Models,
    tick: Callable[[int], object] = lambda n: None,
) -> Contest:
    """Run them all; tick(1) is called as each is done. models: see `models_of`.

    Results do not depend on how many processes there are: each run draws from its own seed.
    """
    entries = entries_of(schemes, scenario, seeds)
    figures: dict[Entry, Metrics] = {}
    courses: dict[Entry, BenchRun] = {}
    for entry, run in finished({entry: partial(_judged, entry, scenario, models) for entry in entries}):
        figures[entry], course = run
        if course is not None:
            courses[entry] = course
        tick(1)
    return Contest(scenario, seeds, figures, courses)


def hold_runs(
    schemes: Sequence[str],
    conditions: Mapping[Condition, Scenario],
    seeds: int,
    models: Mapping[Condition, Models],
    tick: Callable[[int], object],
) -> dict[Condition, dict[str, list[float]]]:
    """Peaks [deg] of every scheme under every condition, one a seed, each at its scenario's first noise."""
    peaks: dict[Condition, dict[str, list[float]]] = {}
    jobs = {
        (condition, scheme, seed): partial(
            _figures, Entry(scheme, there.cycle.speed_noise_rpm[0], seed), there, models[condition]
        )
        for condition, there in conditions.items()
        for seed in range(1, seeds + 1)
        for scheme in schemes
    }
    for (condition, scheme, _), figures in finished(jobs):
        peaks.setdefault(condition, {}).setdefault(scheme, []).append(figures.peak_deg)
        tick(1)
    return peaks


def finished(jobs: Mapping[Key, Callable[[], Result]]) -> Iterator[tuple[Key, Result]]:
    """Each job's key and result as it is done, in processes of their own; what a job raises is raised here."""
    with workers(len(jobs)) as pool:
        waiting = {pool.submit(job): key for key, job in jobs.items()}
        for done in as_completed(waiting):
            yield waiting[done], done.result()


def _figures(entry: Entry, scenario: Scenario, models: Models) -> Metrics:
    return metrics_of(run_entry(entry, scenario, models))


def _judged(entry: Entry, scenario: Scenario, models: Models) -> tuple[Metrics, BenchRun | None]:
    """Figures of a run, and of the first seed its course too: the rest is not worth sending."""
    run = run_entry(entry, scenario, models)
    return metrics_of(run), run if entry.seed == 1 else None
