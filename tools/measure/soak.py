"""Soak the daemon: days on a virtual clock, or minutes over a pty, with faults drawn at random, and a witness.

python -m tools.measure.soak [--hours 72] [--seed 1] [--gap 120]      on a virtual clock; --gap 0: no faults
python -m tools.measure.soak --pty --hours 0.5                        in real time, over a pseudo terminal
python -m tools.measure.soak --gap 0 --steady --hours 24              at a constant current

The wheel itself is the witness: how fast it truly turned, when each reply was made, which faults were at work. Nothing
here asks the daemon whether it is well. Where it holds zero in SAFE, a person says resume after a minute.
"""

from __future__ import annotations

import argparse
import contextlib
import sys
import tempfile
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from unittest import mock

from tqdm import tqdm

from rw_ekf.checking.yaml_loader import load_yaml
from rw_ekf.clock import Clock, SystemClock, VirtualClock
from rw_ekf.driver import WheelProtocol
from rw_ekf.drivers.line.line import Exchange
from rw_ekf.drivers.line.register_protocol import RegisterProtocol
from rw_ekf.drivers.line.serial_link import SerialLink
from rw_ekf.drivers.line.wire_map import wire_map_from_mapping
from rw_ekf.drivers.sim.fault_draw import drawn_faults
from rw_ekf.drivers.sim.faults import FaultInjector
from rw_ekf.drivers.sim.plant_batch import compiled_advance
from rw_ekf.drivers.sim.plant_parameters import PlantNoise, PlantParameters, PlantState
from rw_ekf.drivers.sim.plant_runner import PlantRunner
from rw_ekf.drivers.sim.pty_server import PtyServer
from rw_ekf.drivers.sim.virtual_line import VirtualCable
from rw_ekf.learning.run_start import GivenModel
from rw_ekf.live.daemon import Task, run_daemon
from rw_ekf.live.run_outcome import RunOutcome
from rw_ekf.live.stop_signal import StopSignal
from rw_ekf.settings.load import load_configuration
from rw_ekf.settings.resources import protocol_path
from rw_ekf.sinks import all_sinks
from rw_ekf.units import RAD_S_PER_RPM, rpm_from_rad_s
from tools.measure.witness import CURRENT_A, CYCLE, SILENCE_S, SPEED_RPM, Observer, Witness

CONFIGURATION = f"""\
wheel: {{port: DIRECTORY/wheel}}
limits: {{current_A: {CURRENT_A}, speed_rpm: {SPEED_RPM}, silence_s: {SILENCE_S}}}
command: COMMAND
output: {{directory: DIRECTORY/runs, part_hours: 6}}
"""
PROFILE = "{profile: random-sines, amplitude_A: 0.25, period_s: 40, bias_A: 0.03}"
STEADY = "{profile: sine, amplitude_A: 0.0, bias_A: 0.041}"
_REPORTED_WHOLLY = ("not_written", "part_not_begun", "drag_spike", "sink_failed")
_MEMORY_EVERY_H = 4.0  # readings of memory stand 600 s apart
_SETTLED_S = 3600.0  # memory is compared from here on


@dataclass(frozen=True)
class Plan:
    """What a soak does. gap_s: mean time between two faults; 0: there are none."""

    hours: float
    seed: int = 1
    gap_s: float = 120.0
    steady: bool = False
    pty: bool = False


@dataclass(frozen=True)
class Soaked:
    """What a soak came to."""

    seen: Observer
    outcome: RunOutcome
    reported: Reported
    seconds: float


class Reported:
    """A logger that counts, and keeps what it was told first of each event."""

    def __init__(self) -> None:
        self.events: Counter[str] = Counter()
        self.first: dict[str, dict[str, Any]] = {}

    def info(self, event: str, **context: Any) -> None:
        """Count one event."""
        self.events[event] += 1
        self.first.setdefault(event, context)

    warning = error = info


def soak(plan: Plan, directory: Path, bar: Any) -> Soaked:
    """Run the daemon over a wheel with faults, and look on."""
    document = load_yaml(protocol_path("sunspace-wheel"))
    wire_map = wire_map_from_mapping(document.data, document.where)
    faults = drawn_faults(plan.seed, 3600.0 * plan.hours, plan.gap_s) if plan.gap_s > 0.0 else ()
    noise, state = PlantNoise(RAD_S_PER_RPM), PlantState(speed_rad_s=20.0)
    plant = PlantRunner(PlantParameters(), noise, plan.seed, state, 0.01, compiled_advance)
    server = Witness(wire_map, plant, faults=FaultInjector(faults, plan.seed))
    path = directory / "wheel.yaml"
    text = CONFIGURATION.replace("DIRECTORY", str(directory)).replace("COMMAND", STEADY if plan.steady else PROFILE)
    path.write_text(text, encoding="utf-8")
    reported, began = Reported(), time.monotonic()
    with StopSignal() as stop, _wheel(server, directory / "wheel", pty=plan.pty) as (protocol, clock, now_s):
        observer = Observer(server, now_s, faults, stop, bar)
        with _watched_by(observer):
            configuration = load_configuration(path)
            outcome = run_daemon(
                Task(configuration, protocol, GivenModel(), 3600.0 * plan.hours), reported, stop, clock
            )
    return Soaked(observer, outcome, reported, time.monotonic() - began)


@contextlib.contextmanager
def _wheel(server: Witness, port: Path, *, pty: bool) -> Iterator[tuple[WheelProtocol, Clock, Callable[[], float]]]:
    """The wheel on a line: what is spoken on it, the daemon's clock, and the wheel's time."""
    if not pty:
        clock = VirtualClock()
        cable = VirtualCable(server, clock)
        yield cable.carrying(RegisterProtocol(server.wire_map)), clock, cable.now_s
        return
    served, over = PtyServer(server, port), threading.Event()
    thread = threading.Thread(target=served.run, args=(over.is_set,), daemon=True)
    thread.start()
    try:
        yield RegisterProtocol(server.wire_map), SystemClock(), served.wheel_time_s
    finally:
        over.set()
        thread.join()
        served.close()


@contextlib.contextmanager
def _watched_by(observer: Observer) -> Iterator[None]:
    """Every turn goes to the observer too, and every answer that the driver takes for telemetry."""
    request = SerialLink.request

    def witnessed(link: SerialLink, register_id: int, *arguments: Any, **options: Any) -> Exchange:
        wanted_s = observer.now_s()
        exchange = request(link, register_id, *arguments, **options)
        if register_id == CYCLE:
            observer.exchanged(wanted_s, exchange)
        return exchange

    sinks = {**all_sinks.SINKS, "observer": all_sinks.SinkKind(lambda run: (observer, None), every_turn=True)}
    with mock.patch.object(SerialLink, "request", witnessed), mock.patch.object(all_sinks, "SINKS", sinks):
        yield


def main() -> int:
    """Soak, and print the figures beside their marks."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--hours", type=float, default=72.0)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--gap", type=float, default=120.0, help="mean time between two faults [s]; 0: none")
    parser.add_argument("--steady", action="store_true", help="a constant current instead of a profile")
    parser.add_argument("--pty", action="store_true", help="in real time, over a pseudo terminal")
    args = parser.parse_args()
    plan = Plan(args.hours, args.seed, args.gap, args.steady, args.pty)
    with (
        tempfile.TemporaryDirectory(prefix="rw-ekf-soak-") as name,
        tqdm(total=args.hours, unit="h", disable=None) as bar,
    ):
        soaked = soak(plan, Path(name), bar)
    sys.stdout.write("\n".join(_report(soaked, plan)) + "\n")
    return 0


def allowed_rpm() -> float:
    """How much faster the wheel gets in a silence period, and two turns until zero is written, at full current."""
    return rpm_from_rad_s(PlantParameters().motor_gain * CURRENT_A * (SILENCE_S + 0.2))


def _report(soaked: Soaked, plan: Plan) -> list[str]:
    seen, outcome = soaked.seen, soaked.outcome
    settled = [kib for at, kib in seen.rss_kib if at >= min(_SETTLED_S, 0.5 * seen.rss_kib[-1][0])]
    back = sorted(seen.back_s)
    belief, truth = outcome.belief, PlantParameters()
    z = {
        name: (getattr(belief.parameters, name) - getattr(truth, name)) / getattr(belief.parameter_std, name)
        for name in belief.parameters._fields
    }
    worst, middle = (back[-1], back[len(back) // 2]) if back else (0.0, 0.0)
    return [
        f"{plan.hours:g} h of the wheel in {soaked.seconds:.0f} s: {outcome.timing.ticks} turns, {len(seen.faults)} "
        f"faults, {seen.used} readings used",
        f"stale replies used: {seen.stale_used} (mark 0)",
        f"beyond the speed limit, or what it had reached while it could not hear, by at most "
        f"{seen.excess_rpm['told']:.1f} rpm (mark: one silence period at full current, {allowed_rpm():.0f}); "
        f"{seen.excess_rpm['blind']:.0f} where its reading lied, {seen.excess_rpm['deaf']:.0f} where it could not hear",
        f"states: {dict(seen.states)}; changes for the worse without a fault: {len(seen.unexplained)} (mark 0)",
        *(f"  {text}" for text in seen.unexplained[:20]),
        f"line back -> TRACKING: median {middle:.2f} s, worst {worst:.2f} s of {len(back)} (mark 1 s)",
        f"resident memory: {settled[0]} KiB, at the end {settled[-1]}: "
        f"{(settled[-1] - settled[0]) / 1024:+.1f} MB (mark 5); every {_MEMORY_EVERY_H:g} h: "
        + ", ".join(f"{kib // 1024}" for _, kib in seen.rss_kib[:: round(6 * _MEMORY_EVERY_H)]),
        f"state at the end {outcome.state.state.value}; errors in sigma: "
        + ", ".join(f"{name} {value:+.1f}" for name, value in z.items()),
        f"events: {dict(soaked.reported.events.most_common())}",
        *(f"{event}: {soaked.reported.first[event]}" for event in _REPORTED_WHOLLY if event in soaked.reported.first),
        f"explained: {dict(seen.explained_by.most_common(25))}",
    ]


if __name__ == "__main__":
    sys.exit(main())
