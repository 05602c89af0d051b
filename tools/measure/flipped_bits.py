"""Flip bits in the files of a run, one at a time, and count the numbers that change without a word.

    python -m tools.measure.flipped_bits [--times 1000] [--seed 1] [--alone]

A wheel is simulated, driven for ten minutes on a virtual clock, and logged in four parts, three of them compressed.
Each flip is of one bit in one of the run's files, drawn by size from its parts, plain and compressed, its estimates and
its checksums, and one time in five from its YAML files. Then everything is read: an error, a warning, the same numbers,
or what must not be. --alone: compressed parts only, each copied to a place without the run's checksums.
"""

from __future__ import annotations

import argparse
import random
import shutil
import sys
import tempfile
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
from tqdm import tqdm

from rw_ekf.clock import VirtualClock
from rw_ekf.drivers.sim.plant_parameters import PlantNoise
from rw_ekf.drivers.sim.simulated_wheel import SimulatedProtocol, SimulatedWheel
from rw_ekf.errors import RwEkfError
from rw_ekf.learning.run_start import GivenModel
from rw_ekf.live.daemon import Task, run_daemon
from rw_ekf.live.stop_signal import StopSignal
from rw_ekf.log_replay import setup_of_run
from rw_ekf.logs.column_map import ColumnMap
from rw_ekf.logs.metadata import read_metadata
from rw_ekf.logs.parts import beside
from rw_ekf.logs.reader import read_table
from rw_ekf.settings.load import load_configuration
from rw_ekf.units import RAD_S_PER_RPM
from rw_ekf.wheel.model_file import read_model
from tools.measure.soak import Reported

_CONFIGURATION = """\
wheel: {port: DIRECTORY/nowhere}
limits: {current_A: 0.6, silence_s: 1.5}
command: {profile: random-sines, amplitude_A: 0.1, period_s: 40.0}
output: {directory: DIRECTORY/runs, part_hours: 0.05}
"""
_YAML_SHARE = 0.2


def main() -> int:
    """Print what became of the flips; exit status 1 where one changed a number in silence."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--times", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--alone", action="store_true")
    args = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="rw-ekf-flips-") as name:
        counts, silent = flip_often(made_run(Path(name)), args.times, args.seed, alone=args.alone)
    for (kind, what), number in sorted(counts.items()):
        print(f"{kind:22}{what:12}{number:7}")
    for text in silent:
        print(text)
    print(f"{len(silent)} of {args.times} flipped bits changed a number in silence")
    return 1 if silent else 0


def made_run(directory: Path, seconds: float = 600.0) -> Path:
    """Let a daemon drive a simulated wheel; gives its log."""
    clock = VirtualClock()
    wheel = SimulatedWheel(noise=PlantNoise(RAD_S_PER_RPM), seed=1, clock=clock, fine_step_s=0.02)
    path = directory / "wheel.yaml"
    path.write_text(_CONFIGURATION.replace("DIRECTORY", str(directory)), encoding="utf-8")
    with StopSignal() as stop:
        protocol = SimulatedProtocol(wheel)
        outcome = run_daemon(Task(load_configuration(path), protocol, GivenModel(), seconds), Reported(), stop, clock)
    return outcome.files.log


def flip_often(log: Path, times: int, seed: int, *, alone: bool = False) -> tuple[Counter[tuple[str, str]], list[str]]:
    """Flip so many bits of the run's files, one at a time: counts by kind of file and what came of it; silent ones."""
    draw = random.Random(seed)
    if alone:
        place = log.parent / "alone"
        place.mkdir()
        files = [Path(shutil.copy(part, place)) for part in sorted(log.parent.glob("*.zst"))]
    else:
        files = sorted(path for path in log.parent.iterdir() if path.name.startswith(log.stem))
        files = [path for path in files if path.suffix != ".jsonl"]
    yamls = [path for path in files if path.suffix == ".yaml"]
    tables = [path for path in files if path.suffix != ".yaml"]
    before = {path: _read(path, log, alone=alone) for path in files}
    counts: Counter[tuple[str, str]] = Counter()
    silent = []
    for _ in tqdm(range(times), file=sys.stderr, disable=not sys.stderr.isatty()):
        from_yaml = bool(yamls) and draw.random() < _YAML_SHARE
        file = draw.choice(yamls) if from_yaml else draw.choices(tables, [path.stat().st_size for path in tables])[0]
        whole = file.read_bytes()
        bit = draw.randrange(8 * len(whole))
        content = bytearray(whole)
        content[bit // 8] ^= 1 << bit % 8
        file.write_bytes(content)
        try:
            what = _what_came(before[file], _read(file, log, alone=alone))
        except RwEkfError:
            what = "error"
        file.write_bytes(whole)
        counts["".join(file.suffixes[-2:]), what] += 1
        if what == "SILENT":
            silent.append(f"{file.name}: bit {bit % 8} of byte {bit // 8}")
    return counts, silent


def _read(file: Path, log: Path, *, alone: bool) -> tuple[dict[str, Any], list[str]]:
    """Everything that a file says to who reads the run, and the warnings."""
    if file.suffix != ".yaml":
        paths = [file] if alone else [log, beside(log, "estimates.csv")]
        tables = [read_table(path, ColumnMap()) for path in paths]
        numbers = {
            f"{at}{name}": table.columns[i] for at, table in enumerate(tables) for i, name in enumerate(table.names)
        }
        return numbers, [text for table in tables for text in table.warnings]
    if file.name.endswith((".start.yaml", ".meta.yaml")):
        setup = setup_of_run(log)
        about = read_metadata(log)
        stated = {"constants": setup.constants, "mean": setup.prior.mean.tolist(), "about": about}
        return stated | {"covariance": setup.prior.covariance.tolist(), "effects": setup.effects}, list(setup.notes)
    model = read_model(file)
    return model.document(), list(model.remarks)


def _what_came(before: tuple[dict[str, Any], list[str]], after: tuple[dict[str, Any], list[str]]) -> str:
    if set(after[1]) - set(before[1]):
        return "warning"
    same = before[0].keys() == after[0].keys() and all(_same(before[0][key], after[0][key]) for key in before[0])
    return "same" if same else "SILENT"


def _same(one: Any, other: Any) -> bool:
    if hasattr(one, "to_pylist"):
        return bool(one.equals(other)) or repr(one.to_pylist()) == repr(other.to_pylist())
    return bool(np.array_equal(one, other)) if isinstance(one, np.ndarray) else one == other


if __name__ == "__main__":
    sys.exit(main())
