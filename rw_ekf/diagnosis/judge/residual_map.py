"""The residual map: whether anything structured is left, and along what (docs/diagnosis.md, "The map").

Each dependence (speed, low speed, current, angle, temperature, time) is a set of hat functions that multiply a torque
or a dry friction, entered into the same regression as an effect would be: nothing in particular is assumed of the
shape, and a dependence that the model's own parameters can follow counts for nothing.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rw_ekf.arrays import Float64Array
from rw_ekf.diagnosis.search.scorer import Scorer
from rw_ekf.diagnosis.search.trial import INFLATION
from rw_ekf.filter.consistency import chi_square_tail
from rw_ekf.likelihood.fitting import Fit
from rw_ekf.likelihood.structure import hats, slopes_by_torque
from rw_ekf.model.effect import RecordFacts


@dataclass(frozen=True)
class Dependence:
    """What the residual's dependence on one quantity amounts to."""

    name: str
    statistic: float  # chi-square gain, profiled over the noises as an effect's is
    freedom: int
    p_value: float


def residual_map(fit: Fit, facts: RecordFacts) -> list[Dependence]:
    """Dependences of what the model leaves, most significant first."""
    drive, dry = slopes_by_torque(fit)
    frame = fit.frame
    speed = np.concatenate((fit.reference.speed[:1], fit.reference.speed[:-1]))  # where each interval began
    current = fit.frame.record.course.mean_current_A
    groups: dict[str, list[Float64Array]] = {}
    size = np.abs(speed)
    top = max(facts.top_speed_rad_s, 1.0e-9)
    by_speed = hats(size, 12, 0.0, top)
    groups["speed"] = [dry[:, None] * by_speed, drive[:, None] * by_speed]
    near = hats(size, 5, 0.0, 8.0 * facts.stribeck_speed_rad_s)[:, :-1]
    groups["low speed"] = [dry[:, None] * near, drive[:, None] * near]
    if facts.top_current_A > 0.0:
        by_current = hats(np.abs(current), 6, 0.0, facts.top_current_A)
        signed = np.sign(current)[:, None] * by_current
        groups["current"] = [dry[:, None] * by_current, drive[:, None] * by_current, drive[:, None] * signed]
    time = frame.record.course.time_s
    by_time = hats(time, 10, facts.first_s, facts.last_s)
    groups["time"] = [dry[:, None] * by_time, drive[:, None] * by_time]
    if facts.temperature_range_K is not None and facts.temperature_range_K > 0.5:
        warmth = frame.record.course.temperature_degC
        by_warmth = hats(warmth, 4, float(warmth.min()), float(warmth.max()))
        gain = (drive * current)[:, None]
        groups["temperature"] = [dry[:, None] * by_warmth, drive[:, None] * by_warmth, gain * by_warmth]
    if facts.angle:
        turn = np.outer(frame.record.course.angle_rad, np.arange(1, 5))
        groups["angle"] = [drive[:, None] * np.sin(turn), drive[:, None] * np.cos(turn)]
    scorer = Scorer(fit)
    found = []
    for name, parts in groups.items():
        columns = np.where(frame.record.follows[:, None], np.concatenate(parts, axis=1), 0.0)
        statistic, freedom = scorer.score_group(columns)
        p = chi_square_tail(statistic / INFLATION, freedom) if freedom and statistic > 0.0 else 1.0
        found.append(Dependence(name, statistic, freedom, p))
    return sorted(found, key=lambda item: (item.p_value, -item.statistic))
