"""Measure how often 95 % intervals hold the truth where a model of one record is taken to a second one.

    python -m tools.measure.second_record --wheels 7 --first 500 [--kinds friction_lag drag_spike]

Wheels of an effect each, none of them like another: coverage over kinds that share a wheel's noise is one draw of it.
Each is diagnosed on one record (600 s of the identification profile, 1 rpm, 10 Hz, plant in steps of 0.2 ms);
`replay --model` and `fit --prior` then take that model to another, in which a spike begins 1.5 s (1 sigma) earlier or
later. Judged are the four parameters (break-away friction not beside another Stribeck curve, which is a part of it) and
the effect's size.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from rw_ekf.diagnosis.log_diagnosis import diagnose_log
from rw_ekf.drivers.sim.plant_parameters import PlantParameters
from rw_ekf.model.state import PARAMETER_NAMES
from tools.measure.runs import INSIDE
from tools.proof.cases import Case
from tools.proof.plants import log_of, save_log

KINDS = {  # the coefficient's name, its value, and what the plant is told beside it
    "drag_spike": ("amplitude_rad_s2", 0.09, ",onset_s={onset},decay_s=60"),
    "friction_lag": ("time_constant_s", 0.09, ""),
    "viscous_temperature": ("slope_1_K", -0.02, ""),
    "coulomb_temperature": ("slope_1_K", -0.01, ""),
    "motor_gain_temperature": ("slope_1_K", -0.002, ""),
    "offset_torque": ("torque_rad_s2", 0.05, ""),
    "viscous_asymmetry": ("difference_1_s", 0.0003, ""),
    "quadratic_drag": ("coefficient_1_rad", 1.5e-6, ""),
    "cubic_drag": ("coefficient_s_rad2", 8.0e-9, ""),
    "motor_saturation": ("slope_1_A", 0.05, ""),
    "current_deadzone": ("width_A", 0.003, ""),
    "actuator_lag": ("time_constant_s", 0.08, ""),
    "transport_delay": ("delay_s", 0.06, ""),
    "presliding_hysteresis": ("deflection_rad", 0.04, ""),
    "stribeck_shape": ("speed_rad_s", 1.2, ""),
}
_ONSETS_S, _APART_S = (200.0, 400.0), 1.5
_WAYS = {"replay": "--model", "fit": "--prior"}


def scores(kind: str, seed: int, directory: Path) -> dict[str, dict[str, float]]:
    """Errors in sigmas by number, for each way to take a model on; empty where the effect was not named."""
    draws = np.random.default_rng([17, seed, list(KINDS).index(kind)])  # of a wheel and noise of its own
    usual, (viscous, coulomb) = PlantParameters(), draws.uniform(0.85, 1.15, 2)
    coulomb *= usual.coulomb
    wheel = usual._replace(viscous=usual.viscous * viscous, coulomb=coulomb, static=1.05 * coulomb)
    onset_s = draws.uniform(*_ONSETS_S)
    logs = []
    for at in (onset_s, onset_s + draws.normal(0.0, _APART_S)):
        (name, value, more), noise = KINDS[kind], int(draws.integers(1 << 30))
        text, warm = f"{kind}:{name}={value}{more.format(onset=at)}", kind.endswith("_temperature")
        logs.append(
            log_of(Case("", "", "effects", (kind,), (text,), wheel, "identification", 7, noise, 1.0, telemetry=warm))
        )
    found = diagnose_log(logs[0])
    if found.model is None or kind not in found.document()["verdict"]["effects"]:
        return {}
    model, log = directory / f"{kind}-{seed}.yaml", directory / f"{kind}-{seed}.csv"
    model.write_text(found.model.to_text())
    save_log(logs[1], str(log))
    judged = [name for name in PARAMETER_NAMES if (kind, name) != ("stribeck_shape", "static")]
    truth = {name: float(getattr(wheel, name)) for name in judged}
    reported = {}
    for way, option in _WAYS.items():
        command = [sys.executable, "-m", "rw_ekf", way, str(log), option, str(model), "--json"]
        done = subprocess.run(command, capture_output=True, text=True, check=True)
        reported[way] = _off(json.loads(done.stdout), truth, kind)
    return reported


def _off(document: dict[str, Any], truth: dict[str, float], kind: str) -> dict[str, float]:
    if "logs" in document:
        (entry,) = document["logs"]
        numbers = {name: (entry["state"][name], entry["std"][name]) for name in truth}
    else:
        entry = document
        numbers = {name: (entry["parameters"][name]["value"], entry["parameters"][name]["std"]) for name in truth}
    off = {name: (value - truth[name]) / std for name, (value, std) in numbers.items()}
    effect = entry["effects"][kind]
    return off | {kind: (effect["value"] - KINDS[kind][1]) / effect["std"]}


def main(arguments: list[str] | None = None) -> int:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", maxsplit=1)[0])
    parser.add_argument("--wheels", type=int, default=7, help="of each kind (7)")
    parser.add_argument("--first", type=int, default=0, help="first seed (0)")
    parser.add_argument("--kinds", nargs="+", choices=list(KINDS), default=list(KINDS), metavar="EFFECT")
    options = parser.parse_args(arguments)
    all_off: dict[str, list[float]] = {way: [] for way in _WAYS}
    with tempfile.TemporaryDirectory() as directory:
        for seed in range(options.first, options.first + options.wheels):
            for kind in options.kinds:
                for way, off in scores(kind, seed, Path(directory)).items():
                    all_off[way] += off.values()
                    stated = "  ".join(f"{name} {z:+.2f}" for name, z in off.items())
                    print(f"{seed} {kind:20} {way:7} {stated}", flush=True)
    for way, numbers in all_off.items():
        z = np.array(numbers)
        print(
            f"{way:7} {z.size} numbers, coverage {np.mean(np.abs(z) < INSIDE):.3f}, rms z {np.sqrt(np.mean(z**2)):.2f},"
            f" worst {np.abs(z).max():.1f}"
        )
    return 0


if __name__ == "__main__":
    sys.exit(main())
