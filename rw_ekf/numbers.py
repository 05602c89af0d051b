"""Numbers as text: as many digits as mean something."""

from __future__ import annotations

import math
from typing import NamedTuple

MISSING = "–"


class Rounded(NamedTuple):
    """Digits of a value and of its standard deviation that mean something; empty for a deviation that is none."""

    value: str
    sigma: str = ""
    power: str = ""  # of ten, of both: "e-6"

    @property
    def text(self) -> str:
        """As `plus_minus` has it: "3.02 +- 0.14", or "(3.02 +- 0.14)e-6"."""
        if not self.sigma:
            return self.value
        text = f"{self.value} +- {self.sigma}"
        return f"({text}){self.power}" if self.power else text


def rounded(value: float, std: float) -> Rounded:
    """Value and standard deviation with the digits that mean something."""
    if not math.isfinite(value) or not math.isfinite(std) or std <= 0.0:
        return Rounded(f"{value:.3g}")
    exponent = math.floor(math.log10(max(abs(value), std)))
    if not -4 <= exponent < 6:
        scale = 10.0**exponent
        if scale <= 0.0:
            return Rounded(f"{value:.3g}")
        return rounded(value / scale, std / scale)._replace(power=f"e{exponent:+d}")
    first = math.floor(math.log10(std))
    leading_one = std / 10.0**first < 1.95
    decimals = max(leading_one - first, 0)
    if decimals > 5 - exponent:
        return Rounded(f"{value:.{max(5 - exponent, 0)}f}", f"{std:.1g}")
    return Rounded(f"{value:.{decimals}f}", f"{std:.{decimals}f}")


def plus_minus(value: float, std: float) -> str:
    """Value and standard deviation with the digits that mean something: "3.02 +- 0.14"."""
    return rounded(value, std).text


def number_text(value: object, digits: int = 3) -> str:
    """Three significant digits, no exponent where a person does without; a dash for what is missing."""
    number = number_of(value)
    if number is None:
        return MISSING
    text = f"{number:.{digits}g}"
    size = abs(float(text))
    if not 1.0e-4 <= size < 1.0e6:
        return text
    return f"{number:.{max(0, digits - 1 - math.floor(math.log10(size)))}f}"


def number_of(value: object) -> float | None:
    """A finite number that a double holds, or None."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return None
    try:
        return float(value) if math.isfinite(value) else None
    except OverflowError:  # an integer of three hundred digits and more
        return None


def chance_text(probability: float) -> str:
    """A probability in percent, without digits that nobody knows: "93 %", "> 99 %"."""
    if probability > 0.99:
        return "> 99 %"
    return "< 1 %" if probability < 0.01 else f"{100.0 * probability:.0f} %"


def p_text(p: float) -> str:
    """A probability that says how unlikely noise alone is, to one digit: "p = 2e-05"."""
    return f"p = {max(p, 1.0e-99):.0e}"
