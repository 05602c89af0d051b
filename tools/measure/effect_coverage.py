"""Measure how often 95 % intervals of named effects' numbers hold the truth, kind by kind, and how wide they are.

    python -m tools.measure.effect_coverage --runs 30 --save out.jsonl         every kind: an hour on one core
    python -m tools.measure.effect_coverage --kinds offset_torque torque_ripple-logged --runs 10

Wheels, plant (0.2 ms) and sizes are those of tools.proof, each effect of 5 to 20 % of Coulomb friction where it acts
(or of half to twice the larger of the proof's sizes), so that nearly all are named: of those that are hardly seen the
ones that came out large alone would be; means are over windows of 0.2 to 0.6 s. 1 rpm at 10 Hz, 600 s of the
identification profile and 300 s of P2 in turn, torque noise of 0 and 0.02 rpm per sqrt(s) in turn. What is judged is
what the document says: values and standard deviations of an effect in the verdict. A ripple's are those of the line of
the right order, where there is one.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
from tqdm import tqdm

from rw_ekf.diagnosis.log_diagnosis import diagnose_log
from rw_ekf.drivers.sim.plant_parameters import PlantParameters
from rw_ekf.effects.catalogue import CATALOGUE, GRID
from tools.measure.runs import INSIDE
from tools.proof.cases import TEMPERATURE_IDS, Angle, Case, draw_wheel
from tools.proof.plants import log_of
from tools.proof.sizes import Reach, Size, effect_text, reach_of

LOGGED = "torque_ripple-logged"
KINDS = (*(name for name in CATALOGUE if name != GRID.id), LOGGED)
PROFILES = ("identification", "P2")
TORQUE_NOISES = (0.0, 0.02)  # rpm per sqrt(s)
_SHARES = (0.05, 0.20)  # of Coulomb friction
_RUNG, _RUNG_SHARE = 1, 0.10  # the larger size of the proof
_ORDERS = 12
_WINDOWS_S = (0.2, 0.6)  # at 10 Hz shorter ones are delays


@dataclass(frozen=True)
class Drawn:
    """One wheel with one effect, and the effect's numbers in truth."""

    kind: str
    effect: str
    truth: dict[str, float]
    case: Case


def drawn(kind: str, seed: int) -> Drawn:
    """What belongs to a kind and a seed, whatever else is measured."""
    draws = np.random.default_rng([*kind.encode(), seed])
    effect = kind.removesuffix("-logged")
    wheel = draw_wheel(draws, 0.03 if effect in ("stribeck_shape", "presliding_hysteresis", "friction_lag") else 0.0)
    profile, profile_seed = PROFILES[seed % 2], int(draws.integers(1, 100_000))
    share = float(np.exp(draws.uniform(*np.log(_SHARES))))
    size = Size(_RUNG, share, share / _RUNG_SHARE)
    text = _text(draws, effect, size, wheel, reach_of(wheel, profile, profile_seed))
    angle: Angle = "none"
    if kind == LOGGED:
        angle = "counted" if seed % 4 < 2 else "wrapped"
    case = Case(
        name=f"{kind}-{seed:03d}",
        mark="coverage",
        expects="effects",
        expected=(effect,),
        effects=(text,),
        wheel=wheel,
        profile=profile,
        profile_seed=profile_seed,
        seed=int(draws.integers(1 << 30)),
        noise_rpm=1.0,
        process_rpm=TORQUE_NOISES[seed // 2 % 2],
        telemetry=effect in TEMPERATURE_IDS,
        angle=angle,
    )
    numbers = dict(item.split("=") for item in text.split(":")[1].split(","))
    return Drawn(kind, effect, {name: float(value) for name, value in numbers.items() if name != "law"}, case)


def _text(draws: np.random.Generator, effect: str, size: Size, wheel: PlantParameters, reach: Reach) -> str:
    """As tools.proof.sizes has it, but ripples of all orders, a drift that keeps to its law, a curve of the usual."""
    if effect == "torque_ripple":
        order, phase = int(draws.integers(1, _ORDERS + 1)), draws.uniform(0.0, 2.0 * math.pi)
        return f"{effect}:amplitude_rad_s2={size.share * wheel.coulomb},order={order},phase_rad={phase}"
    if effect == "speed_averaging":
        return f"{effect}:window_s={np.exp(draws.uniform(*np.log(_WINDOWS_S)))}"
    text = effect_text(draws, effect, size, wheel, reach)
    while "wander" in text or "law=tustin" in text or "law=lorentz" in text:
        text = effect_text(draws, effect, size, wheel, reach)
    return text


def measure(job: tuple[str, int]) -> dict[str, Any]:
    """Diagnose one log: truth, what the document says of the effect, and what it named."""
    what = drawn(*job)
    log = log_of(what.case)
    before = time.process_time()
    document = diagnose_log(log).document()
    entry = next(item for item in document["candidates"] if item["effect"] == what.effect)
    verdict = document["verdict"]
    named = verdict["kind"] == "effect" and what.effect in verdict["effects"]
    return {
        "kind": what.kind,
        "seed": job[1],
        "profile": what.case.profile,
        "torque_noise": what.case.process_rpm,
        "verdict": verdict["kind"],
        "effects": verdict["effects"],
        "indistinguishable": verdict["indistinguishable"],
        "truth": what.truth,
        "found": entry["parameters"] if named else None,
        "seconds": time.process_time() - before,
    }


def reported(item: dict[str, Any]) -> dict[str, tuple[float, float, float]]:
    """(value, std, truth) of the numbers that were told with a standard deviation, by name; of the right order."""
    found, tail = item["found"], ""
    if found is None:
        return {}
    if "order" in item["truth"]:
        orders = {key.removeprefix("order"): v["value"] for key, v in found.items() if key.startswith("order")}
        tail = next((key for key, order in orders.items() if order == item["truth"]["order"]), "none")
    numbers = {}
    for name, truth in item["truth"].items():
        if (number := found.get(name + tail)) is not None and number["std"]:
            off = number["value"] - truth
            if name == "phase_rad":
                off = math.remainder(off, 2.0 * math.pi)
            numbers[name] = (truth + off, number["std"], truth)
    return numbers


def table_of(found: Sequence[dict[str, Any]]) -> list[str]:
    """A line for each number of each kind."""
    heads = "".join(f"{head:>9}" for head in ("named of", "told", "coverage", "rms z", "mean z", "worst", "sigma"))
    lines = [f"{'kind':22} {'number':18}{heads}"]
    for kind in KINDS:
        cell = [item for item in found if item["kind"] == kind]
        named = [item for item in cell if item["found"] is not None]
        if not cell:
            continue
        count = f"{len(named)} of {len(cell)}"
        names = dict.fromkeys(name for item in named for name in reported(item))
        if not names:
            lines.append(f"{kind:22} {'':18} {count:>9}")
        for name in names:
            value, std, truth = np.array([reported(item)[name] for item in named if name in reported(item)]).T
            z = (value - truth) / std
            lines.append(
                f"{kind:22} {name:18}{count:>9}{z.size:9d}{np.mean(np.abs(z) < INSIDE):9.2f}"
                f"{np.sqrt(np.mean(z**2)):9.2f}{z.mean():9.2f}{z[np.argmax(np.abs(z))]:9.1f}"
                f"{np.median(std / np.abs(truth)):9.3f}"
            )
    return lines


def main(arguments: list[str] | None = None) -> int:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", maxsplit=1)[0])
    parser.add_argument("--kinds", nargs="+", default=KINDS, choices=KINDS)
    parser.add_argument("--runs", type=int, default=30, help="wheels per kind (30)")
    parser.add_argument("--first", type=int, default=0, help="first seed (0)")
    parser.add_argument("--jobs", type=int, default=1, help="processes (1)")
    parser.add_argument("--save", type=Path, help="a line of JSON for every run, written as it ends")
    options = parser.parse_args(arguments)
    jobs = [(kind, seed) for seed in range(options.first, options.first + options.runs) for kind in options.kinds]
    found: list[dict[str, Any]] = []
    with get_context("spawn").Pool(options.jobs) as pool:
        for item in tqdm(pool.imap_unordered(measure, jobs), total=len(jobs), unit="run", file=sys.stderr):
            found.append(item)
            if options.save is not None:
                with options.save.open("a") as out:
                    out.write(json.dumps(item) + "\n")
    print("\n".join(table_of(found)))
    return 0


if __name__ == "__main__":
    sys.exit(main())
