"""Tune compensations by one rule: python -m tools.measure.tune_schemes [SCHEME ...] [--budget 60].

Wheel: the default scenario's, but drawn within 15 % of its data sheet, seed 0, which no contest is judged on. Cost:
the mean over both noises of

    peak attitude error [deg] in the 120 s from the reversal on + 0.05 deg per (A/s) of chatter in them,

chatter the sum of |I_k+1 - I_k| over the time. Every scheme gets the same number of trials, in the box it declares,
in logarithms: half of them spread evenly (Halton, seeded), half by Nelder-Mead from the best of those. What is found
is rounded to two digits; a scheme keeps what it has where that costs no more.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable, Mapping

import numpy as np
from scipy.optimize import minimize
from scipy.stats import qmc

from rw_ekf.arrays import Float64Array
from rw_ekf.attitude_bench.bench_run import BenchRun
from rw_ekf.attitude_bench.bench_start import run_scheme
from rw_ekf.attitude_bench.metrics import metrics_of
from rw_ekf.attitude_bench.scenario import Scenario
from rw_ekf.control.compensation.schemes import SCHEMES, SchemeEntry

TRAINING_SEED = 0
SPREAD_PERCENT = 15.0
CHATTER_DEG_S_PER_A = 0.05

Trial = Mapping[str, float]


def training_scenario() -> Scenario:
    """The default scenario with a wheel that is not its data sheet's."""
    return Scenario().changed("wheel", spread_percent=SPREAD_PERCENT)


def cost_deg(run: BenchRun) -> float:
    """Peak attitude error [deg] and the price of chatter; infinite where the wheel never reversed."""
    figures = metrics_of(run)
    if math.isnan(figures.peak_deg):
        return math.inf
    return figures.peak_deg + CHATTER_DEG_S_PER_A * figures.chatter_A_per_s


def mean_cost_deg(entry: SchemeEntry, scenario: Scenario, trial: Trial) -> float:
    """The rule's cost [deg] of one trial."""
    noises = scenario.cycle.speed_noise_rpm
    runs = [run_scheme(entry, scenario, noise_rpm, TRAINING_SEED, parameters=trial) for noise_rpm in noises]
    return float(np.mean([cost_deg(run) for run in runs]))


def searched(cost: Callable[[Trial], float], box: Mapping[str, tuple[float, float]], budget: int) -> dict[str, float]:
    """The cheapest of `budget` trials in a box, rounded to two digits."""
    names = list(box)
    low, high = np.log(np.array([box[name] for name in names])).T
    found: dict[tuple[float, ...], float] = {}

    def price(x: Float64Array) -> float:
        values = tuple(float(f"{value:.2g}") for value in np.exp(np.clip(x, low, high)))
        if values not in found:
            found[values] = cost(dict(zip(names, values, strict=True)))
        return found[values]

    spread = qmc.scale(qmc.Halton(len(names), seed=TRAINING_SEED).random(max(budget // 2, 1)), low, high)
    first = min(spread, key=price)
    ring = np.clip(first + np.vstack([np.zeros(len(names)), 0.1 * np.diag(high - low)]), low, high)
    minimize(
        price,
        first,
        method="Nelder-Mead",
        bounds=list(zip(low, high, strict=True)),
        options={"maxfev": budget - len(spread), "initial_simplex": ring, "xatol": 0.01, "fatol": 1e-5},
    )
    return dict(zip(names, min(found, key=lambda values: found[tuple(values)]), strict=True))


def main() -> None:
    """Tune the schemes that are named, or all that have anything to tune; say what was found."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("schemes", nargs="*", metavar="SCHEME", choices=[[], *SCHEMES], help="by id; default: all")
    parser.add_argument("--budget", type=int, default=60, help="trials of each scheme, two runs each (default: 60)")
    options = parser.parse_args()
    scenario = training_scenario()
    for name in options.schemes or [name for name, entry in SCHEMES.items() if entry.tunable]:
        entry = SCHEMES[name]

        def cost(trial: Trial, entry: SchemeEntry = entry) -> float:
            return mean_cost_deg(entry, scenario, trial)

        before = cost({})
        if not entry.tunable:
            print(f"{name:22} cost {before:.4f} deg, nothing to tune", flush=True)
            continue
        best = searched(cost, entry.tunable, options.budget)
        after = cost(best)
        advice = "" if after < before else "  (no better: kept)"
        values = ", ".join(f"{key}={value:g}" for key, value in best.items())
        print(f"{name:22} cost {before:.4f} -> {after:.4f} deg with {values}{advice}", flush=True)


if __name__ == "__main__":
    main()
