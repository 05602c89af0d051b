"""Effects by formulas of a user's own: every sign, function and quantity of docs/own-effects.md between them."""

from __future__ import annotations

from pathlib import Path

from rw_ekf.checking.effect_file import read_effect_file
from rw_ekf.effects.catalogue import CATALOGUE_IDS
from rw_ekf.effects.own_effect import effect_of
from rw_ekf.model.effect import Term
from rw_ekf.wheel.effect_table import EffectSet

# Kind and formula of each; `ranges` and `powers` have no value at many places. w is the one constant.
OWN = {
    "eddy": ("drag", "a * omega / (1 + (omega / w)**2)"),
    "warm": ("viscous", "a * exp(-temperature / 30) * cosh(omega / 40)"),
    "ripple": ("torque", "a * sin(angle + 0.3) * max(current, -0.01)**3 - a * atan2(omega, current) * 0.1"),
    "weak": ("motor_gain", "a * tanh(time / 20) * min(cos(angle), abs(current))"),
    "ranges": ("torque", "a * (sqrt(omega) + log(omega - 2) + asin(omega / 9) - acos(current) + log1p(temperature))"),
    "powers": ("drag", "a * (omega**0.5 + omega**-2 + 2**(omega / 5) - sgn(current) * omega**2 / w)"),
    "dry": ("drag", "a"),
    "others": ("torque", "a * (tan(angle) + atan(omega) + sinh(current) + expm1(omega / 9) - abs(omega) * pi / 10)"),
}
_UNITS = {"drag": "rad/s^2", "viscous": "1/s", "torque": "rad/s^2", "motor_gain": "1"}


def own_effects(folder: Path, *names: str) -> EffectSet:
    """Those of these names, from a file that has them."""
    lines = []
    for name in names:
        kind, formula = OWN[name]
        constant = ", w: {unit: rad/s, start: 9, range: [1, 500]}" if "w" in formula else ""
        unit = "1/s" if name == "eddy" else _UNITS[kind]
        lines.append(f'{name}: {{{kind}: "{formula}", a: {{unit: {unit}}}{constant}}}\n')
    file = folder / "own.yaml"
    file.write_text("".join(lines))
    terms = []
    for formula_of in read_effect_file(file, CATALOGUE_IDS):
        start = next((constant.start or 0.0 for constant in formula_of.constants), 0.0)
        terms.append(Term.of(effect_of(formula_of), (start, 0.0, 0.0), 0.02, 0.01))
    return EffectSet(tuple(terms))
