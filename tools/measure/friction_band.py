"""Measure how often the 95 % band of the friction torque holds the truth, over the speeds that a wheel was seen at.

    python -m tools.measure.friction_band --wheels 10 --first 500

Wheels with a bump of the drag (place, width and height drawn) and with laws of the speed that are in no catalogue, by
the integrator of tools/proof/uncatalogued_laws.py. Each is diagnosed on one record; the library's Estimator then starts
with the model, and runs over a second one. Beside it the band without what the model considers: shapes and curves
taken for known.
"""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from typing import NamedTuple

import numpy as np

import rw_ekf
from rw_ekf.arrays import Float64Array
from rw_ekf.diagnosis.log_diagnosis import diagnose_log
from rw_ekf.records import Estimate
from rw_ekf.units import RAD_S_PER_RPM
from rw_ekf.wheel.model_file import WheelModel
from tools.measure.runs import INSIDE
from tools.proof import uncatalogued_laws as plant
from tools.proof.uncatalogued_laws import Law, Made, Met, Nameless

LAWS = ("speed, root", "speed, step", "speed, wave", "coulomb by speed")
_SLOWEST_RAD_S, _STEP_RAD_S = 8.0, 2.0
_USUAL = Met(0.0, 0.0, 0.0, 20.0, 28.0, 400.0, 0.5)


@dataclass(frozen=True)
class Bumpy(Nameless):
    """A wheel with more drag around one speed."""

    @property
    def law(self) -> Law:
        """A bump as its seed draws it."""
        random = np.random.default_rng([self.seed % 1000, 99])  # its second record is the same wheel's
        speed, width, height = random.uniform(25.0, 110.0), random.uniform(3.0, 18.0), random.uniform(0.05, 0.2)
        return partial(_bump, speed, width, height * plant.C)


class Held(NamedTuple):
    """Share of the speeds at which the band holds the truth, and how far off it is at the worst, in sigmas."""

    share: float
    worst: float


class Wheel(NamedTuple):
    """What one wheel gave: as the filter starts, behind a second record, and then without what is considered."""

    name: str
    effects: list[str]
    start: Held
    behind: Held
    alone: Held


def _bump(speed: float, width: float, height: float, met: Met) -> Made:
    return Made(drag=height * math.exp(-(((abs(met.omega) - speed) / width) ** 2)))


def true_friction(law: Law, speed: float) -> float:
    """Of the plant, per unit inertia [rad/s^2]."""
    made = law(_USUAL._replace(omega=speed))
    bump = math.exp(-((speed / (4.0 * RAD_S_PER_RPM)) ** 2))
    dry = plant.C + (plant.S - plant.C) * bump + made.drag
    return math.copysign(dry, speed) + plant.B * speed + made.torque


def _held(estimate: Estimate, law: Law, speeds: Float64Array) -> Held:
    found = [estimate.friction_torque_rad_s2(float(speed)) for speed in speeds]
    off = [(item.value - true_friction(law, speed)) / item.std for item, speed in zip(found, speeds, strict=True)]
    return Held(float(np.mean(np.abs(off) < INSIDE)), float(np.max(np.abs(off))))


def _estimates(model: WheelModel, case: Nameless) -> tuple[Estimate, Estimate]:
    """At the first sample of a record, and at its last."""
    log, estimator = case.log(), rw_ekf.Estimator(model)
    rows = zip(log.time_s.tolist(), log.speed_rad_s.tolist(), log.current_A.tolist(), strict=True)
    found = [estimator.step(*row) for row in rows]
    return found[0], found[-1]


def measured(case: Nameless) -> Wheel | None:
    """Diagnose one record, run over the next; None where nothing was found."""
    log = case.log()
    found = diagnose_log(log)
    if found.model is None:
        return None
    top = float(np.quantile(np.abs(log.speed_rad_s), 0.98))
    one_way = np.arange(_SLOWEST_RAD_S, top, _STEP_RAD_S)
    speeds, following = np.concatenate((-one_way, one_way)), replace(case, seed=case.seed + 1000)
    first, last = _estimates(found.model, following)
    bare = replace(found.model, effects=replace(found.model.effects, considered=()))
    alone = _estimates(bare, following)[1]
    reported = [_held(estimate, case.law, speeds) for estimate in (first, last, alone)]
    return Wheel(case.name, list(found.document()["verdict"]["effects"]), *reported)


def main(arguments: Sequence[str] | None = None) -> int:
    """Print a line a wheel, and the shares."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", maxsplit=1)[0])
    parser.add_argument("--wheels", type=int, default=10, help="with a bump (10); a fifth as many of each law")
    parser.add_argument("--first", type=int, default=500, help="first seed (500)")
    parser.add_argument("--jobs", type=int, default=1)
    options = parser.parse_args(arguments)
    seeds = range(options.first, options.first + options.wheels)
    cases: list[Nameless] = [Bumpy("bump", seed) for seed in seeds]
    cases += [Nameless(name, seed) for name in LAWS for seed in seeds[: max(options.wheels // 5, 1)]]
    found: list[Wheel] = []
    with ProcessPoolExecutor(options.jobs) as pool:
        for case, wheel in zip(cases, pool.map(measured, cases), strict=True):
            if wheel is None:
                print(f"{case.name:18} {case.seed:5d} nothing found", flush=True)
                continue
            found.append(wheel)
            reported = "   ".join(f"{held.share:.2f} worst {held.worst:5.1f}" for held in wheel[2:])
            print(f"{case.name:18} {case.seed:5d} {'+'.join(wheel.effects):26} {reported}", flush=True)
    for kind in ("bumps", "laws"):
        group = [wheel for wheel in found if (wheel.name == "bump") == (kind == "bumps")]
        for when in ("start", "behind", "alone") if group else ():
            held = [getattr(wheel, when) for wheel in group]
            share, worst = np.mean([item.share for item in held]), np.median([item.worst for item in held])
            print(f"{kind:6} {when:7} inside 95 % at {share:.3f} of the speeds, worst of a wheel (median) {worst:.1f}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
