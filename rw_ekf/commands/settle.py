"""`rw-ekf excite --settle`: the motion that distinguishes what a diagnosis left open, designed, shown, and made."""

from __future__ import annotations

import argparse
import os
import shlex
import sys
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rw_ekf.settings.schema import Configuration
    from rw_ekf.settle.motion_limits import MotionLimits
    from rw_ekf.settle.named_moves import Bounds
    from rw_ekf.settle.predicted import Scene
    from rw_ekf.settle.settle_plan import Plan


def settle(configuration: Configuration, args: argparse.Namespace) -> int:
    """Design the motion, print it where nothing is to be moved, else run it; raises RwEkfError.

    Exit status 1 where no motion distinguishes the explanations.
    """
    from rw_ekf.commands.answer import answer
    from rw_ekf.commands.first_use import make_ready
    from rw_ekf.commands.run import Planned, run_and_report
    from rw_ekf.compile_ahead import DIAGNOSIS
    from rw_ekf.errors import RwEkfError
    from rw_ekf.settings.schema import CompensationSection
    from rw_ekf.settle.motion_limits import MotionLimits, bounds_of, refuse_hot
    from rw_ekf.settle.predicted import Scene
    from rw_ekf.settle.settle_plan import commander_for, write_motion
    from rw_ekf.settle.standing_explanations import read_standing

    scene = Scene(read_standing(args.settle), 1.0 / configuration.loop.rate_hz)
    bounds = bounds_of(configuration)
    refuse_hot(scene, configuration)
    make_ready(DIAGNOSIS)
    plan = _designed(scene, bounds, MotionLimits.of(configuration), args.seed)
    if args.dry_run:
        answer(args, plan.document, plan.text)
        return 0 if plan.separates else 1
    if not plan.separates:
        raise RwEkfError(plan.refusal())
    sys.stderr.write(plan.text() + "\n")
    path = write_motion(plan)
    command = configuration.command.model_copy(update={"profile": "log", "log": str(path)})
    logs = " ".join(_from_here(log, args.settle) for log in plan.scene.standing.logs)
    return run_and_report(
        configuration.model_copy(update={"command": command, "compensation": CompensationSection()}),
        args,
        planned=Planned(
            commander_for(plan, configuration),
            {"settle": plan.document()},
            lambda log: f"  both together: rw-ekf diagnose {logs} {log}",
        ),
    )


def _from_here(log: str, diagnosis: str) -> str:
    """A log as this folder sees it: a diagnosis names it as seen from where it was made, which may be above it."""
    folder = Path(diagnosis).absolute().parent
    found = (place / log for place in (Path(), folder.parent, folder) if (place / log).is_file())
    return shlex.quote(os.path.relpath(path) if (path := next(found, None)) else log)


def _designed(scene: Scene, bounds: Bounds, limits: MotionLimits, seed: int | None) -> Plan:
    from rw_ekf.console import progress
    from rw_ekf.errors import RwEkfError
    from rw_ekf.settle.search import LOOKED_AT, design_motion
    from rw_ekf.settle.settle_plan import Plan

    base = scene.standing.explanations[0].model.parameters
    with progress("designing the motion", LOOKED_AT) as bar:
        design = design_motion(scene, base, bounds, limits, 1 if seed is None else seed, lambda: bar.update(1))
    if design is None:
        raise RwEkfError(
            "no motion keeps to the limits of the configuration: widen limits.speed_rpm or temperature_degC"
        )
    return Plan(scene, design)
