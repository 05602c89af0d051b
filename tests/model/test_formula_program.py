"""Programs of formulas against Python's own arithmetic: values, slopes, what has no value, depth; compiled as plain."""

from __future__ import annotations

import math
import sys
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rw_ekf.checking.formula import LONGEST, ONE_ARGUMENT, parsed
from rw_ekf.compiled import Kernel
from rw_ekf.model.formula_program import formula_size, formula_value, program_of
from rw_ekf.model.moment import Moment
from rw_ekf.wheel.equations import EQUATIONS

NUMBERS = {"a": 1.0, "w": 7.0}
FUNCTIONS: dict[str, Any] = {
    **{name: getattr(math, name) for name in (*ONE_ARGUMENT, "atan2") if hasattr(math, name)},
    "abs": abs, "min": min, "max": max, "sgn": lambda x: float((x > 0.0) - (x < 0.0)), "__builtins__": {},
}  # fmt: skip


def _run(program: Any, omega: float, current: float) -> tuple[float, float]:
    return formula_value(program, 0, program.size, Moment(omega, current, 21.0, 0.5, 3.0, 0.0))


compiled = Kernel(
    _run, [*EQUATIONS, sys.modules[__name__]], lambda: (np.zeros(1), 0.0, 0.0), "formula", result=(0.0, 0.0)
)


def of_text(text: str, omega: float, current: float) -> tuple[float, float]:
    """Value and slope as the filter has them."""
    program = program_of(parsed(text, NUMBERS), NUMBERS)
    return formula_value(program, 0, len(program), Moment(omega, current, 21.0, 0.5, 3.0, 0.0))


def by_python(text: str, omega: float, current: float) -> float:
    """The test's own value; NaN where Python has none."""
    try:
        moment = {"omega": omega, "current": current, "temperature": 21.0, "angle": 0.5, "time": 3.0}
        found = eval(text, FUNCTIONS, NUMBERS | moment)  # the test's own text
    except (ArithmeticError, ValueError, TypeError):  # complex numbers, too
        return math.nan
    return found if isinstance(found, float | int) and abs(found) < 1.0e90 else math.nan


LEAVES = st.sampled_from(["omega", "current", "temperature", "angle", "time", "w", "2", "0.3", "pi"]).map(
    lambda name: "3.141592653589793" if name == "pi" else name
)


def _grown(inner: st.SearchStrategy[str]) -> st.SearchStrategy[str]:
    return st.one_of(
        st.tuples(inner, st.sampled_from("+-*/"), inner).map(lambda p: f"({p[0]} {p[1]} {p[2]})"),
        st.tuples(inner, st.sampled_from(["2", "3", "-1", "0.5", "w"])).map(lambda p: f"({p[0]})**({p[1]})"),
        st.tuples(st.sampled_from(ONE_ARGUMENT), inner).map(lambda p: f"{p[0]}({p[1]})"),
        st.tuples(st.sampled_from(["min", "max", "atan2"]), inner, inner).map(lambda p: f"{p[0]}({p[1]}, {p[2]})"),
        inner.map(lambda text: f"(-{text})"),
    )


TEXTS = st.recursive(LEAVES, _grown, max_leaves=12).filter(lambda text: len(text) <= LONGEST)


@settings(deadline=None, max_examples=300, derandomize=True)
@given(TEXTS, st.floats(-200.0, 200.0), st.floats(-0.5, 0.5))
def test_a_program_is_the_formula(text: str, omega: float, current: float) -> None:
    """Value as Python's; slope as a central difference where that is smooth; compiled to the same numbers."""
    value, slope = of_text(text, omega, current)
    expected = by_python(text, omega, current)
    if not math.isnan(expected) and not math.isnan(value):
        assert value == pytest.approx(expected, rel=1e-9, abs=1e-12)
    program = np.array(program_of(parsed(text, NUMBERS), NUMBERS))
    assert compiled(program, omega, current) == pytest.approx((value, slope), rel=1e-12, abs=1e-300, nan_ok=True)
    steps = (1.0e-4, 5.0e-5)
    ends = [[by_python(text, omega + sign * h, current) for sign in (1.0, -1.0)] for h in steps]
    wide, narrow = ((up - down) / (2.0 * h) for (up, down), h in zip(ends, steps, strict=True))
    kink = (ends[1][0] - 2.0 * expected + ends[1][1]) / steps[1]
    scale = max(abs(expected), abs(slope), 1.0)
    smooth = abs(kink) < 1.0e-3 * scale and abs(wide - narrow) < 1.0e-7 * scale  # else it has no derivative there
    if math.isfinite(wide + narrow + slope + value) and smooth and scale < 1.0e5:
        assert slope == pytest.approx(narrow, rel=1e-5, abs=1e-5 * scale)


@pytest.mark.parametrize(
    "text",
    [
        "1/omega", "log(omega)", "sqrt(omega - 1)", "(omega - 1)**0.5", "omega**-1", "exp(1000 + omega)",
        "asin(2 + omega)", "log1p(omega - 2)", "sinh(1e5 + omega)", "(1e60 + omega)*1e60", "1**(1/omega)",
        "min(1/omega, 2)", "abs(1/omega)",
    ],
)  # fmt: skip
def test_what_has_no_value_adds_nothing(text: str) -> None:
    """NaN comes of it, and 0 of that; nothing is raised, in plain Python or compiled."""
    assert math.isnan(of_text(text, 0.0, 0.0)[0])
    program = np.array(program_of(parsed(text, ()), {}))
    assert math.isnan(compiled(program, 0.0, 0.0)[0])
    assert formula_size(program, 0, program.size, 1.0, False, Moment(0.0, 0.0, 20.0, 0.0, 0.0, 0.0)) == (0.0, 0.0)


def test_a_value_without_a_slope_is_level() -> None:
    """The root of the speed has a value at rest; its tangent there is none that a filter may use."""
    at_rest = Moment(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    assert formula_size(program_of(parsed("sqrt(omega)", ()), {}), 0, 2, 1.0, False, at_rest) == (0, 0)


@pytest.mark.parametrize("shape", ["left", "right", "both"])
def test_no_formula_that_may_be_written_needs_more_room_than_there_is(shape: str) -> None:
    """Nested one way or the other, or balanced to the last of its characters."""
    text = "omega"
    if shape == "both":
        while 2 * len(text) + 3 <= LONGEST:
            text = f"({text}-{text.replace('omega', '1')})"
    else:
        for number in range(1, 38):
            text = f"{number}-({text})" if shape == "right" else f"({text})-{number}"
    assert of_text(text, 2.0, 0.0)[0] == pytest.approx(by_python(text, 2.0, 0.0))


def test_a_drag_is_the_same_either_way_round() -> None:
    """Asked for with the size of the speed and the current along the motion; its slope is that by the speed."""
    program = program_of(parsed("omega**2 + current", ()), {})
    forward = formula_size(program, 0, len(program), 1.0, True, Moment(3.0, 0.2, 20.0, 0.0, 0.0, 0.0))
    backward = formula_size(program, 0, len(program), -1.0, True, Moment(-3.0, -0.2, 20.0, 0.0, 0.0, 0.0))
    assert forward == pytest.approx((9.2, 6.0))
    assert backward == pytest.approx((9.2, -6.0))
