"""Numbers as text: as many digits as mean something."""

from __future__ import annotations

import math

MISSING = "–"


def plus_minus(value: float, std: float) -> str:
    """Value and standard deviation with the digits that mean something: "3.02 +- 0.14"."""
    if not math.isfinite(value) or not math.isfinite(std) or std <= 0.0:
        return f"{value:.3g}"
    exponent = math.floor(math.log10(max(abs(value), std)))
    if not -4 <= exponent < 6:
        scale = 10.0**exponent
        return f"({plus_minus(value / scale, std / scale)})e{exponent:+d}" if scale > 0.0 else f"{value:.3g}"
    first = math.floor(math.log10(std))
    leading_one = std / 10.0**first < 1.95
    decimals = max(leading_one - first, 0)
    if decimals > 5 - exponent:
        return f"{value:.{max(5 - exponent, 0)}f} +- {std:.1g}"
    return f"{value:.{decimals}f} +- {std:.{decimals}f}"


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
    """A finite number, or None."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return None
    return float(value) if math.isfinite(value) else None


def chance_text(probability: float) -> str:
    """A probability in percent, without digits that nobody knows: "93 %", "> 99 %"."""
    if probability > 0.99:
        return "> 99 %"
    return "< 1 %" if probability < 0.01 else f"{100.0 * probability:.0f} %"
