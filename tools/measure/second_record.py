"""Measure how often 95 % intervals hold the truth where a model of one record is taken to a second one.

    python -m tools.measure.second_record --wheels 7 --first 500

Each wheel is diagnosed on one record (600 s of the identification profile, 1 rpm, 10 Hz, plant in steps of 0.2 ms);
`replay --model` and `fit --prior` then take that model to another, in which a spike begins 1.5 s (1 sigma) earlier or
later. Judged are gain, viscous and Coulomb friction, and the effect's size where the document has it in one number.
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

from rw_ekf.diagnosis.diagnose import diagnose_log
from rw_ekf.drivers.sim.plant_parameters import PlantParameters
from tools.measure.runs import INSIDE
from tools.proof.cases import Case
from tools.proof.plants import log_of, save_log

KINDS = {
    "drag_spike": "drag_spike:amplitude_rad_s2={size},onset_s={onset},decay_s=60",
    "friction_lag": "friction_lag:time_constant_s={size}",
    "viscous_temperature": "viscous_temperature:slope_1_K=-0.02",
}
SIZE = 0.09
_ONSETS_S, _APART_S = (200.0, 400.0), 1.5
_WAYS = {"replay": "--model", "fit": "--prior"}


def scores(kind: str, seed: int, directory: Path) -> dict[str, dict[str, float]]:
    """Errors in sigmas by number, for each way to take a model on; empty where the effect was not named."""
    draws = np.random.default_rng([17, seed])
    usual, (viscous, coulomb) = PlantParameters(), draws.uniform(0.85, 1.15, 2)
    coulomb *= usual.coulomb
    wheel = usual._replace(viscous=usual.viscous * viscous, coulomb=coulomb, static=1.05 * coulomb)
    onset_s = draws.uniform(*_ONSETS_S)
    logs = []
    for at in (onset_s, onset_s + draws.normal(0.0, _APART_S)):
        text, noise = KINDS[kind].format(size=SIZE, onset=at), int(draws.integers(1 << 30))
        warm = kind == "viscous_temperature"
        logs.append(
            log_of(Case("", "", "effects", (kind,), (text,), wheel, "identification", 7, noise, 1.0, telemetry=warm))
        )
    found = diagnose_log(logs[0])
    if found.model is None or kind not in found.document()["verdict"]["effects"]:
        return {}
    model, log = directory / f"{kind}-{seed}.yaml", directory / f"{kind}-{seed}.csv"
    model.write_text(found.model.to_text())
    save_log(logs[1], str(log))
    truth = {name: float(getattr(wheel, name)) for name in ("motor_gain", "viscous", "coulomb")}
    told = {}
    for way, option in _WAYS.items():
        command = [sys.executable, "-m", "rw_ekf", way, str(log), option, str(model), "--json"]
        done = subprocess.run(command, capture_output=True, text=True, check=True)
        told[way] = _off(json.loads(done.stdout), truth, kind)
    return told


def _off(document: dict[str, Any], truth: dict[str, float], kind: str) -> dict[str, float]:
    if "logs" in document:
        (entry,) = document["logs"]
        numbers = {name: (entry["state"][name], entry["std"][name]) for name in truth}
    else:
        entry = document
        numbers = {name: (entry["parameters"][name]["value"], entry["parameters"][name]["std"]) for name in truth}
    off = {name: (value - truth[name]) / std for name, (value, std) in numbers.items()}
    if "{size}" in KINDS[kind]:
        effect = entry["effects"][kind]
        off[kind] = (effect["value"] - SIZE) / effect["std"]
    return off


def main(arguments: list[str] | None = None) -> int:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", maxsplit=1)[0])
    parser.add_argument("--wheels", type=int, default=7, help="of each kind (7)")
    parser.add_argument("--first", type=int, default=0, help="first seed (0)")
    options = parser.parse_args(arguments)
    all_off: dict[str, list[float]] = {way: [] for way in _WAYS}
    with tempfile.TemporaryDirectory() as directory:
        for seed in range(options.first, options.first + options.wheels):
            for kind in KINDS:
                for way, off in scores(kind, seed, Path(directory)).items():
                    all_off[way] += off.values()
                    said = "  ".join(f"{name} {z:+.2f}" for name, z in off.items())
                    print(f"{seed} {kind:20} {way:7} {said}", flush=True)
    for way, numbers in all_off.items():
        z = np.array(numbers)
        print(
            f"{way:7} {z.size} numbers, coverage {np.mean(np.abs(z) < INSIDE):.3f}, rms z {np.sqrt(np.mean(z**2)):.2f},"
            f" worst {np.abs(z).max():.1f}"
        )
    return 0


if __name__ == "__main__":
    sys.exit(main())
