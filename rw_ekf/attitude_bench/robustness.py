"""How far each compensation bears what it does not know: swept until it does no better than no compensation at all."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from statistics import median
from typing import Any

from rw_ekf.attitude_bench.contest import Models, hold_runs
from rw_ekf.attitude_bench.contest_result import BASELINE, Table
from rw_ekf.attitude_bench.scenario import Scenario
from rw_ekf.control.compensation.schemes import SCHEMES


@dataclass(frozen=True)
class Sweep:
    """One thing that gets worse, level by level."""

    id: str
    unit: str
    levels: tuple[float, ...]
    meaning: str
    at: Callable[[Scenario, float], Scenario]


def _delayed(scenario: Scenario, delay_ms: float) -> Scenario:
    delay = f"transport_delay:delay_s={1e-3 * delay_ms:g}"
    return scenario.changed("wheel", effects=(*scenario.wheel.effects, delay))


SWEEPS = (
    Sweep(
        "friction_low", "%", (5.0, 10.0, 20.0, 40.0, 80.0), "what is believed of the friction is too low by",
        lambda scenario, level: scenario.changed("belief", friction_error_percent=-level),
    ),
    Sweep(
        "friction_high", "%", (5.0, 10.0, 20.0, 40.0, 80.0), "what is believed of the friction is too high by",
        lambda scenario, level: scenario.changed("belief", friction_error_percent=level),
    ),
    Sweep(
        "gain", "%", (10.0, 20.0, 40.0, 80.0), "what is believed of the motor gain is too high by",
        lambda scenario, level: scenario.changed("belief", gain_error_percent=level),
    ),
    Sweep(
        "speed_noise", "rpm", (5.0, 10.0, 20.0, 50.0, 100.0), "noise of a speed reading, told to the filter",
        lambda scenario, level: scenario.changed("cycle", speed_noise_rpm=(level,)),
    ),
    Sweep(
        "torque_noise", "rpm/sqrt(s)", (0.1, 0.3, 1.0, 3.0), "random walk of the true speed, told to the filter",
        lambda scenario, level: scenario.changed("wheel", torque_noise_rpm_per_sqrt_s=level),
    ),
    Sweep("delay", "ms", (20.0, 50.0, 100.0, 200.0, 400.0), "every command acts later than known, by", _delayed),
    Sweep(
        "rate", "Hz", (50.0, 20.0, 5.0, 2.0), "rate of the loop",
        lambda scenario, level: scenario.changed("cycle", rate_hz=level),
    ),
)  # fmt: skip


@dataclass(frozen=True)
class Bearing:
    """How one scheme bears one sweep: its peak over the baseline's at each level, median of the seeds."""

    scheme: str
    sweep: Sweep
    shares: tuple[float, ...]

    @property
    def loses_at(self) -> float | None:
        """The first level at which it does no better than the baseline; None: it always does."""
        lost = (level for level, share in zip(self.sweep.levels, self.shares, strict=True) if not share < 1.0)
        return next(lost, None)

    def document(self) -> dict[str, Any]:
        """As JSON has it."""
        return {
            "scheme": self.scheme,
            "sweep": self.sweep.id,
            "unit": self.sweep.unit,
            "levels": list(self.sweep.levels),
            "peak_over_baseline": list(self.shares),
            "loses_at": self.loses_at,
        }


def sweep_all(
    schemes: Sequence[str],
    scenario: Scenario,
    seeds: int,
    models: Models,
    tick: Callable[[int], object] = lambda n: None,
    sweeps: Sequence[Sweep] = SWEEPS,
) -> list[Bearing]:
    """Sweep every scheme, and the baseline under the very same conditions. models: of the wheel as believed."""
    noise_rpm = scenario.cycle.speed_noise_rpm[0]
    fixed = scenario.changed("cycle", speed_noise_rpm=(noise_rpm,))
    model = models.get(noise_rpm)
    rivals = [BASELINE, *(name for name in schemes if name != BASELINE)]
    conditions = {(sweep.id, level): sweep.at(fixed, level) for sweep in sweeps for level in sweep.levels}
    reported = {
        place: {} if model is None else {there.cycle.speed_noise_rpm[0]: model} for place, there in conditions.items()
    }
    peaks = hold_runs(rivals, conditions, seeds, reported, tick)
    found = []
    for sweep in sweeps:
        for name in rivals[1:]:
            shares = tuple(_share(peaks[sweep.id, level], name) for level in sweep.levels)
            found.append(Bearing(name, sweep, shares))
    return found


def runs_of(schemes: Sequence[str], seeds: int) -> int:
    """How many runs that takes."""
    return sum(len(sweep.levels) for sweep in SWEEPS) * seeds * len({BASELINE, *schemes})


def _share(peaks: Mapping[str, Sequence[float]], scheme: str) -> float:
    base, own = _middle(peaks[BASELINE]), _middle(peaks[scheme])
    return own / base if math.isfinite(own) else math.inf


def _middle(values: Sequence[float]) -> float:
    return median(value if math.isfinite(value) else math.inf for value in values)


def table_of(found: Sequence[Bearing], sweeps: Sequence[Sweep] = SWEEPS) -> Table:
    """The level at which a scheme is no better than none, sweep by sweep; else its largest share of that peak."""
    schemes = [name for name in SCHEMES if any(bearing.scheme == name for bearing in found)]
    by = {(bearing.scheme, bearing.sweep.id): bearing for bearing in found}
    return Table(
        title=f"Loses to {BASELINE} at",
        heads=("scheme", *(sweep.id for sweep in sweeps)),
        units=("", *(sweep.unit for sweep in sweeps)),
        rows=tuple((name, *(_cell(by[name, sweep.id]) for sweep in sweeps)) for name in schemes),
        words=1,
        notes=tuple(
            f"{sweep.id}: {sweep.meaning} {', '.join(f'{level:g}' for level in sweep.levels)} {sweep.unit}"
            for sweep in sweeps
        ),
    )


def _cell(bearing: Bearing) -> str:
    lost = bearing.loses_at
    return f"never (at most {max(bearing.shares):.2g})" if lost is None else f"{lost:g}"
