"""Formulas of a user's own: what is read, and what is refused with its place in the file."""

from __future__ import annotations

from pathlib import Path

import pytest

from rw_ekf.checking.effect_file import own_formula, read_effect_file
from rw_ekf.checking.formula import LONGEST, FormulaError, parsed
from rw_ekf.errors import ConfigError

EDDY = (
    'eddy: {drag: "a * omega / (1 + (omega / w0)**2)", a: {unit: 1/s}, w0: {unit: rad/s, start: 50, range: [1, 500]}}'
)


def findings(tmp_path: Path, text: str | bytes) -> list[str]:
    """What is said of a file, without the folder."""
    path = tmp_path / "my.yaml"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(ConfigError) as caught:
        read_effect_file(path, {"quadratic_drag"})
    return [line.removeprefix(f"{tmp_path}/") for line in caught.value.findings]


def test_the_formula_of_the_manual_is_read(tmp_path: Path) -> None:
    """Id, kind, text, coefficient and constant; the document is the file again."""
    path = tmp_path / "my.yaml"
    path.write_text(EDDY)
    (eddy,) = read_effect_file(path, ())
    assert (eddy.id, eddy.kind, eddy.coefficient.name, eddy.coefficient.unit) == ("eddy", "drag", "a", "1/s")
    assert eddy.constants == (("w0", "rad/s", 50.0, 1.0, 500.0),)
    assert own_formula("eddy", eddy.document()) == eddy


def one(formula: str, more: str = "") -> str:
    return f"x: {{drag: {formula}, a: {{unit: 1/s}}{more}}}"


# text of the file, and how its only finding begins, or what it holds
WRONG = {
    "unknown name": (one("a*omegaa"), "my.yaml:1:13: x.drag has the unknown name 'omegaa'; did you mean 'omega'?"),
    "unknown function": (one("a*foo(omega)"), "my.yaml:1:13: x.drag has the unknown function 'foo'"),
    "import": (one("\"__import__('os').system('id')\""), "my.yaml:1:12: x.drag has something that is no arithmetic"),
    "attribute": (one("a*omega.real"), "my.yaml:1:13: x.drag has something that is no arithmetic: a dot"),
    "call of a quantity": (one("a*omega(2)"), "my.yaml:1:13: x.drag calls something that is no function"),
    "call of a call": (one("a*sin(omega)(2)"), "my.yaml:1:13: x.drag calls something that is no function"),
    "function alone": (one("a*sin"), "my.yaml:1:13: x.drag has sin without its argument"),
    "arguments": (one('"a*atan2(omega)"'), "my.yaml:1:14: x.drag gives atan2 other than two arguments"),
    "starred": (one('"a*sin(*omega)"'), "my.yaml:1:14: x.drag gives sin other than one argument"),
    "keyword": (one('"a*sin(x=omega)"'), "my.yaml:1:14: x.drag gives sin other than one argument"),
    "caret": (one("a*omega^2"), "my.yaml:1:11: x.drag has something that is no arithmetic: ^ is no power"),
    "comparison": (one('"a*(omega > 2)"'), "my.yaml:1:15: x.drag has something that is no arithmetic: a comparison"),
    "condition": (one('"a*(1 if omega else 2)"'), "my.yaml:1:15: x.drag has something that is no arithmetic: cond"),
    "lambda": (one('"lambda: a"'), "my.yaml:1:12: x.drag has something that is no arithmetic"),
    "walrus": (one('"(a := omega)"'), "my.yaml:1:13: x.drag has something that is no arithmetic"),
    "text": (one("a*'omega'"), "my.yaml:1:13: x.drag has 'omega', which is no number"),
    "true": (one("a*True"), "my.yaml:1:13: x.drag has True, which is no number"),
    "complex": (one("a*2j"), "my.yaml:1:13: x.drag has 2j, which is no number"),
    "huge": (one("a*1e999"), "my.yaml:1:13: x.drag has a number that is too large"),
    "never closed": (one("'a * (omega'"), "my.yaml:1:16: x.drag is not a formula: '(' was never closed"),
    "two formulas": (one("a omega"), "my.yaml:1:1"),
    "zero bytes": (one('"a*\\0omega"'), "my.yaml:1:12: x.drag is not a formula"),
    "empty formula": (one("''"), "my.yaml:1:12: x.drag is empty"),
    "too long": (one("+".join(["a"] * LONGEST)), f"my.yaml:1:11: x.drag has {2 * LONGEST - 1} characters"),
    "too deep": (one("-" * 120 + "a"), "my.yaml:1:111: x.drag is nested more than 100 deep"),
    "block": ("x:\n  drag: |\n    a *\n    foo(omega)\n  a: {unit: 1}", "my.yaml:4:5: x.drag has the unknown function"),
    "folded": ("x:\n  drag: a *\n     omega + om\n  a: {unit: 1}", "my.yaml:3:14: x.drag has the unknown name 'om'"),
    "umlaut": (one('"a*(ä + omega)"'), "my.yaml:1:15: x.drag has the unknown name 'ä'"),
    "no number": (one("3"), "my.yaml:1:11: x.drag must be a formula as text, found 3"),
    "sum": (one("a*omega + omega"), "my.yaml:1:11: x.drag must be proportional to a"),
    "squared": (one("a*a*omega"), "my.yaml:1:11: x.drag must be proportional to a"),
    "inverse": (one("omega/a"), "my.yaml:1:11: x.drag must be proportional to a"),
    "in a function": (one("omega*exp(a)"), "my.yaml:1:17: x.drag must be proportional to a"),
    "in a power": (one("a**1"), "my.yaml:1:11: x.drag must be proportional to a"),
    "without it": (one("omega"), "my.yaml:1:11: x.drag must be proportional to a"),
    "missing unit": ("x: {drag: a*omega, a: {}}", "my.yaml:1:20: x.a needs a unit"),
    "unit is a list": ("x: {drag: a*omega, a: {unit: [1]}}", "my.yaml:1:30: x.a.unit must be text"),
    "no table": ("x: {drag: a*omega, a: 1/s}", "my.yaml:1:20: x.a must be a table"),
    "range reversed": (one("a*w", ", w: {unit: 1, start: 2, range: [3, 1]}"), "my.yaml:1:62: x.w.range is 3 to 1"),
    "range of one": (one("a*w", ", w: {unit: 1, start: 2, range: [3]}"), "my.yaml:1:62: x.w.range must be two numbers"),
    "start outside": (one("a*w", ", w: {unit: 1, start: 5, range: [1, 3]}"), "my.yaml:1:52: x.w.start is 5, outside"),
    "start without range": (one("a*w", ", w: {unit: 1, start: 5}"), "my.yaml:1:32: x.w has a start and no range"),
    "no coefficient": ("x: {drag: w, w: {unit: 1, start: 1, range: [0, 2]}}", "my.yaml:1:1: x has a start for every"),
    "two coefficients": (one("a*b", ", b: {unit: 1}"), "my.yaml:1:32: x.b needs a start and a range"),
    "four constants": (
        one("a*b*c*d*e", "".join(f", {n}: {{unit: 1, start: 1, range: [0, 2]}}" for n in "bcde")),
        "my.yaml:1:155: x.e is one too many",
    ),
    "unused": (one("a", ", b: {unit: 1, start: 1, range: [0, 2]}"), "my.yaml:1:30: x.b is not in the formula"),
    "unknown key": ("x: {drag: a, a: {unit: 1, star: 2}}", "my.yaml:1:27: x.a.star is an unknown key; did you mean"),
    "reserved": ("x: {drag: omega, omega: {unit: 1}}", "my.yaml:1:18: x.omega is no name for a parameter"),
    "no formula": ("x: {a: {unit: 1}}", "my.yaml:1:1: x must have exactly one formula"),
    "both": ("x: {drag: a, torque: a, a: {unit: 1}}", "my.yaml:1:1: x must have exactly one formula"),
    "id of the catalogue": ("quadratic_drag: {drag: a, a: {unit: 1}}", "my.yaml:1:1: quadratic_drag is an effect of"),
    "numbered id": ("quadratic_drag_2: {drag: a, a: {unit: 1}}", "my.yaml:1:1: quadratic_drag_2 is an effect of"),
    "taken id": ("none: {drag: a, a: {unit: 1}}", "my.yaml:1:1: none means something else"),
    "odd id": ("My-Drag: {drag: a, a: {unit: 1}}", "my.yaml:1:1: My-Drag is no id"),
    "long id": ("x" * 41 + ": {drag: a, a: {unit: 1}}", "my.yaml:1:1: " + "x" * 41 + " is no id"),
    "repeated id": (one("a") + "\n" + one("a"), "my.yaml:2:1: key 'x' is repeated"),
    "repeated parameter": (one("a", ", a: {unit: 1}"), "my.yaml:1:30: key 'a' is repeated"),
    "list": ("- x", "my.yaml:1:1: a file of effects is a table"),
    "empty": ("", "my.yaml:1:1: the file is empty"),
    "binary": (b"\x89PNG\r\n\x1a\n\xff\xfe", "my.yaml:1:1: not UTF-8 text"),
    "too many": ("\n".join(f"x{i}a: {{drag: a, a: {{unit: 1}}}}" for i in range(21)), "my.yaml:1:1: 21 effects"),
}  # fmt: skip


@pytest.mark.parametrize(("text", "begins"), WRONG.values(), ids=WRONG.keys())
def test_what_is_wrong_is_told_with_its_place(tmp_path: Path, text: str | bytes, begins: str) -> None:
    """File, line, column, and what was found; one finding for one mistake."""
    stated = findings(tmp_path, text)
    assert stated[0].startswith(begins)
    assert len(stated) == 1


def test_every_mistake_of_a_file_is_told_at_once(tmp_path: Path) -> None:
    """One line each, in the order of the file."""
    stated = findings(tmp_path, "\n".join(("x: {drag: a*b, a: {unit: 1}}", EDDY, "y: {torque: q, q: {}}")))
    assert [line.split(": ")[0] for line in stated] == ["my.yaml:1:13", "my.yaml:3:16"]


def test_a_file_that_is_not_there_is_named(tmp_path: Path) -> None:
    """As any other file is."""
    with pytest.raises(ConfigError, match="no such file"):
        read_effect_file(tmp_path / "my.yaml", ())


@pytest.mark.parametrize(
    "text", ["(" * 300 + "a" + ")" * 99, "a*" + "9" * 398, "a" * 400, "*" * 400, "\\", "a;b", "a#"]
)
def test_nothing_but_a_formula_error_comes_of_any_text(text: str) -> None:
    """Whatever Python's parser makes of it."""
    try:
        parsed(text, ["a"])
    except FormulaError as error:
        assert 0 <= error.at <= len(text)  # noqa: PT017 - not every text is refused
