"""Soak the daemon: days on a virtual clock over the real serial driver, faults drawn at random, and a witness.

python -m tools.measure.soak [--hours 72] [--seed 1] [--gap 120]

The wheel itself is the witness: how fast it truly turned, when each reply was made, which faults were at work. Nothing
here asks the daemon whether it is well. Where it holds zero in SAFE, a person says resume after a minute.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from unittest import mock

from tqdm import tqdm

from drivers.line.framing import decode
from drivers.line.serial_link import Exchange, SerialLink
from drivers.line.wire_map import wire_map_from_mapping
from drivers.sim.fault_draw import drawn_faults
from drivers.sim.faults import Fault, FaultInjector
from drivers.sim.plant_parameters import PlantNoise, PlantParameters, PlantState
from drivers.sim.plant_runner import PlantRunner
from drivers.sim.register_server import RegisterServer, Reply
from drivers.sim.virtual_line import VirtualLineProtocol
from rw_ekf.clock import VirtualClock
from rw_ekf.learning.start import GivenModel
from rw_ekf.live.daemon import RunOutcome, run_daemon
from rw_ekf.live.stop_signal import StopSignal
from rw_ekf.records import Outcome, RunState, StateNow, Tick
from rw_ekf.settings.load import load_configuration
from rw_ekf.settings.resources import protocol_path
from rw_ekf.settings.yaml_loader import load_yaml
from rw_ekf.sinks import registry
from rw_ekf.units import RAD_S_PER_RPM, rpm_from_rad_s

CURRENT_A, SPEED_RPM, SILENCE_S = 0.3, 250.0, 0.5
CONFIGURATION = f"""\
wheel: {{port: DIRECTORY/wheel}}
limits: {{current_A: {CURRENT_A}, speed_rpm: {SPEED_RPM}, silence_s: {SILENCE_S}}}
command: {{profile: random-sines, amplitude_A: 0.25, period_s: 40, bias_A: 0.03}}
output: {{directory: DIRECTORY/runs, part_hours: 6}}
"""
CYCLE = 137
# With these at work nobody can make the wheel slower: it does not hear, or will not.
DEAF = frozenset(
    {"hangup", "block", "drop", "cut", "flip", "insert", "nack", "nack-acted", "reorder", "flood", "delay"}
)
BLIND = frozenset({"freeze", "value", "spike", "repeat"})  # what it says of its speed is not its speed
_RECOVERS_S = 60.0  # so long after a fault a change of state may still be of it
_RESUME_AFTER_S = 60.0
_SETTLED_S = 3600.0  # memory is compared from here on


class Witness(RegisterServer):
    """The wheel, which keeps when each telemetry reply was made."""

    made_s: dict[bytes, float]

    def handle(self, received: bytes, time_s: float) -> list[Reply]:
        """As any wheel's."""
        replies = super().handle(received, time_s)
        for reply in replies:
            for frame in decode(reply.content, self.wire_map.framing).frames:
                if frame.id == CYCLE:
                    self.made_s.setdefault(frame.data, time_s)
        if len(self.made_s) > 1000:
            self.made_s = dict(list(self.made_s.items())[-500:])
        return replies


@dataclass
class Observer:
    """A sink that sees every turn, beside what the wheel knows."""

    server: Witness
    now_s: Callable[[], float]  # the wheel's time, which goes on while nobody asks the wheel
    faults: tuple[Fault, ...]
    stop: StopSignal
    bar: Any
    states: Counter[str] = field(default_factory=Counter)
    explained_by: Counter[str] = field(default_factory=Counter)
    unexplained: list[str] = field(default_factory=list)
    stale_used: int = 0
    used: int = 0
    excess_rpm: dict[str, float] = field(default_factory=lambda: {"told": 0.0, "blind": 0.0, "deaf": 0.0})
    back_s: list[float] = field(default_factory=list)
    rss_kib: list[tuple[float, int]] = field(default_factory=list)
    asked_s: float = 0.0
    data: bytes | None = None
    _held_rpm: float = SPEED_RPM
    _last: StateNow | None = None
    _next: int = 0
    _safe_since_s: float | None = None
    _was_lost: bool = False

    def exchanged(self, asked_s: float, exchange: Exchange) -> None:
        """Keep what the driver took for the answer to its last request for telemetry."""
        self.asked_s, self.data = asked_s, exchange.data

    def write(self, tick: Tick) -> None:
        """Look at one turn."""
        now_s = self.now_s()
        if tick.fresh and tick.estimate.outcome is Outcome.UPDATED:
            self.used += 1
            if self.data is not None and self.server.made_s.get(self.data, -1.0) < self.asked_s - 1e-6:
                self.stale_used += 1
        recent = self._recent(now_s, 3.0)
        speed_rpm = rpm_from_rad_s(abs(self.server.plant.speed_rad_s))
        kind = "deaf" if recent & DEAF else "blind" if recent & BLIND else "told"
        self.excess_rpm[kind] = max(self.excess_rpm[kind], speed_rpm - self._held_rpm)
        # What it reached while it could not hear it may coast down from, but not beyond.
        reached_rpm = max(self._held_rpm, speed_rpm) if kind == "deaf" else min(self._held_rpm, speed_rpm)
        self._held_rpm = max(SPEED_RPM, reached_rpm)
        if tick.state is not None and tick.state != self._last:
            self._changed(tick.state, now_s)
        if self._safe_since_s is not None and now_s - self._safe_since_s > _RESUME_AFTER_S and not recent:
            self.stop.resume()
        if len(self.rss_kib) * 600.0 < now_s:
            self.rss_kib.append((now_s, _resident_kib()))
            self.bar.update(round(now_s / 36.0) / 100 - self.bar.n)

    def close(self) -> None:
        """Nothing to finish."""

    def _changed(self, now: StateNow, now_s: float) -> None:
        self._last = now
        self.states[now.state.value] += 1
        self._safe_since_s = now_s if now.state is RunState.SAFE else None
        if now.state is RunState.TRACKING and self._was_lost and not self._recent(now_s, 0.0):
            self.back_s.append(now_s - max(_end_s(fault) for fault in self.faults if _end_s(fault) <= now_s))
        if now.state is not RunState.CONNECTING:
            self._was_lost = now.state is RunState.LOST
        if now.state in (RunState.DEGRADED, RunState.LOST, RunState.SAFE):
            causes = self._recent(now_s, _RECOVERS_S)
            if causes:
                self.explained_by[f"{now.state.value} {'+'.join(sorted(causes))}"] += 1
            else:
                self.unexplained.append(f"{now_s:.1f} s: {now.state.value}: {now.reason}")

    def _recent(self, now_s: float, within_s: float) -> frozenset[str]:
        """Kinds at work now or until so long ago."""
        while self._next < len(self.faults) and _end_s(self.faults[self._next]) < now_s - _RECOVERS_S:
            self._next += 1
        found = set()
        for fault in self.faults[self._next :]:
            if fault.start_s > now_s:
                break
            if _end_s(fault) >= now_s - within_s:
                found.add(fault.kind)
        return frozenset(found)


def _end_s(fault: Fault) -> float:
    return fault.start_s + fault.lasts_s


class Told:
    """A logger that counts."""

    def __init__(self) -> None:
        self.events: Counter[str] = Counter()

    def info(self, event: str, **context: Any) -> None:
        """Count one event."""
        self.events[event] += 1

    warning = error = info


def soak(hours: float, seed: int, gap_s: float, directory: Path, bar: Any) -> tuple[Observer, RunOutcome, Told, float]:
    """Run the daemon for so many hours of the wheel: what was seen, what it came to, what it said, and how long [s]."""
    clock, told = VirtualClock(), Told()
    faults = drawn_faults(seed, 3600.0 * hours, gap_s)
    document = load_yaml(protocol_path("sunspace-wheel"))
    wire_map = wire_map_from_mapping(document.data, document.where)
    noise, state = PlantNoise(RAD_S_PER_RPM), PlantState(speed_rad_s=20.0)
    plant = PlantRunner(PlantParameters(), noise, seed, state, fine_step_s=0.01)
    server = Witness(wire_map, plant, faults=FaultInjector(faults, seed))
    server.made_s = {}
    path = directory / "wheel.yaml"
    path.write_text(CONFIGURATION.replace("DIRECTORY", str(directory)), encoding="utf-8")
    request = SerialLink.request
    with StopSignal() as stop:
        protocol = VirtualLineProtocol(wire_map, server, clock)
        observer = Observer(server, protocol.cable.now_s, faults, stop, bar)

        def witnessed(link: SerialLink, register_id: int, *arguments: Any, **options: Any) -> Exchange:
            asked_s = protocol.cable.now_s()
            exchange = request(link, register_id, *arguments, **options)
            if register_id == CYCLE:
                observer.exchanged(asked_s, exchange)
            return exchange

        began = time.monotonic()
        sinks = {**registry.SINKS, "observer": lambda run: (observer, None)}
        with mock.patch.object(SerialLink, "request", witnessed), mock.patch.object(registry, "SINKS", sinks):
            outcome = run_daemon(load_configuration(path), protocol, GivenModel(), 3600.0 * hours, told, stop, clock)
    return observer, outcome, told, time.monotonic() - began


def main() -> int:
    """Soak, and print the figures beside their marks."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--hours", type=float, default=72.0)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--gap", type=float, default=120.0, help="mean time between two faults [s]")
    args = parser.parse_args()
    with (
        tempfile.TemporaryDirectory(prefix="rw-ekf-soak-") as name,
        tqdm(total=args.hours, unit="h", disable=None) as bar,
    ):
        seen, outcome, told, seconds = soak(args.hours, args.seed, args.gap, Path(name), bar)
    sys.stdout.write("\n".join(_report(seen, outcome, told, seconds, args.hours)) + "\n")
    return 0


def allowed_rpm() -> float:
    """How much faster the wheel gets in a silence period, and two turns until zero is written, at full current."""
    return rpm_from_rad_s(PlantParameters().motor_gain * CURRENT_A * (SILENCE_S + 0.2))


def _report(seen: Observer, outcome: RunOutcome, told: Told, seconds: float, hours: float) -> list[str]:
    settled = [kib for at, kib in seen.rss_kib if at >= min(_SETTLED_S, 0.5 * seen.rss_kib[-1][0])]
    back = sorted(seen.back_s)
    belief, truth = outcome.belief, PlantParameters()
    z = {
        name: (getattr(belief.parameters, name) - getattr(truth, name)) / getattr(belief.parameter_std, name)
        for name in belief.parameters._fields
    }
    return [
        f"{hours:g} h of the wheel in {seconds:.0f} s: {outcome.timing.ticks} turns, {len(seen.faults)} faults, "
        f"{seen.used} readings used",
        f"stale replies used: {seen.stale_used} (mark 0)",
        f"beyond the speed limit, or what it had reached while it could not hear, by at most "
        f"{seen.excess_rpm['told']:.1f} rpm (mark: one silence period at full current, {allowed_rpm():.0f}); "
        f"{seen.excess_rpm['blind']:.0f} where its reading lied, {seen.excess_rpm['deaf']:.0f} where it could not hear",
        f"states: {dict(seen.states)}; changes for the worse without a fault: {len(seen.unexplained)} (mark 0)",
        *(f"  {text}" for text in seen.unexplained[:20]),
        f"line back -> TRACKING: median {back[len(back) // 2] if back else 0.0:.2f} s, worst "
        f"{back[-1] if back else 0.0:.2f} s of {len(back)} (mark 1 s)",
        f"resident memory: {settled[0]} KiB, at the end {settled[-1]}: "
        f"{(settled[-1] - settled[0]) / 1024:+.1f} MB (mark 5)",
        f"state at the end {outcome.state.state.value}; errors in sigma: "
        + ", ".join(f"{name} {value:+.1f}" for name, value in z.items()),
        f"events: {dict(told.events.most_common())}",
        f"explained: {dict(seen.explained_by.most_common(25))}",
    ]


def _resident_kib() -> int:
    pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") // 1024


if __name__ == "__main__":
    sys.exit(main())
