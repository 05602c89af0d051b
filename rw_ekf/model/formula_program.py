"""A formula as a row of numbers that the compiled filter runs: no new formula makes anything compile again.

Postfix: a number is pushed, a quantity is pushed, an operation takes what is on top of the stack. Each entry of the
stack has its value and its slope by the speed (a dual number), so that the tangent of effects.md eq. 2 is exact. The
deeper operand comes first (Ershov 1958), so that eight places hold every formula that may be written.

Scalar functions that import only `math`, and behave the same in plain Python and compiled: what has no value, or one
that is too large, is NaN, and whatever is made of it is NaN too.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from rw_ekf.checking.formula import ONE_ARGUMENT, QUANTITIES, TWO_ARGUMENTS
from rw_ekf.model.moment import Moment

if TYPE_CHECKING:
    from rw_ekf.checking.formula import Node

Program = tuple[float, ...]
Stack = tuple[float, float, float, float, float, float, float, float]

CODES = {
    name: code
    for code, name in enumerate(
        ("number", *QUANTITIES, "swap", "neg", *ONE_ARGUMENT, "+", "-", "*", "/", "**", *TWO_ARGUMENTS)
    )
}
_NUMBER, _OMEGA, _CURRENT, _TEMPERATURE, _ANGLE, _TIME = range(6)
_SWAP, _NEG = CODES["swap"], CODES["neg"]
_SIN, _COS, _TAN, _ASIN, _ACOS, _ATAN = (CODES[name] for name in ("sin", "cos", "tan", "asin", "acos", "atan"))
_SINH, _COSH, _TANH = CODES["sinh"], CODES["cosh"], CODES["tanh"]
_EXP, _EXPM1, _LOG, _LOG1P = CODES["exp"], CODES["expm1"], CODES["log"], CODES["log1p"]
_SQRT, _ABS, _SGN = CODES["sqrt"], CODES["abs"], CODES["sgn"]
_ADD, _SUB, _MUL, _DIV, _POW = (CODES[name] for name in ("+", "-", "*", "/", "**"))
_ATAN2, _MIN = CODES["atan2"], CODES["min"]
_COMMUTE = ("+", "*", "min", "max")
_NOWHERE = Moment(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)  # for what depends on nothing
_EMPTY: Stack = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
_LARGEST = 1.0e100  # of any value on the way
_LARGEST_RESULT = 1.0e12  # in SI units: no drag or torque per inertia is like that
_MOST_EXPONENT = 230.0  # exp of it is 1e100
AT_REST_RAD_S = 1.0e-6  # the speed at which a drag is evaluated at rest: its limit from slow motion


def program_of(tree: Node, numbers: Mapping[str, float]) -> Program:
    """The program of a tree in which all names but the quantities have these numbers."""
    return tuple(_emitted(tree, numbers)[0])


def _emitted(node: Node, numbers: Mapping[str, float]) -> tuple[list[float], int, bool]:
    """(program, places of the stack that it needs, whether it is a number)."""
    if node.op == "number" or node.name in numbers:
        return [float(_NUMBER), node.value if node.op == "number" else float(numbers[node.name])], 1, True
    if node.op == "name":
        return [float(CODES[node.name])], 1, False
    parts = [_emitted(part, numbers) for part in node.parts]
    code, depth = [*parts[0][0]], parts[0][1]
    if len(parts) == 2:
        (left, left_depth, _), (right, right_depth, _) = parts
        if right_depth > left_depth:
            code, depth = [*right, *left, *([] if node.op in _COMMUTE else [float(_SWAP)])], right_depth
        else:
            code, depth = [*left, *right], max(left_depth, right_depth + 1)
    code.append(float(CODES[node.op]))
    constant = all(part[2] for part in parts)
    if constant:
        code, depth = [float(_NUMBER), formula_value(code, 0, len(code), _NOWHERE)[0]], 1
    return code, depth, constant


def known(value: float) -> float:
    """The value where it is one that a formula may have, else NaN."""
    return value if abs(value) <= _LARGEST else math.nan


def power_of(base: float, exponent: float) -> float:
    """A power, NaN where that is not a real number."""
    if math.isnan(base) or math.isnan(exponent):
        return math.nan
    if base == 0.0:
        return math.nan if exponent < 0.0 else (1.0 if exponent == 0.0 else 0.0)
    whole = exponent == math.floor(exponent)
    if (base < 0.0 and not whole) or abs(exponent * math.log(abs(base))) > _MOST_EXPONENT:
        return math.nan
    size = math.exp(exponent * math.log(abs(base)))
    if whole and abs(exponent) <= 8.0:  # as products, which are exact where these are
        size = 1.0
        for _ in range(int(abs(exponent))):
            size *= abs(base)
        if exponent < 0.0:
            size = 1.0 / size
    odd = whole and math.floor(0.5 * exponent) != 0.5 * exponent
    return -size if base < 0.0 and odd else size


def one_argument(code: int, x: float) -> tuple[float, float]:
    """(value, derivative) of a function; NaN where there is none. At 0 abs has the slope 1, and sgn is 0."""
    if math.isnan(x):
        return math.nan, math.nan
    if code in (_EXP, _EXPM1, _SINH, _COSH):
        return exponential(code, x)
    if code in (_ASIN, _ACOS, _SQRT, _LOG, _LOG1P):
        return of_a_range(code, x)
    return of_any_number(code, x)


def of_any_number(code: int, x: float) -> tuple[float, float]:
    """The same of a function that has a value for every number."""
    if code == _NEG:
        return -x, -1.0
    if code == _SIN:
        return math.sin(x), math.cos(x)
    if code == _COS:
        return math.cos(x), -math.sin(x)
    if code == _TAN:
        value = math.tan(x)
        return value, 1.0 + value * value
    if code == _ATAN:
        return math.atan(x), 1.0 / (1.0 + x * x)
    if code == _TANH:
        value = math.tanh(x)
        return value, 1.0 - value * value
    if code == _ABS:
        return abs(x), 1.0 if x >= 0.0 else -1.0
    return math.copysign(1.0, x) if x != 0.0 else 0.0, 0.0


def of_a_range(code: int, x: float) -> tuple[float, float]:
    """The same of a function that has none beyond a range; at the end of one the slope has no bound."""
    value, slope = math.nan, math.nan
    if code in (_ASIN, _ACOS):
        if abs(x) <= 1.0:
            value = math.asin(x) if code == _ASIN else math.acos(x)
            if abs(x) < 1.0:
                slope = (1.0 if code == _ASIN else -1.0) / math.sqrt(1.0 - x * x)
    elif code == _SQRT:
        if x >= 0.0:
            value = math.sqrt(x)
            if x > 0.0:
                slope = 0.5 / value
    elif code == _LOG:
        if x > 0.0:
            value, slope = math.log(x), 1.0 / x
    elif x > -1.0:
        value, slope = math.log1p(x), 1.0 / (1.0 + x)
    return value, slope


def exponential(code: int, x: float) -> tuple[float, float]:
    """The same of a function that grows beyond all bounds: NaN where it is too large."""
    if abs(x) > _MOST_EXPONENT:
        if x < 0.0 and code in (_EXP, _EXPM1):
            return 0.0 if code == _EXP else -1.0, 0.0
        return math.nan, math.nan
    if code == _EXP:
        return math.exp(x), math.exp(x)
    if code == _EXPM1:
        return math.expm1(x), math.exp(x)
    if code == _SINH:
        return math.sinh(x), math.cosh(x)
    return math.cosh(x), math.sinh(x)


def two_arguments(code: int, x: float, y: float) -> tuple[float, float, float]:
    """(value, derivative by x, derivative by y) of an operation; NaN where there is none."""
    value, of_x, of_y = math.nan, math.nan, math.nan
    if math.isnan(x) or math.isnan(y):
        return value, of_x, of_y
    if code == _ADD:
        return x + y, 1.0, 1.0
    if code == _SUB:
        return x - y, 1.0, -1.0
    if code == _MUL:
        return x * y, y, x
    if code == _DIV:
        if y != 0.0:
            value = x / y
            of_x, of_y = 1.0 / y, -value / y
    elif code == _POW:
        value = power_of(x, y)
        of_x = 0.0 if y == 0.0 else y * power_of(x, y - 1.0)
        if x > 0.0:
            of_y = value * math.log(x)
    elif code == _ATAN2:
        value, square = math.atan2(x, y), x * x + y * y
        if square > 0.0:
            of_x, of_y = y / square, -x / square
    elif (x <= y) == (code == _MIN):  # min, and max
        value, of_x, of_y = x, 1.0, 0.0
    else:
        value, of_x, of_y = y, 0.0, 1.0
    return value, of_x, of_y


def moved(slope: float, by: float) -> float:
    """A derivative times what its argument moves by: nothing where that does not move, whatever the derivative."""
    return slope * by if by != 0.0 else 0.0


def pushed(stack: Stack, x: float) -> Stack:
    """With a number on top."""
    return x, stack[0], stack[1], stack[2], stack[3], stack[4], stack[5], stack[6]


def swapped(stack: Stack) -> Stack:
    """The upper two exchanged."""
    return stack[1], stack[0], stack[2], stack[3], stack[4], stack[5], stack[6], stack[7]


def replaced(stack: Stack, x: float) -> Stack:
    """With a number in the place of the top."""
    return x, stack[1], stack[2], stack[3], stack[4], stack[5], stack[6], stack[7]


def joined(stack: Stack, x: float) -> Stack:
    """With a number in the place of the upper two."""
    return x, stack[2], stack[3], stack[4], stack[5], stack[6], stack[7], 0.0


def formula_value(values: Any, start: int, count: int, at: Moment) -> tuple[float, float]:
    """(value, slope by omega) of the program values[start:start + count]; NaN where there is none."""
    top, slopes = _EMPTY, _EMPTY
    step = start
    while step < start + count:
        code = int(values[step])
        step += 1
        if code <= _TIME:
            x, slope = at.omega, 0.0
            if code == _NUMBER:
                x = values[step]
                step += 1
            elif code == _OMEGA:
                slope = 1.0
            elif code == _CURRENT:
                x = at.current
            elif code == _TEMPERATURE:
                x = at.temperature
            elif code == _ANGLE:
                x = at.angle
            else:
                x = at.time
            top, slopes = pushed(top, x), pushed(slopes, slope)
        elif code == _SWAP:
            top, slopes = swapped(top), swapped(slopes)
        elif code < _ADD:
            x, slope = one_argument(code, top[0])
            top, slopes = replaced(top, known(x)), replaced(slopes, moved(slope, slopes[0]))
        else:
            x, of_x, of_y = two_arguments(code, top[1], top[0])
            slope = moved(of_x, slopes[1]) + moved(of_y, slopes[0])
            top, slopes = joined(top, known(x)), joined(slopes, slope)
    return top[0], slopes[0]


def formula_size(values: Any, start: int, count: int, along: float, of_motion: bool, at: Moment) -> tuple[float, float]:
    """(value, slope by the speed itself) over a step, as an effect has them: 0 where no value is, level where no slope.

    along: 1.0 or -1.0, the way the wheel turns or would. of_motion: a drag, which is the same either way: evaluated
    with the size of the speed and the current along the motion. The angle is that in the middle of the step.
    """
    omega, current = at.omega, at.current
    if of_motion:
        omega, current = max(abs(omega), AT_REST_RAD_S), current * along
    middle = at.angle + 0.5 * at.omega * at.duration
    value, slope = formula_value(
        values, start, count, Moment(omega, current, at.temperature, middle, at.time, at.duration, at.columns)
    )
    if not abs(value) <= _LARGEST_RESULT:
        return 0.0, 0.0
    if not abs(slope) <= _LARGEST_RESULT:
        slope = 0.0
    return value, slope * along if of_motion else slope
