"""Measure the estimator against a simulated wheel whose truth is known, and print each number beside its mark.

    python -m tools.measure.estimator            all of it, some minutes on one core
    python -m tools.measure.estimator --quick    a fifth of the runs

The wheel is that of drivers.sim.plant_batch, which integrates in fine steps of its own. NEES is the squared error of
the four parameters in the metric of the filter's covariance (4 is ideal, less is cautious); errors "in bounds" are RMS
errors over the Cramer-Rao bound of the same run. Exit status 1 if a mark is missed.
"""

from __future__ import annotations

import argparse
import math
import platform
import sys
import time
from collections.abc import Iterable
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from tqdm import tqdm

from drivers.sim.plant_batch import simulate_run
from drivers.sim.plant_parameters import PlantNoise, PlantParameters
from rw_ekf.arrays import Float64Array
from rw_ekf.control.profiles import make_profile, sample_profile
from rw_ekf.course.course import Course
from rw_ekf.course.free_run import FreeRun, free_run
from rw_ekf.filter.belief import DEFAULT_PRIOR, Belief, with_prior_table
from rw_ekf.filter.constants import FilterConstants, filter_constants
from rw_ekf.filter.estimator import Estimator
from rw_ekf.filter.log_filter import filter_log
from rw_ekf.filter.smoother import smooth_log
from rw_ekf.identify.least_squares import least_squares
from rw_ekf.likelihood.log_fit import fit_log
from rw_ekf.likelihood.noise_posterior import NoisePosterior
from rw_ekf.model.friction import GAUSS, Stribeck
from rw_ekf.model.state import CK13_STATISTICAL, PARAMETER_COUNT, PARAMETER_NAMES, PARAMETERS, SPEED, STATIC
from rw_ekf.records import IssuedCommand, WheelSample
from rw_ekf.units import RAD_S_PER_RPM
from rw_ekf.wheel.table import NO_EFFECTS

PROFILES = ("P1", "P2", "S1", "S2", "S3", "S4", "S5")
TRUTH = np.array(CK13_STATISTICAL)
OMEGA_S = 4.0 * RAD_S_PER_RPM
LOW_SPEED = 100.0 * RAD_S_PER_RPM
MILLION = 1_000_000


@dataclass(frozen=True)
class Row:
    """One line of the table; `met` is None where there is no mark."""

    what: str
    value: str
    mark: str = ""
    met: bool | None = None


@dataclass(frozen=True)
class Run:
    """A simulated run: what is true and what was read."""

    time_s: Float64Array
    current_A: Float64Array
    speed_rad_s: Float64Array
    reading_rad_s: Float64Array

    @property
    def course(self) -> Course:
        """As the filter sees it."""
        return Course.of(self.time_s, self.reading_rad_s, self.current_A)


@lru_cache(maxsize=512)
def truth_of(profile: str, seed: int) -> tuple[Float64Array, Float64Array, Float64Array]:
    """Times, currents and true speeds at 10 Hz; the seed draws the profiles that are random."""
    sampled = sample_profile(make_profile(profile, seed=seed), 10.0)
    time_s, current_A = np.array(sampled[0]), np.array(sampled[1])
    plant = simulate_run(PlantParameters(), current_A, time_s, PlantNoise(speed_rad_s=0.0))
    return time_s, current_A, plant.speed_rad_s


def run_of(profile: str, seed: int, noise_rpm: float = 1.0) -> Run:
    """One run with fresh noise."""
    time_s, current_A, speed = truth_of(profile, seed if profile in {"P1", "P2"} else 1)
    noise = np.random.default_rng([seed, PROFILES.index(profile)]).standard_normal(time_s.size)
    return Run(time_s, current_A, speed, speed + noise_rpm * RAD_S_PER_RPM * noise)


def constants_for(noise_rpm: float = 1.0) -> FilterConstants:
    """Default process noise, given reading noise."""
    return filter_constants(OMEGA_S, speed_noise_rad_s=noise_rpm * RAD_S_PER_RPM)


def prior_for(seed: int) -> Belief:
    """The default prior, its mean drawn around the truth with half its own standard deviation."""
    covariance = DEFAULT_PRIOR.parameter_covariance
    drawn = np.linalg.cholesky(covariance) @ np.random.default_rng(1000 + seed).standard_normal(PARAMETER_COUNT)
    return Belief.of_known(TRUTH + 0.5 * drawn, covariance)


def run_of_truth(course: Course, first_speed_rad_s: float, *, with_jacobian: bool = False) -> FreeRun:
    """The default wheel run free over a whole course."""
    start, first, last = (
        np.array([[first_speed_rad_s, *CK13_STATISTICAL]]),
        np.array([0]),
        np.array([course.samples - 1]),
    )
    stribeck = Stribeck(OMEGA_S, GAUSS)
    return free_run(course, NO_EFFECTS, stribeck, start, first, last, keep_path=True, with_jacobian=with_jacobian)


def bounds_of(run: Run, noise_rpm: float) -> Float64Array:
    """Cramer-Rao standard deviations of k, b, c, s, (4,); the first speed is unknown."""
    jacobian = run_of_truth(run.course, float(run.speed_rad_s[0]), with_jacobian=True).jacobian
    scale = np.maximum(np.linalg.norm(jacobian, axis=0), 1e-300)
    information = (jacobian / scale).T @ (jacobian / scale)
    bounds = np.sqrt(np.diag(np.linalg.pinv(information, rcond=1e-13))) / scale * noise_rpm * RAD_S_PER_RPM
    return np.asarray(bounds[1:], dtype=np.float64)


def rms(values: Iterable[float] | Float64Array) -> float:
    """Root mean square."""
    return math.sqrt(float(np.mean(np.square(np.asarray(list(values), dtype=np.float64)))))


def at_most(what: str, value: float, mark: float, unit: str = "") -> Row:
    """A row whose value may not exceed its mark."""
    return Row(what, f"{value:.3g}{unit}", f"<= {mark:g}{unit}", value <= mark)


def measure_filter(runs: int, advance: tqdm[Any]) -> list[Row]:
    """NEES, errors in bounds, low-speed error and smoothing, per profile at 1 rpm."""
    rows, constants = [], constants_for()
    for profile in PROFILES:
        nees, errors, low, whole, smoothed = [], [], [], [], []
        for seed in range(runs):
            run, prior = run_of(profile, seed), prior_for(seed)
            found = filter_log(
                run.course, constants, prior.mean, prior.covariance, keep_states=True, keep_history=profile == "P1"
            )
            error = found.mean[PARAMETERS] - TRUTH
            nees.append(float(error @ np.linalg.solve(found.covariance[PARAMETERS, PARAMETERS], error)))
            errors.append(error / bounds_of(run, 1.0))
            off = (found.states[:, SPEED] - run.speed_rad_s) / RAD_S_PER_RPM
            low.append(rms(off[np.abs(run.speed_rad_s) < LOW_SPEED]))
            if profile == "P1":
                whole.append(rms(off))
                smoothed.append(rms((smooth_log(found)[0][:, SPEED] - run.speed_rad_s) / RAD_S_PER_RPM))
            advance.update()
        in_bounds = [rms(np.array(errors)[:, j]) for j in range(PARAMETER_COUNT)]
        rows.append(at_most(f"{profile}  mean NEES of the four parameters", float(np.mean(nees)), 6.0))
        rows.append(Row(f"{profile}  largest NEES of {runs}", f"{max(nees):.1f}"))
        if profile in {"P1", "P2"}:
            rows.append(at_most(f"{profile}  T_s error in bounds", in_bounds[3], 2.5))
        else:
            rows.append(Row(f"{profile}  T_s error in bounds", f"{in_bounds[3]:.2f}"))
        others = ", ".join(f"{value:.2f}" for value in in_bounds[:3])
        rows.append(Row(f"{profile}  errors of k, b, c in bounds", others))
        if profile == "P1":
            rows.append(at_most("P1  RMS error of the true speed below 100 rpm", rms(low), 0.13, " rpm"))
            rows.append(Row("P1  RMS error of the true speed, filtered", f"{rms(whole):.3f} rpm"))
            rows.append(at_most("P1  RMS error of the true speed, smoothed", rms(smoothed), 0.09, " rpm"))
        else:
            rows.append(Row(f"{profile}  RMS error of the true speed below 100 rpm", f"{rms(low):.3f} rpm"))
    return rows


def measure_robustness(trials: int, advance: tqdm[Any]) -> list[Row]:
    """How many of the trials with a poor prior on T_s diverge: T_s or speed lost at the end."""
    kinds = ("P1", "P1", "P1", "P2", "P2", "P2", "S2", "S3", "S4", "S5")
    diverged, worst = 0, 0.0
    for trial in range(trials):
        static = (0.0, CK13_STATISTICAL.coulomb, 1.2)[trial % 3]
        prior = with_prior_table(DEFAULT_PRIOR, {"static": (static, 0.7)})
        run = run_of(kinds[trial // 3 % len(kinds)], trial // 3)
        found = filter_log(run.course, constants_for(), prior.mean, prior.covariance, keep_states=True)
        error = abs(float(found.mean[STATIC]) - CK13_STATISTICAL.static)
        lost = rms((found.states[50:, SPEED] - run.speed_rad_s[50:]) / RAD_S_PER_RPM) > 1.0
        diverged += error > min(0.5, 6.0 * math.sqrt(found.covariance[STATIC, STATIC])) or lost
        worst = max(worst, error)
        advance.update()
    return [
        at_most(f"diverged of {trials} from T_s = 0, c, 1.2 (sigma 0.7)", diverged, 0),
        Row("largest error of T_s/J at the end", f"{worst:.3f} rad/s^2"),
    ]


def measure_batch(runs: int, advance: tqdm[Any]) -> list[Row]:
    """Batch least squares on P2 at both noises."""
    rows = []
    for noise_rpm in (1.0, 5.0):
        errors, converged = [], 0
        for seed in range(runs):
            run = run_of("P2", seed, noise_rpm)
            found = least_squares(run.course, constants_for(noise_rpm), prior_for(seed))
            converged += found.converged
            errors.append((np.array(found.parameters) - TRUTH) / bounds_of(run, noise_rpm))
            advance.update()
        share = converged / runs
        name = f"least squares, P2, {noise_rpm:g} rpm"
        rows.append(Row(f"{name}: converged", f"{converged} of {runs}", ">= 98 %", share >= 0.98))
        for j, parameter in enumerate(PARAMETER_NAMES):
            value = rms(np.array(errors)[:, j])
            rows.append(Row(f"{name}: {parameter} in bounds", f"{value:.2f}", "0.8 to 1.25", 0.8 <= value <= 1.25))
    return rows


def noises_of(course: Course, guess_rpm: float) -> NoisePosterior:
    """Noises of a record by restricted likelihood, from a first guess of the speed noise."""
    return fit_log(course, constants_for(guess_rpm), DEFAULT_PRIOR, CK13_STATISTICAL).noises


def measure_noise(runs: int, advance: tqdm[Any]) -> list[Row]:
    """Noises by maximum likelihood on P1: R, and process noise where there is some and where there is none."""
    rows = []
    for noise_rpm in (1.0, 5.0):
        found = []
        for seed in range(runs):
            fit = noises_of(run_of("P1", seed, noise_rpm).course, 1.5 * noise_rpm)
            found.append(fit)
            advance.update()
        mean = float(np.mean([f.speed_noise_rad_s for f in found])) / RAD_S_PER_RPM
        spread = float(np.std([f.speed_noise_rad_s for f in found])) / RAD_S_PER_RPM
        rows.append(
            Row(
                f"likelihood: speed noise, truth {noise_rpm:g} rpm",
                f"{mean:.3f} +- {spread:.3f} rpm",
                "mean within 3 %",
                abs(mean / noise_rpm - 1.0) < 0.03,
            )
        )
        none = sum(not f.acceleration_noise_seen for f in found)
        rows.append(Row(f"likelihood: no process noise recognised, {noise_rpm:g} rpm", f"{none} of {runs}"))
    process = 0.1  # rpm per sqrt(s)
    values, sigmas = [], []
    for seed in range(runs):
        time_s, current_A, _ = truth_of("P1", seed)
        noise = PlantNoise(RAD_S_PER_RPM, process * RAD_S_PER_RPM)
        plant = simulate_run(PlantParameters(), current_A, time_s, noise, seed=seed)
        course = Course.of(time_s, plant.measured_speed_rad_s, current_A)
        fit = noises_of(course, 1.0)
        values.append(fit.acceleration_noise / RAD_S_PER_RPM)
        sigmas.append(fit.acceleration_noise_std / RAD_S_PER_RPM)
        advance.update()
    normalised = rms((np.array(values) - process) / np.array(sigmas))
    rows.append(
        Row(
            f"likelihood: process noise, truth {process:g} rpm/sqrt(s)",
            f"{np.mean(values):.3f} +- {np.std(values):.3f}; {normalised:.2f} of its sigma RMS",
            "0.5 to 1.5 sigma",
            0.5 <= normalised <= 1.5,
        )
    )
    return rows


def measure_online(advance: tqdm[Any]) -> list[Row]:
    """Online against compiled on the same log, and the time of an online tick."""
    rows = []
    for profile in ("P1", "S2"):
        run, constants = run_of(profile, 1), constants_for()
        found = filter_log(run.course, constants, DEFAULT_PRIOR.mean, DEFAULT_PRIOR.covariance, keep_states=True)
        estimator = Estimator(constants, DEFAULT_PRIOR.mean, DEFAULT_PRIOR.covariance)
        worst, ticks = 0.0, []
        for i in range(run.time_s.size):
            sample = WheelSample(float(run.time_s[i]), float(run.reading_rad_s[i]))
            started = time.perf_counter()
            result = estimator.step(sample)
            estimator.command_issued(IssuedCommand(float(run.current_A[i])))
            ticks.append(time.perf_counter() - started)
            worst = max(worst, float(np.max(np.abs(np.array(result.values) - found.states[i]) / found.stds[i])))
        rows.append(at_most(f"{profile}  online against compiled, worst difference in sigma", worst, 1e-6))
        middle, late = (1e6 * float(np.quantile(ticks, q)) for q in (0.5, 0.999))
        rows.append(Row(f"{profile}  online tick, median and 99.9 %", f"{middle:.0f} and {late:.0f} us"))
        advance.update()
    return rows


def long_run(name: str) -> tuple[Float64Array, Float64Array]:
    """Times and currents of a million samples at 10 Hz."""
    time_s = np.linspace(0.0, 0.1 * (MILLION - 1), MILLION)
    if name == "sine 0.1 A, 30 s":
        return time_s, 0.1 * np.sin(2.0 * np.pi * time_s / 30.0)
    if name == "at rest":
        return time_s, np.zeros(MILLION)
    _, current = sample_profile(make_profile(name, seed=1), 10.0)
    return time_s, np.resize(np.array(current), MILLION)


def measure_kernel(advance: tqdm[Any]) -> list[Row]:
    """Nanoseconds per sample of the compiled pass, best of three."""
    rows = []
    for name in ("identification", "sine 0.1 A, 30 s", "P1", "P2", "S1", "at rest"):
        time_s, current_A = long_run(name)
        speed = run_of_truth(Course.of(time_s, np.zeros(MILLION), current_A), 0.0).path_rad_s
        reading = speed + RAD_S_PER_RPM * np.random.default_rng(1).standard_normal(MILLION)
        course = Course.of(time_s, reading, current_A)
        best = math.inf
        for _ in range(3):
            started = time.perf_counter()
            filter_log(course, constants_for(), DEFAULT_PRIOR.mean, DEFAULT_PRIOR.covariance)
            best = min(best, time.perf_counter() - started)
        rows.append(Row(f"compiled pass, 1e6 samples, {name}", f"{1e9 * best / MILLION:.0f} ns/sample"))
        advance.update()
    return rows


def show(rows: list[Row]) -> None:
    """Print the table: what, value, mark, and whether it is met."""
    wide, narrow = max(len(row.what) for row in rows), max(len(row.value) for row in rows)
    for row in rows:
        verdict = {None: "", True: "ok", False: "MISSED"}[row.met]
        print(f"{row.what:<{wide}}  {row.value:>{narrow}}  {row.mark:<16}  {verdict}".rstrip())


def main(arguments: list[str] | None = None) -> int:
    """Measure and print; exit status 1 if a mark is missed."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", maxsplit=1)[0])
    parser.add_argument("--quick", action="store_true", help="a fifth of the runs")
    parser.add_argument("--runs", type=int, default=100, help="runs per profile (100)")
    options = parser.parse_args(arguments)
    share = 0.2 if options.quick else 1.0
    runs, trials = max(2, round(share * options.runs)), max(3, round(share * 120))
    batch, noise = max(2, round(share * 2 * options.runs)), max(2, round(share * 20))
    total = runs * len(PROFILES) + trials + 2 * batch + 3 * noise + 2 + 6
    started = time.perf_counter()
    with tqdm(total=total, unit="run", file=sys.stderr) as advance:
        rows = [
            *measure_filter(runs, advance),
            *measure_robustness(trials, advance),
            *measure_batch(batch, advance),
            *measure_noise(noise, advance),
            *measure_online(advance),
            *measure_kernel(advance),
        ]
    print(f"{runs} runs per profile, Python {platform.python_version()}, {time.perf_counter() - started:.0f} s\n")
    show(rows)
    return 1 if any(row.met is False for row in rows) else 0


if __name__ == "__main__":
    sys.exit(main())
