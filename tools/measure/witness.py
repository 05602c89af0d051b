"""Who watches a soak from outside the daemon: the wheel itself, and a sink that compares each turn with it."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from rw_ekf.drivers.line.framing import decode
from rw_ekf.drivers.line.line import Exchange
from rw_ekf.drivers.sim.faults import Fault
from rw_ekf.drivers.sim.register_server import RegisterServer, Reply
from rw_ekf.live.stop_signal import StopSignal
from rw_ekf.records import Outcome, RunState, StateNow, Tick
from rw_ekf.units import rpm_from_rad_s

CURRENT_A, SPEED_RPM, SILENCE_S = 0.3, 250.0, 0.5
CYCLE = 137
# With these at work nobody can make the wheel slower: it does not hear, or will not.
DEAF = frozenset(
    {"hangup", "block", "drop", "cut", "flip", "insert", "nack", "nack-acted", "reorder", "flood", "delay"}
)
BLIND = frozenset({"freeze", "value", "spike", "repeat"})  # what it says of its speed is not its speed
_RECOVERS_S = 60.0  # so long after a fault a change of state may still be of it
_RESUME_AFTER_S = 60.0


class Witness(RegisterServer):
    """The wheel, which keeps when each telemetry reply was made."""

    def __init__(self, *arguments: Any, **options: Any) -> None:
        super().__init__(*arguments, **options)
        self.made_s: dict[bytes, float] = {}

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
    wanted_s: float = 0.0
    data: bytes | None = None
    _held_rpm: float = SPEED_RPM
    _last: StateNow | None = None
    _next: int = 0
    _safe_since_s: float | None = None
    _was_lost: bool = False

    def exchanged(self, wanted_s: float, exchange: Exchange) -> None:
        """Keep what the driver took for the answer to its last request for telemetry."""
        self.wanted_s, self.data = wanted_s, exchange.data

    def write(self, tick: Tick) -> None:
        """Look at one turn."""
        now_s = self.now_s()
        if tick.fresh and tick.estimate.outcome is Outcome.UPDATED:
            self.used += 1
            if self.data is not None and self.server.made_s.get(self.data, -1.0) < self.wanted_s - 1e-6:
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


def _resident_kib() -> int:
    pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") // 1024
