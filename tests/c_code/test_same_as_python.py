"""What is printed as C computes what Python computes, to the last bit: random expressions."""

from __future__ import annotations

import math
import random
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rw_ekf.c_code import c_library
from rw_ekf.compiled import Kernel
from tests.c_code.modules import load

REALS, WHOLE, FLAGS = ("a", "b", "c"), ("i", "j"), ("on", "off")
OF_ONE = ("math.exp", "math.log1p", "math.sqrt", "math.sin", "math.tanh", "math.floor", "math.erf", "abs", "-", "float")
OF_TWO = ("math.atan2", "math.copysign", "math.fmod", "min", "max")
EXPRESSIONS, INPUTS = 120, 400


def real(draw: random.Random, depth: int) -> str:
    """A random expression that is a number."""
    kind = draw.randrange(9) if depth else 8
    if kind == 0:
        return f"({real(draw, depth - 1)} {draw.choice('+-*/')} {real(draw, depth - 1)})"
    if kind == 1:
        return f"({draw.choice(OF_ONE)}({real(draw, depth - 1)}))"
    if kind == 2:
        return f"{draw.choice(OF_TWO)}({real(draw, depth - 1)}, {real(draw, depth - 1)})"
    if kind == 3:
        return f"({real(draw, depth - 1)} if {flag(draw, depth - 1)} else {real(draw, depth - 1)})"
    if kind == 4:
        return f"({real(draw, depth - 1)} {draw.choice(['%', '//'])} {real(draw, depth - 1)})"
    if kind == 5:
        return f"({real(draw, depth - 1)} ** {draw.choice(['2', '3', '0.5', '-1.0'])})"
    if kind == 6:
        return f"({real(draw, depth - 1)} + {whole(draw, depth - 1)})"
    if kind == 7:
        return f"({whole(draw, depth - 1)} / {real(draw, depth - 1)})"
    # A compiler rounds a function of a number that it knows better than the C library does: no constant stands alone.
    return draw.choice([*REALS, "(a * 0.75)", "(b - -2.5)", "(1e-3 / c)"])


def whole(draw: random.Random, depth: int) -> str:
    """A random expression that is a whole number."""
    if not depth or draw.random() < 0.3:
        return draw.choice([*WHOLE, "3", "-4"])
    if draw.random() < 0.2:
        return f"({whole(draw, depth - 1)} if {flag(draw, depth - 1)} else {whole(draw, depth - 1)})"
    return f"({whole(draw, depth - 1)} {draw.choice(['+', '-', '*', '%', '//'])} {whole(draw, depth - 1)})"


def flag(draw: random.Random, depth: int) -> str:
    """A random condition."""
    kind = draw.randrange(4) if depth else 3
    if kind == 0:
        return f"({flag(draw, depth - 1)} {draw.choice(['and', 'or'])} {flag(draw, depth - 1)})"
    if kind == 1:
        return f"(not {flag(draw, depth - 1)})"
    if kind == 2:
        sign = draw.choice(["<", "<=", ">", "==", "!="])
        return f"({real(draw, depth - 1)} {sign} {real(draw, depth - 1)})"
    return draw.choice(FLAGS)


def evaluated(text: str, given: dict[str, Any]) -> float | None:
    """By Python; None where it raises, or gets to numbers that a whole number in C does not hold."""
    try:
        found = eval(text, {"math": math, "abs": abs, "min": min, "max": max, "float": float}, given)
    except (ArithmeticError, ValueError, TypeError):
        return None
    return float(found) if isinstance(found, int | float) else None


@pytest.mark.parametrize("seed", range(3))
def test_random_expressions_have_python_s_bits(seed: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Numbers, whole numbers of either sign, flags and what mixes them: wherever Python has a value, C has its bits."""
    monkeypatch.setenv(c_library.FOLDER_VARIABLE, str(tmp_path / "kept"))
    draw = random.Random(seed)
    texts = [real(draw, 4) for _ in range(EXPRESSIONS)] + [whole(draw, 3) for _ in range(EXPRESSIONS // 4)]
    head = "def law(a: float, b: float, c: float, i: int, j: int, on: bool, off: bool, out) -> None:\n"
    lines = "".join(f"    out[{k}] = {text}\n" for k, text in enumerate(texts))
    module = load(tmp_path, f"printed_law_{seed}", "import math\n\n\n" + head + lines)
    law = Kernel(module.law, [module], lambda: (0.0, 0.0, 0.0, 0, 0, False, False, np.zeros(0)))
    law.compile()
    compared = 0
    for _ in range(INPUTS):
        a, b, c = (draw.choice([draw.gauss(0.0, 3.0), draw.uniform(-1.0, 1.0), 0.0, 2.0]) for _ in range(3))
        given = {"a": a, "b": b, "c": c, "i": draw.randint(-9, 9), "j": draw.randint(-9, 9)}
        flags = {"on": draw.random() < 0.5, "off": draw.random() < 0.5}
        out = np.zeros(len(texts))
        law(*given.values(), *flags.values(), out)
        for text, found in zip(texts, out, strict=True):
            expected = evaluated(text, given | flags)
            if expected is not None and math.isfinite(expected):
                compared += 1
                assert found == expected, (text, given, flags)
    assert compared > 0.3 * INPUTS * len(texts)
