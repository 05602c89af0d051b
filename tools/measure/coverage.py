"""Measure the sigmas of `replay` and `fit` from both sides: how often 95 % intervals hold the truth, and their width.

    python -m tools.measure.coverage --runs 40 --save out.json          every cell: an hour on one core
    python -m tools.measure.coverage --profiles P2 S1 --noises 0 --runs 10

Wheels are drawn around [CK13]'s, each uniformly within a share of it; they run on the plant of drivers/sim
(0.2 ms) with white torque noise, and are read with 1 rpm at 10 Hz. Each log goes through the verbs themselves, so that
what is judged is what a user gets. The bound is the a-posteriori one: information of the record at its true noises,
linearised along its true speeds, and that of the default prior.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import json
import math
import sys
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
from tqdm import tqdm

from rw_ekf.arrays import Float64Array
from rw_ekf.cli import main as rw_ekf
from rw_ekf.control.profiles import make_profile, sample_profile
from rw_ekf.course.course import Course
from rw_ekf.drivers.sim.plant_batch import PlantRun, simulate_run
from rw_ekf.drivers.sim.plant_parameters import PlantNoise, PlantParameters
from rw_ekf.filter.belief import DEFAULT_PRIOR
from rw_ekf.likelihood.linearisation import Noise, linearise
from rw_ekf.likelihood.model_vector import Model
from rw_ekf.likelihood.one_step import Record, Trajectory
from rw_ekf.model.state import CK13_STATISTICAL, PARAMETER_NAMES, PARAMETERS, FrictionParameters
from rw_ekf.units import RAD_S_PER_RPM
from tools.measure.runs import INSIDE, PUBLISHED, constants_for

RATE_HZ = 10.0
NOISE_RPM = 1.0
TORQUE_NOISES = (0.0, 0.03, 0.1)  # rpm per sqrt(s)
SPREAD = 0.15  # of a wheel's parameters around [CK13]'s
_SEEN = 0.5  # of the prior's sigma: a bound below says that the profile shows the parameter


def _creep(wheel: FrictionParameters, seed: int) -> Callable[[float], float]:
    """Just beyond break-away and back to rest, to either side by turns: 7 rpm at most."""
    hold_A = wheel.static / wheel.motor_gain

    def law(time_s: float) -> float:
        number, phase_s = divmod(time_s, 10.0)
        side = 1.0 if number % 2 == 0 else -1.0
        if phase_s < 4.0:
            return side * hold_A * 1.02 * phase_s / 4.0
        return side * hold_A * 1.12 if phase_s < 7.0 else 0.0

    return law


def _weak_sine(wheel: FrictionParameters, seed: int) -> Callable[[float], float]:
    """Barely moves to either side, and stops in between."""
    return lambda time_s: 1.3 * wheel.static / wheel.motor_gain * math.sin(2.0 * math.pi * time_s / 10.0)


def _dwell(wheel: FrictionParameters, seed: int) -> Callable[[float], float]:
    """Four speeds for a minute each, the current that holds them about right."""
    draws = np.random.default_rng([seed, 7])
    levels = draws.uniform(200.0, 1500.0, 5) * np.array([1.0, 1.0, -1.0, -1.0, 1.0])

    def law(time_s: float) -> float:
        speed = float(levels[min(int(time_s // 60.0), 4)]) * RAD_S_PER_RPM
        k, b, c, _ = wheel
        held = (c + b * abs(speed)) / k
        if time_s % 60.0 < 15.0:
            before = float(levels[int(time_s // 60.0) - 1]) * RAD_S_PER_RPM if time_s >= 60.0 else 0.0
            return math.copysign(held, speed) + (speed - before) / 15.0 / k
        return math.copysign(held, speed)

    return law


def _chirp(wheel: FrictionParameters, seed: int) -> Callable[[float], float]:
    """A sine from 0.01 to 0.5 Hz in 300 s."""
    return lambda time_s: 0.12 * math.sin(2.0 * math.pi * (0.01 * time_s + 0.49 * time_s * time_s / 600.0))


def _one_way(wheel: FrictionParameters, seed: int) -> Callable[[float], float]:
    """Steps of current at high speed that never take the wheel near rest."""
    levels = np.random.default_rng([seed, 8]).uniform(0.0, 0.2, 15)
    return lambda time_s: float(levels[min(int(time_s // 20.0), 14)])


MADE = {"creep": _creep, "weak-sine": _weak_sine, "dwell": _dwell, "chirp": _chirp, "one-way": _one_way}
PROFILES = (*PUBLISHED, "identification", *MADE)
VERBS = ("replay", "fit")
_MADE_S = 300.0
_ONE_WAY_START_RPM = 1500.0


@dataclass(frozen=True)
class Case:
    """One run of one cell."""

    profile: str
    torque_noise_rpm: float
    seed: int
    spread: float = SPREAD

    @property
    def wheel(self) -> FrictionParameters:
        """Drawn anew for each seed; break-away friction is 1 to 6 % above Coulomb friction."""
        draws = np.random.default_rng([self.seed, 2])
        k, b, c = np.array(CK13_STATISTICAL[:3]) * draws.uniform(1.0 - self.spread, 1.0 + self.spread, 3)
        return FrictionParameters(float(k), float(b), float(c), float(c * draws.uniform(1.01, 1.06)))


def run_of(case: Case) -> PlantRun:
    """Simulate the case."""
    wheel = case.wheel
    if case.profile in MADE:
        time_s = np.arange(0.0, _MADE_S, 1.0 / RATE_HZ)
        law = MADE[case.profile](wheel, case.seed)
        current_A = np.array([law(float(t)) for t in time_s])
    else:
        sampled = sample_profile(make_profile(case.profile, seed=case.seed), RATE_HZ)
        time_s, current_A = np.array(sampled[0]), np.array(sampled[1])
    return simulate_run(
        PlantParameters(*wheel),
        current_A,
        time_s,
        PlantNoise(NOISE_RPM * RAD_S_PER_RPM, case.torque_noise_rpm * RAD_S_PER_RPM),
        seed=case.seed + 100_000,
        initial_speed_rad_s=_ONE_WAY_START_RPM * RAD_S_PER_RPM if case.profile == "one-way" else 0.0,
    )


def bound_of(case: Case, run: PlantRun) -> Float64Array:
    """Least standard deviations of k, b, c, s that record and default prior leave, at the true noises, (4,)."""
    course = Course.of(run.time_s, run.measured_speed_rad_s, run.current_command_A)
    constants = constants_for(NOISE_RPM)
    everything = np.ones(course.samples, dtype=bool)
    R = (NOISE_RPM * RAD_S_PER_RPM) ** 2
    q = (case.torque_noise_rpm * RAD_S_PER_RPM) ** 2
    model = Model(case.wheel, constants.stribeck)
    exact = Trajectory.of_speed(run.speed_rad_s, np.full(course.samples, 1.0e-3 * math.sqrt(R)))
    linearised = linearise(Record.of(course, everything, constants), model, exact, Noise(R, 0.0), ~everything)
    linearised.chain.extra[:] = 0.0
    ratio = max(q / RATE_HZ / R, 1.0e-12)
    _, A, _ = linearised.whitened(ratio, R, linearised.jacobian, linearised.memory_jacobian)
    prior = np.linalg.inv(DEFAULT_PRIOR.parameter_covariance)
    return np.asarray(np.sqrt(np.diag(np.linalg.inv(A.T @ A + prior))))


def document_of(arguments: list[str]) -> dict[str, Any]:
    """What a verb prints with --json."""
    out = io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(io.StringIO()):
        rw_ekf([*arguments, "--json"])
    return json.loads(out.getvalue())  # type: ignore[no-any-return]


def _write(run: PlantRun, path: Path) -> None:
    rows = np.column_stack([run.time_s, run.measured_speed_rad_s, run.current_command_A])
    np.savetxt(path, rows, delimiter=",", header="time_s,speed_rad_s,current_command_A", comments="", fmt="%.9g")


def measure(case: Case, verbs: Sequence[str]) -> dict[str, Any]:
    """Values and covariances by each verb for one case, with truth and bound."""
    run = run_of(case)
    found: dict[str, Any] = {
        "profile": case.profile,
        "torque_noise": case.torque_noise_rpm,
        "seed": case.seed,
        "truth": list(case.wheel),
        "bound": bound_of(case, run).tolist(),
    }
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "run.csv"
        _write(run, path)
        if "replay" in verbs:
            replay = document_of(["replay", str(path)])["logs"][0]
            found["replay"] = {
                "value": [replay["state"][name] for name in PARAMETER_NAMES],
                "covariance": [row[PARAMETERS] for row in replay["covariance"][PARAMETERS]],
            }
        if "fit" in verbs:
            fit = document_of(["fit", str(path)])
            found["fit"] = {
                "value": [fit["parameters"][name]["value"] for name in PARAMETER_NAMES],
                "covariance": fit["covariance"],
            }
    return found


def table_of(found: list[dict[str, Any]]) -> list[str]:
    """A line for each verb and cell; * where the profile does not show the parameter."""
    prior = np.sqrt(np.diag(DEFAULT_PRIOR.parameter_covariance))
    heads = ("coverage of k b c s", "rms of z", "most |z|", "sigma/bound, median", "NEES, most")
    lines = [f"{'verb':7} {'profile':15} {'q':>5}  " + "  ".join(f"{head:24}" for head in heads)]
    for verb in VERBS:
        for profile in PROFILES:
            for q in sorted({item["torque_noise"] for item in found}):
                cell = [
                    item for item in found if (item["profile"], item["torque_noise"]) == (profile, q) and verb in item
                ]
                if not cell:
                    continue
                truth, bound = (np.array([item[name] for item in cell]) for name in ("truth", "bound"))
                error = np.array([item[verb]["value"] for item in cell]) - truth
                covariance = np.array([item[verb]["covariance"] for item in cell])
                std = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))
                z = error / std
                nees = np.einsum("ij,ij->i", error, np.linalg.solve(covariance, error[:, :, None])[:, :, 0])
                wide = np.median(std / bound, axis=0)
                shown = np.median(bound, axis=0) < _SEEN * prior
                inside = (np.abs(z) < INSIDE).mean(axis=0)
                text = [
                    " ".join(f"{v:5.2f}" + ("" if s else "*") for v, s in zip(inside, shown, strict=True)),
                    " ".join(f"{v:5.2f}" for v in np.sqrt((z**2).mean(axis=0))),
                    " ".join(f"{v:5.1f}" for v in np.abs(z).max(axis=0)),
                    " ".join(f"{v:5.2f}" for v in wide),
                    f"{nees.mean():5.1f} {nees.max():6.1f}",
                ]
                lines.append(f"{verb:7} {profile:15} {q:5.2f}  " + "  ".join(f"{t:24}" for t in text))
    return lines


def main(arguments: list[str] | None = None) -> int:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", maxsplit=1)[0])
    parser.add_argument("--runs", type=int, default=40, help="wheels per cell (40)")
    parser.add_argument("--first", type=int, default=0, help="first seed (0)")
    parser.add_argument("--profiles", nargs="+", default=PROFILES, choices=PROFILES)
    parser.add_argument("--noises", nargs="+", type=float, default=TORQUE_NOISES, help="torque noises, rpm per sqrt(s)")
    parser.add_argument("--verbs", nargs="+", default=VERBS, choices=VERBS)
    parser.add_argument("--spread", type=float, default=SPREAD, help="of the wheels around the default one (0.15)")
    parser.add_argument("--jobs", type=int, default=1, help="processes (1)")
    parser.add_argument("--save", type=Path, help="write every run as JSON")
    options = parser.parse_args(arguments)
    seeds = range(options.first, options.first + options.runs)
    cases = [Case(p, q, seed, options.spread) for p in options.profiles for q in options.noises for seed in seeds]
    found: list[dict[str, Any]] = []
    with get_context("spawn").Pool(options.jobs) as pool:
        for item in tqdm(
            pool.imap_unordered(partial(measure, verbs=options.verbs), cases),
            total=len(cases),
            unit="run",
            file=sys.stderr,
        ):
            found.append(item)
            if options.save is not None and len(found) % 100 == 0:
                options.save.write_text(json.dumps(found))
    if options.save is not None:
        options.save.write_text(json.dumps(found))
    print("\n".join(table_of(found)))
    return 0


if __name__ == "__main__":
    sys.exit(main())
