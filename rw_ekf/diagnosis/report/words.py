"""What report and terminal say alike: names of verdicts and figures, units, numbers without false digits."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from rw_ekf.diagnosis.standing import standing_of, untestable_because
from rw_ekf.numbers import MISSING, chance_text, number_of, number_text
from rw_ekf.units import RAD_S_PER_RPM, rad_s_from_rpm

_STILL = 0.005  # a smaller share of a figure is no change
VERDICTS = {
    "adequate": "Model adequate",
    "effect": "Effect named",
    "unexplained": "Unexplained",
    "insufficient_excitation": "Cannot be judged",
}


class Units:
    """Units of a report, each with its size in SI: a wheel's rpm and mA, or SI for a plant that may move along a line.

    Residuals are torques where the inertia is known, else accelerations.
    """

    def __init__(self, wheel: bool, inertia_kg_m2: float | None) -> None:
        self.wheel, self.inertia_kg_m2 = wheel, inertia_kg_m2
        self.speed, self.speed_scale = ("rpm", RAD_S_PER_RPM) if wheel else ("rad/s (or m/s)", 1.0)
        self.drive, self.current, self.current_scale = ("current", "mA", 1e-3) if wheel else ("drive", "A (or N)", 1.0)
        self.residual, self.residual_scale = "rad/s²" if wheel else "rad/s² (or m/s²)", 1.0
        if inertia_kg_m2 is not None:
            self.residual, self.residual_scale = "mNm", 1.0e-3 / inertia_kg_m2


@dataclass(frozen=True)
class FigurePair:
    """One figure of merit on the held-out part, before and after; None where it does not exist."""

    key: str
    label: str
    note: str
    unit: str
    before: float | None
    after: float | None

    @property
    def moves(self) -> bool:
        """Whether an effect that was added changed it by anything to speak of."""
        if self.before is None or self.after is None:
            return False
        return abs(self.after - self.before) > _STILL * abs(self.before)

    @property
    def added(self) -> bool:
        """Whether there is anything to compare with."""
        return self.after is not None and self.after != self.before

    @property
    def texts(self) -> tuple[str, str]:
        """Before and after, three digits each."""
        return number_text(self.before), number_text(self.after)

    @property
    def shares(self) -> tuple[float, float]:
        """Lengths of the two bars, of the longer one; zeros where a comparison by length says nothing."""
        if self.change_percent is None or self.before is None or self.after is None:
            return 0.0, 0.0
        longest = max(self.before, self.after)
        return self.before / longest, self.after / longest

    @property
    def change_text(self) -> str:
        """The change in percent, signed; a dash where that says nothing."""
        return percent_text(self.change_percent)

    @property
    def change_percent(self) -> float | None:
        """By how much it changed; None where that says nothing (NIS is best at 1, not at 0)."""
        if self.key == "nis_mean" or self.before is None or self.after is None or self.before <= 0.0:
            return None
        return 100.0 * (self.after / self.before - 1.0)


_FIGURES = (
    ("free_run_rms_rpm", "Free run", "each held-out stretch simulated from its first speed"),
    ("horizon_20s_rms_rpm", "20 s ahead", "prediction from the filtered speed"),
    ("horizon_1s_rms_rpm", "1 s ahead", "prediction from the filtered speed"),
    ("one_step_rms_rpm", "One step", "the filter's innovation"),
    ("torque_rms_mNm", "Residual torque", "what the smoothed speed asks for beyond the model"),
    ("nis_mean", "NIS", "normalised innovation squared; 1 is ideal"),
)


def figure_pairs(document: Mapping[str, Any], units: Units) -> list[FigurePair]:
    """The figures of merit that the document has at all, the most telling first."""
    before, after = document.get("before") or {}, document.get("after") or {}
    pairs = []
    for key, label, note in _FIGURES:
        values = [number_of(metrics.get(key)) for metrics in (before, after)]
        unit = "mNm" if key.endswith("_mNm") else ""
        if key.endswith("_rpm"):
            unit = units.speed
            if not units.wheel:
                values = [None if value is None else rad_s_from_rpm(value) for value in values]
        if values != [None, None]:
            pairs.append(FigurePair(key, label, note, unit, *values))
    return pairs


def verdict_of(document: Mapping[str, Any]) -> tuple[str, str, str]:
    """(kind, its name for people, statement)."""
    verdict = document.get("verdict") or {}
    kind = str(verdict.get("kind", "unexplained"))
    name = VERDICTS.get(kind, kind)
    if kind == "effect" and len(verdict.get("effects") or ()) > 1:
        name = f"{len(verdict['effects'])} effects named"
    return kind, name, str(verdict.get("statement") or "")


def plain_name(effect: str) -> str:
    """An effect's id as a person says it."""
    words = effect.replace("_", " ")
    for name in ("coulomb", "stribeck"):
        words = words.replace(name, name.capitalize())
    return words


def headline_of(document: Mapping[str, Any], units: Units) -> str:
    """The verdict in one line: what was found, and what it is worth."""
    verdict = document.get("verdict") or {}
    kind, _, statement = verdict_of(document)
    effects = [_or_another(str(name), verdict) for name in verdict.get("effects") or ()]
    if kind == "adequate":
        uneven = ", but its noise is not what it should be" if document.get("swallowed") else ""
        if document.get("torque_noise"):
            uneven = ", but its torque noise is not the same everywhere"
        return f"The model explains this log{uneven}"
    if kind == "insufficient_excitation":
        return "This log cannot show what a model lacks"
    likely = [item for item in document.get("explanations") or () if item.get("effects")]
    if kind == "unexplained" and likely:
        perhaps = " or ".join(
            dict.fromkeys(" with ".join(plain_name(name) for name in i["effects"]) for i in likely[:3])
        )
        return f"The model lacks something that this log does not settle, perhaps {perhaps}"
    if kind == "unexplained" or not effects:
        reported = list(document.get("shapes") or ())[:1] or list(document.get("swallowed") or ())[:1]
        left = "".join(f": {item['sentence']}" for item in reported)
        return f"The model lacks something that no effect of the catalogue explains{left}" if statement else ""
    named = effects[0] if len(effects) == 1 else f"{', '.join(effects[:-1])} and {effects[-1]}"
    free_run = next((pair for pair in figure_pairs(document, units) if pair.key == "free_run_rms_rpm"), None)
    if free_run is None or not free_run.moves:
        return f"The model lacks {named}"
    gain = f"{number_text(free_run.before)} -> {number_text(free_run.after)} {free_run.unit}"
    return f"The model lacks {named}: free-run error {gain}"


def _or_another(effect: str, verdict: Mapping[str, Any]) -> str:
    """An effect that was named, and what the log cannot distinguish from it, the most probable first."""
    chances = verdict.get("posterior") or {}
    group = next((list(group) for group in verdict.get("indistinguishable") or () if effect in group), [effect])
    alike = sorted(group, key=lambda name: -(number_of(chances.get(name)) or 0.0))
    return " or ".join(plain_name(str(name)) for name in alike)


def ranked(candidates: Sequence[Mapping[str, Any]]) -> list[Mapping[str, Any]]:
    """Those that were tested: what was added first, then by falling statistic."""

    def rank(candidate: Mapping[str, Any]) -> tuple[bool, float]:
        statistic = number_of(candidate.get("statistic"))
        return standing_of(candidate) != "added", math.inf if statistic is None else -statistic

    return sorted((c for c in candidates if standing_of(c) != "untestable"), key=rank)


def untestable_reasons(candidates: Sequence[Mapping[str, Any]]) -> dict[str, list[str]]:
    """Reason -> effects that could not be tested for it."""
    reasons: dict[str, list[str]] = {}
    for candidate in candidates:
        if standing_of(candidate) == "untestable":
            reason = untestable_because(candidate) or "no reason given"
            reasons.setdefault(reason, []).append(str(candidate["effect"]))
    return reasons


def percent_text(value: object) -> str:
    """A signed percentage; a dash for what is missing."""
    number = number_of(value)
    if number is None:
        return MISSING
    return "0 %" if abs(number) < 0.05 else f"{number:+.{0 if abs(number) >= 10.0 else 1}f} %".replace("-", "−")


def gain_text(candidate: Mapping[str, Any]) -> str:
    """What a candidate does to the held-out error, signed as the figures are; a spike's is that inside the event."""
    from rw_ekf.effects.catalogue import CATALOGUE

    gain = number_of(candidate.get("heldout_gain_percent"))
    if gain is None:
        return MISSING
    effect = CATALOGUE.get(str(candidate.get("effect")))
    return percent_text(-gain) + (" in it" if effect is not None and effect.local_in_time else "")


def probability_text(value: object) -> str:
    """A posterior probability; a dash for what was not weighed."""
    number = number_of(value)
    return MISSING if number is None else chance_text(number)


def statistic_text(value: object) -> str:
    """A test statistic: no decimals where it is large, one where it is not."""
    number = number_of(value)
    if number is None:
        return MISSING
    number = max(number, 0.0)  # twice a difference of logarithms; below 0 a search has not come back to where it began
    rounded_number = round(number, 0 if abs(number) >= 100.0 else 1) + 0.0  # no "-0.0"
    return f"{rounded_number:.{0 if abs(number) >= 100.0 else 1}f}".replace("-", "−")


def p_value_text(value: object) -> str:
    """A p-value to one digit; a dash for what is missing."""
    number = number_of(value)
    if number is None:
        return MISSING
    return "< 1e-16" if number < 1.0e-16 else f"{number:.1g}" if number < 0.1 else f"{number:.2f}"
