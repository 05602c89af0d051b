"""Measure the estimator against a simulated wheel whose truth is known, and print each number beside its mark.

    python -m tools.measure.estimator            all of it, some minutes on one core
    python -m tools.measure.estimator --quick    a fifth of the runs

The wheel is that of drivers/sim/plant_batch.py, which integrates in fine steps of its own. NEES is the squared error of
the four parameters in the metric of the filter's covariance (4 is ideal, less is cautious); errors "in bounds" are RMS
errors over the Cramer-Rao bound of the same run. Exit status 1 if a mark is missed. Speed: `tools.measure.speed`.
"""

from __future__ import annotations

import argparse
import math
import platform
import sys
import time
from collections.abc import Iterable
from functools import lru_cache
from typing import Any

import numpy as np
from tqdm import tqdm

from rw_ekf.arrays import Float64Array
from rw_ekf.control.profiles import make_profile, sample_profile
from rw_ekf.course.course import Course
from rw_ekf.drivers.sim.plant_batch import simulate_run
from rw_ekf.drivers.sim.plant_parameters import PlantNoise, PlantParameters
from rw_ekf.filter.belief import DEFAULT_PRIOR, with_prior_table
from rw_ekf.filter.log_filter import filter_log
from rw_ekf.filter.smoother import smooth_log
from rw_ekf.identify.least_squares import least_squares
from rw_ekf.likelihood.log_fit import fit_log
from rw_ekf.likelihood.noise_posterior import NoisePosterior
from rw_ekf.model.state import CK13_STATISTICAL, PARAMETER_COUNT, PARAMETER_NAMES, PARAMETERS, SPEED, STATIC
from rw_ekf.units import RAD_S_PER_RPM
from tools.measure.runs import PUBLISHED, Run, constants_for, cramer_rao_std, prior_drawn_around
from tools.measure.table import Row, at_most, show

TRUTH = np.array(CK13_STATISTICAL)
LOW_SPEED = 100.0 * RAD_S_PER_RPM


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
    noise = np.random.default_rng([seed, PUBLISHED.index(profile)]).standard_normal(time_s.size)
    return Run(time_s, current_A, speed, speed + noise_rpm * RAD_S_PER_RPM * noise)


def rms(values: Iterable[float] | Float64Array) -> float:
    """Root mean square."""
    return math.sqrt(float(np.mean(np.square(np.asarray(list(values), dtype=np.float64)))))


def measure_filter(runs: int, advance: tqdm[Any]) -> list[Row]:
    """NEES, errors in bounds, low-speed error and smoothing, per profile at 1 rpm."""
    rows, constants = [], constants_for()
    for profile in PUBLISHED:
        nees, errors, low, whole, smoothed = [], [], [], [], []
        for seed in range(runs):
            run, prior = run_of(profile, seed), prior_drawn_around(CK13_STATISTICAL, seed)
            found = filter_log(
                run.course, constants, prior.mean, prior.covariance, keep_states=True, keep_history=profile == "P1"
            )
            error = found.mean[PARAMETERS] - TRUTH
            nees.append(float(error @ np.linalg.solve(found.covariance[PARAMETERS, PARAMETERS], error)))
            errors.append(error / cramer_rao_std(run, 1.0))
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
            found = least_squares(run.course, constants_for(noise_rpm), prior_drawn_around(CK13_STATISTICAL, seed))
            converged += found.converged
            errors.append((np.array(found.parameters) - TRUTH) / cramer_rao_std(run, noise_rpm))
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


def main(arguments: list[str] | None = None) -> int:
    """Measure and print; exit status 1 if a mark is missed."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", maxsplit=1)[0])
    parser.add_argument("--quick", action="store_true", help="a fifth of the runs")
    parser.add_argument("--runs", type=int, default=100, help="runs per profile (100)")
    options = parser.parse_args(arguments)
    share = 0.2 if options.quick else 1.0
    runs, trials = max(2, round(share * options.runs)), max(3, round(share * 120))
    batch, noise = max(2, round(share * 2 * options.runs)), max(2, round(share * 20))
    total = runs * len(PUBLISHED) + trials + 2 * batch + 3 * noise
    started = time.perf_counter()
    with tqdm(total=total, unit="run", file=sys.stderr) as advance:
        rows = [
            *measure_filter(runs, advance),
            *measure_robustness(trials, advance),
            *measure_batch(batch, advance),
            *measure_noise(noise, advance),
        ]
    print(f"{runs} runs per profile, Python {platform.python_version()}, {time.perf_counter() - started:.0f} s\n")
    show(rows)
    return 1 if any(row.met is False for row in rows) else 0


if __name__ == "__main__":
    sys.exit(main())
