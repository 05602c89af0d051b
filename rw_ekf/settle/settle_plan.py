"""A plan: what a design is worth before anything moves, and as what a run commands.

Expected probabilities and times, in words and as a document; the motion behind a brake to rest and below a ceiling, and
as a log that can be repeated.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from rw_ekf.arrays import Float64Array
from rw_ekf.control.commanders import Commander, ProfileController
from rw_ekf.control.from_rest import FromRest, RestLimits
from rw_ekf.control.profiles import Profile
from rw_ekf.diagnosis.thresholds import TEMPERATURE
from rw_ekf.logs.atomic import write_text
from rw_ekf.numbers import number_text
from rw_ekf.settle.predicted import Scene
from rw_ekf.settle.search import Design
from rw_ekf.units import rad_s_from_rpm, rpm_from_rad_s

if TYPE_CHECKING:
    from rw_ekf.settings.schema import Configuration

SCHEMA = "rw_ekf.settle/1"
SETTLED = 0.95
WORTH_MOVING = 0.8  # expected probability of the right explanation at the end; below it nothing is moved


@dataclass(frozen=True)
class Plan:
    """A motion for the explanations of a scene."""

    scene: Scene
    design: Design

    @property
    def probabilities(self) -> Float64Array:
        """Expected probability of each explanation, and what is like it, if it is the true one, (k, checks)."""
        prior = np.array([item.posterior for item in self.scene.standing.explanations])
        weights = prior[None, :, None] * np.exp(-self.design.divergence / TEMPERATURE)
        found: Float64Array = np.einsum("ijt,ij->it", weights, self.design.alike.astype(float)) / weights.sum(axis=1)
        return found

    @property
    def groups(self) -> list[list[int]]:
        """Explanations that no motion distinguishes, two at least in each."""
        rows = {tuple(np.flatnonzero(row).tolist()) for row in self.design.alike}
        return sorted(list(row) for row in rows if len(row) > 1)

    @property
    def at_the_end(self) -> float:
        """Expected probability of the true explanation, whichever that is."""
        prior = np.array([item.posterior for item in self.scene.standing.explanations])
        return float(prior @ (prior if self.design.alike.all() else self.probabilities[:, -1]))

    @property
    def separates(self) -> bool:
        """Whether the motion is worth making."""
        return not self.design.alike.all() and self.at_the_end >= WORTH_MOVING

    @property
    def settled_s(self) -> list[float | None]:
        """Time at which each explanation, if true, is expected to have a probability of 0.95 [s]."""
        if self.design.alike.all():  # counted together they are certain, and nothing is settled
            return [None] * len(self.scene.standing.explanations)
        step = self.scene.checks * self.scene.period_s
        reached = [np.flatnonzero(row >= SETTLED) for row in self.probabilities]
        return [None if at.size == 0 else float(step * (at[0] + 1)) for at in reached]

    @property
    def speed_rad_s(self) -> Float64Array:
        """Speed that the most probable explanation predicts, (ticks,)."""
        model, current = self.scene.standing.explanations[0].model, self.design.current_A
        return self.scene.course(model, current).speed_rad_s[-current.size :]

    def begins(self) -> Iterator[tuple[float, str]]:
        """When each move begins [s], and what it does."""
        at, end = 0.0, self.design.current_A.size * self.scene.period_s
        for move in self.design.moves:
            if at < end:
                yield at, move.text()
            at += max(round(move.seconds / self.scene.period_s), 1) * self.scene.period_s

    def document(self) -> dict[str, Any]:
        """The `rw_ekf.settle/1` document."""
        items = self.scene.standing.explanations
        pairs = [(i, j) for i in range(len(items)) for j in range(i)]
        ends = self.design.divergence[:, :, -1]
        steps = np.abs(np.diff(self.design.current_A, prepend=0.0))
        return {
            "schema": SCHEMA,
            "diagnosis": self.scene.standing.path,
            "logs": list(self.scene.standing.logs),
            "duration_s": self.design.current_A.size * self.scene.period_s,
            "separates": self.separates,
            "expected_probability": self.at_the_end,
            "explanations": [
                {
                    "effects": list(item.effects),
                    "posterior": item.posterior,
                    "expected_posterior": item.posterior if self.design.alike.all() else float(row[-1]),
                    "settled_s": time_s,
                }
                for item, row, time_s in zip(items, self.probabilities, self.settled_s, strict=True)
            ],
            "pairs": [
                {
                    "one": list(items[j].effects),
                    "other": list(items[i].effects),
                    "divergence": [float(ends[j, i]), float(ends[i, j])],
                }
                for i, j in pairs
            ],
            "alike": [[list(items[i].effects) for i in group] for group in self.groups],
            "moves": [{"begins_s": at, "text": text} for at, text in self.begins()],
            "most": {
                "current_A": float(np.max(np.abs(self.design.current_A))),
                "slew_A_per_s": float(np.max(steps)) / self.scene.period_s,
                "speed_rpm": rpm_from_rad_s(float(np.max(np.abs(self.speed_rad_s)))),
            },
        }

    def text(self) -> str:
        """The same for a person."""
        stated = self.document()
        lines = [f"{self.scene.standing.path}: two minutes to tell {len(stated['explanations'])} explanations apart"]
        for item in stated["explanations"]:
            name = "+".join(item["effects"]) or "none"
            when = "not settled" if item["settled_s"] is None else f"0.95 after {item['settled_s']:.0f} s"
            lines.append(
                f"  {name:<28} {item['posterior']:.2g} now; if it is right, {when}, "
                f"{item['expected_posterior']:.3g} at the end"
            )
        for group in stated["alike"]:
            names = " and ".join("+".join(effects) or "none" for effects in group)
            lines.append(f"  {names}: one and the same to every motion at this rate, and counted together")
        if self.design.alike.all():
            return "\n".join([*lines, f"  {self.refusal()}"])
        lines += ["", "  motion, from rest"]
        lines += [f"    {move['begins_s']:6.1f} s  {move['text']}" for move in stated["moves"]]
        most = stated["most"]
        lines.append(
            f"  at most {number_text(1e3 * most['current_A'])} mA, {number_text(most['slew_A_per_s'])} A/s, "
            f"{number_text(most['speed_rpm'])} rpm as predicted"
        )
        if not self.separates:
            lines.append(f"  {self.refusal()}")
        return "\n".join(lines)

    def refusal(self) -> str:
        """Why the motion is not worth making, and what is."""
        if self.design.alike.all():
            return (
                "no motion within the limits was found that tells them apart: they are one and the same at this "
                "loop.rate_hz: read faster, or widen the limits"
            )
        return (
            f"no motion within the limits was found that tells them apart: the right one would be at "
            f"{self.at_the_end:.2f} after it, {WORTH_MOVING:g} is the least: widen the limits, or record more "
            "(`rw-ekf excite identification --config F`)"
        )


MOTION_NAME = "settle-motion.csv"
_BRAKE_SHARE = 0.5  # of limits.current_A
_CEILING = 0.95  # of limits.speed_rpm
_STILL_NOISES, _STILL_S = 4.0, 1.5
_SPARE_S = 30.0


def commander_for(plan: Plan, configuration: Configuration) -> Commander:
    """The motion behind a brake to rest; no current drives the wheel above the ceiling."""
    current, period = plan.design.current_A, plan.scene.period_s
    moves = list(plan.begins())

    def law(time_s: float) -> float:
        return float(current[min(int(time_s / period + 0.5), current.size - 1)])

    def phase(time_s: float) -> str:
        return next((text for begins, text in reversed(moves) if begins <= time_s), moves[0][1])

    profile = Profile("settle", current.size * period, law, phase)
    limits, believed = configuration.limits, plan.scene.standing.explanations[0].model.parameters
    brake, top = _BRAKE_SHARE * limits.current_A, rad_s_from_rpm(limits.speed_rpm)
    slows = max(believed.motor_gain * brake + believed.coulomb, 1.0e-9)
    still = _STILL_NOISES * rad_s_from_rpm(configuration.filter.speed_noise_rpm)
    rest = FromRest(
        ProfileController(profile),
        RestLimits(
            brake_A=brake,
            let_go_rad_s=max(2.0 * slows * (period + brake / limits.slew_A_per_s), still),
            still_rad_s=still,
            still_s=_STILL_S,
            longest_s=2.0 * top / slows + _SPARE_S,
            ceiling_rad_s=_CEILING * top,
        ),
    )
    return Commander(rest, profile, rest=rest)


def write_motion(plan: Plan) -> Path:
    """The motion as a log of what is predicted, beside the diagnosis: `command.log` repeats it.

    Raises BadInputError where it cannot be written.
    """
    path = Path(plan.scene.standing.path).absolute().parent / MOTION_NAME
    predicted = zip(plan.speed_rad_s.tolist(), plan.design.current_A.tolist(), strict=True)
    rows = [f"{tick * plan.scene.period_s!r},{speed!r},{current!r}" for tick, (speed, current) in enumerate(predicted)]
    write_text(path, "\n".join(["time_s,speed_rad_s,current_command_A", *rows]) + "\n")
    return path
