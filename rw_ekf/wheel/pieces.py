"""The flow over one sample interval with effects: pieces re-read, terms gathered, then the model's own exact flow.

docs/effects.md eq. 1-6. Scalars and indexed arrays only: plain Python calls it online, compiled it runs over logs.
"""

from typing import Any, NamedTuple

from rw_ekf.model.flow import flow, goes_evenly
from rw_ekf.model.formula_program import formula_size
from rw_ekf.model.friction import FrictionCurve, Stribeck
from rw_ekf.model.law import (
    DRAG,
    FORMULA,
    LOSS,
    Place,
    law_contribution,
    law_place,
    law_value,
    linear_contribution,
    motion,
)
from rw_ekf.model.moment import Moment as Moment  # noqa: PLC0414 - the filter has it from here
from rw_ekf.model.state import COULOMB, MOTOR_GAIN, SPEED, STATIC, VISCOUS
from rw_ekf.wheel.dispatch import contribution, contribution_slope, lagged, memory_flow
from rw_ekf.wheel.effect_table import EffectTable
from rw_ekf.wheel.interval import Interval, Pieces
from rw_ekf.wheel.window import lateness, rounding

_HELD = 0.05  # of the Stribeck speed
_STEP = 1.0e-3  # of a friction or the Stribeck speed, in differences over one piece
_LEAST_VISCOUS_STEP = 1.0e-6  # 1/s
_COEFFICIENT_STEP = 1.0e-3
_INPUTS = 7  # of a flow with a memory: speed, memory, drive, b, c, s, the effect's coefficient
_LEAST_SHAPE = 0.05  # of the model's Stribeck speed, that an effect's is at least
_LAG_STEPS = 8  # a step of a lagging current is half a time constant, or this share of what is left


class Terms(NamedTuple):
    """Sum of the static effects' contributions to one step (effects.md eq. 1)."""

    amperes: float  # A
    external: float  # rad/s^2
    viscous: float  # 1/s
    viscous_factor: float
    dry_factor: float
    dry: float  # rad/s^2


def _law_place(table: EffectTable, j: int, at: Moment) -> Place:
    """Where the functions of the j-th law are looked at; a formula's are looked at as they are run."""
    if table.law_over[j] == FORMULA:
        return Place(-1, 0.0, 0.0, 0, 0.0, 0.0, 0.0)
    return law_place(table.law_count[j], table.law_first[j], table.law_per[j], table.law_over[j], at)


def _of_law(table: EffectTable, j: int, i: int, along: float, place: Place, at: Moment) -> tuple[float, float]:
    """The i-th function of the j-th law, or its formula, in a step: its size and its slope by the speed."""
    count = table.law_count[j]
    start = table.law_start[j] + i * count
    if table.law_over[j] == FORMULA:
        return formula_size(table.law_values, start, count, along, table.law_kind[j] == DRAG, at)
    return law_value(table.law_values, table.law_sums, start, count, place)


def _law_size(x: Any, table: EffectTable, j: int, along: float, place: Place, at: Moment) -> tuple[float, float]:
    """Size of the j-th law in a step, and its slope by the speed."""
    size, slope = 0.0, 0.0
    for i in range(table.law_functions[j]):
        a = x[table.law_at[j] + i]
        if a == 0.0:
            continue
        value, rise = _of_law(table, j, i, along, place, at)
        size += a * value
        slope += a * rise
    return size, slope


def _gather_laws(x: Any, table: EffectTable, at: Moment) -> tuple[float, float, float, float]:
    """What learned laws and formulas add to one step: amperes, external, viscous and dry, as in `Terms`."""
    amperes, external, viscous, dry = 0.0, 0.0, 0.0, 0.0
    for j in range(table.law_at.shape[0]):
        along, place = motion(at.omega, at.current), _law_place(table, j, at)
        size, slope = _law_size(x, table, j, along, place, at)
        part = law_contribution(table.law_kind[j], size, slope, along, at.omega, at.current)
        amperes += part[0]
        external += part[1]
        viscous += part[2]
        dry += part[5]
    return amperes, external, viscous, dry


def _gather(x: Any, table: EffectTable, at: Moment) -> Terms:
    """Sum of the static effects' contributions to one step."""
    amperes, external, viscous, viscous_factor, dry_factor, dry = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for j in range(table.static_at.shape[0]):
        a = x[table.static_at[j]]
        if a == 0.0:  # a hypothesis of which only the slope is needed
            continue
        q = table.static_shape[j]
        part = contribution(table.static_code[j], a, (q[0], q[1], q[2]), at)
        amperes += part[0]
        external += part[1]
        viscous += part[2]
        viscous_factor += part[3]
        dry_factor += part[4]
        dry += part[5]
    if table.law_at.shape[0] > 0:
        laws = _gather_laws(x, table, at)
        amperes += laws[0]
        external += laws[1]
        viscous += laws[2]
        dry += laws[3]
    return Terms(amperes, external, viscous, viscous_factor, dry_factor, dry)


def stribeck_of(x: Any, table: EffectTable, stribeck: Stribeck) -> Stribeck:
    """The Stribeck curve in force: the model's, unless an effect has another."""
    if table.stribeck_at >= 0:
        return Stribeck(max(x[table.stribeck_at], _LEAST_SHAPE * stribeck.omega_s), table.stribeck_law)
    return stribeck


def driven_by(x: Any, table: EffectTable, stribeck: Stribeck, at: Moment) -> tuple[Terms, float, FrictionCurve]:
    """What moves the wheel over a step: the static effects' terms, the drive [rad/s^2] and the friction curve."""
    terms = _gather(x, table, at)
    drive = x[MOTOR_GAIN] * (at.current + terms.amperes) + terms.external
    b = x[VISCOUS] * (1.0 + terms.viscous_factor) + terms.viscous
    level = x[COULOMB] * terms.dry_factor + terms.dry
    return terms, drive, FrictionCurve(b, x[COULOMB] + level, x[STATIC] + level, stribeck.omega_s, stribeck.law)


def _chain_static(
    x: Any, table: EffectTable, row: Any, to: int, at: Moment, of_drive: float, of_b: float, of_dry: float
) -> None:
    """Add the slopes by the coefficients of the static effects, learned laws among them, to a row that begins at `to`.

    of_drive, of_b, of_dry: slopes of the step by drive, viscous and all dry friction. Called only where there are any:
    to hand all this over for nothing would take the base model's pass two thirds as long again.
    """
    for j in range(table.static_at.shape[0]):
        place, q = table.static_at[j], table.static_shape[j]
        part = contribution_slope(table.static_code[j], x[place], (q[0], q[1], q[2]), at)
        row[to + place] += of_drive * (x[MOTOR_GAIN] * part[0] + part[1]) + of_b * (x[VISCOUS] * part[3] + part[2])
        row[to + place] += of_dry * (x[COULOMB] * part[4] + part[5])
    for j in range(table.law_at.shape[0]):
        along, where = motion(at.omega, at.current), _law_place(table, j, at)
        if table.law_kind[j] == LOSS and _law_size(x, table, j, along, where, at)[0] >= abs(at.current):
            continue  # all of it is lost: a little more changes nothing
        part = linear_contribution(table.law_kind[j], 1.0, 0.0, along, at.omega, at.current)
        of_size = of_drive * (x[MOTOR_GAIN] * part[0] + part[1]) + of_b * part[2] + of_dry * part[5]
        part = linear_contribution(table.law_kind[j], 0.0, 1.0, along, at.omega, at.current)
        of_slope = of_drive * (x[MOTOR_GAIN] * part[0] + part[1]) + of_b * part[2] + of_dry * part[5]
        for i in range(table.law_functions[j]):
            value, rise = _of_law(table, j, i, along, where, at)
            row[to + table.law_at[j] + i] += of_size * value + of_slope * rise


def _chain(
    x: Any, table: EffectTable, row: Any, at: Moment, terms: Terms, slopes: tuple[float, float, float, float, float]
) -> None:
    """Carry `row` (n,), the slopes of the speed by the state, over a step by the chain rule (effects.md eq. 3).

    slopes: of the speed after the step by speed, drive, b, c and s.
    """
    keep, of_drive, of_b, of_c, of_s = slopes
    for j in range(table.size):
        row[j] *= keep
    row[MOTOR_GAIN] += of_drive * (at.current + terms.amperes)
    row[VISCOUS] += of_b * (1.0 + terms.viscous_factor)
    row[COULOMB] += of_c * (1.0 + terms.dry_factor) + of_s * terms.dry_factor
    row[STATIC] += of_s
    if table.static_at.shape[0] + table.law_at.shape[0] > 0:
        _chain_static(x, table, row, 0, at, of_drive, of_b, of_c + of_s)


def row_size(n: int) -> int:
    """Length of the row of slopes that `effect_interval` fills for n states and a friction with a memory."""
    return 2 * (n + _INPUTS)


class MemoryStep(NamedTuple):
    """What a friction with a memory begins a step with."""

    omega: float
    memory: float
    drive: float
    curve: FrictionCurve
    a: float  # the effect's coefficient
    duration: float


def _memory_moved(which: int, h: float, table: EffectTable, step: MemoryStep) -> tuple[float, float]:
    """Speed and memory after a step whose input number `which` is greater by h."""
    omega, memory, drive, curve, a, duration = step
    b, c, s, omega_s, law = curve
    moved: tuple[float, float] = memory_flow(
        table.memory_code,
        omega + h if which == 0 else omega,
        memory + h if which == 1 else memory,
        drive + h if which == 2 else drive,
        FrictionCurve(b + h if which == 3 else b, c + h if which == 4 else c, s + h if which == 5 else s, omega_s, law),
        a + h if which == 6 else a,
        table.memory_shape,
        duration,
    )
    return moved


def _chain_memory(
    x: Any, table: EffectTable, row: Any, at: Moment, terms: Terms, step: MemoryStep, end: tuple[float, float]
) -> None:
    """Carry the slopes of the speed (n,) and of the memory (n,), in `row`, over a step of friction with a memory.

    Behind those `row` has room for the step's own slopes by the flow's seven inputs, twice: differences from where the
    step ends. By the coefficients of static effects the chain rule leads, at no further run of the flow. end: the
    speed and the memory after the step.

    Whether a slow wheel is held or breaks away is a jump, no slope: a difference across it is as large as its step is
    small, and a fit that takes it for a slope knows break-away friction a hundred times better than the readings do.
    """
    n = table.size
    end_omega, end_memory = end
    curve = step.curve
    dry = _STEP * max(abs(curve.c), abs(curve.s), 1.0e-9)
    at_slopes = 2 * n
    carried = False
    for j in range(1, n):
        carried = carried or row[j] != 0.0 or row[n + j] != 0.0
    for which in range(0 if carried else 2, _INPUTS):
        h = dry
        if which == 0:
            h = _STEP * curve.omega_s
        elif which == 3:
            h = max(_STEP * abs(curve.b), _LEAST_VISCOUS_STEP)
        elif which == 6:
            h = max(_COEFFICIENT_STEP * abs(step.a), 1.0e-12)
        moved_omega, moved_memory = _memory_moved(which, h, table, step)
        if table.memory_holds and (moved_omega == 0.0) != (end_omega == 0.0):
            moved_omega, moved_memory = end_omega, end_memory
        row[at_slopes + which] = (moved_omega - end_omega) / h
        row[at_slopes + _INPUTS + which] = (moved_memory - end_memory) / h
    for j in range(1, n if carried else 1):
        of_speed, of_memory = row[j], row[n + j]
        row[j] = row[at_slopes] * of_speed + row[at_slopes + 1] * of_memory
        row[n + j] = row[at_slopes + _INPUTS] * of_speed + row[at_slopes + _INPUTS + 1] * of_memory
    for half in range(2):
        to, of = half * n, at_slopes + half * _INPUTS
        row[to + MOTOR_GAIN] += row[of + 2] * (at.current + terms.amperes)
        row[to + VISCOUS] += row[of + 3] * (1.0 + terms.viscous_factor)
        row[to + COULOMB] += row[of + 4] * (1.0 + terms.dry_factor) + row[of + 5] * terms.dry_factor
        row[to + STATIC] += row[of + 5]
        row[to + table.memory_at] += row[of + 6]
        if table.static_at.shape[0] + table.law_at.shape[0] > 0:
            _chain_static(x, table, row, to, at, row[of + 2], row[of + 3], row[of + 4] + row[of + 5])


def _begin(x: Any, table: EffectTable, slopes: bool, row: Any, end: Any) -> None:
    """An interval's end where it begins, and the slopes of the speed by the state there."""
    n = table.size
    for j in range(n):
        end[j] = x[j]
        if slopes:
            row[j] = 1.0 if j == SPEED else 0.0
    if slopes and table.memory_at >= 0:
        for j in range(n):
            row[j] = row[n + j] = 0.0


def _lag(
    x: Any, table: EffectTable, stribeck: Stribeck, end: Any, omega: float, current: float, at: float, left: float
) -> tuple[float, float]:
    """(length, mean current) of the next step under a current that lags behind; its state in `end` advances with it.

    at: time now [s]; left: until the current that is commanded ends [s]. One step does where a wheel goes evenly.
    """
    tau = x[table.lag_at]
    h = left
    most_drive = abs(x[MOTOR_GAIN]) * max(abs(current), abs(end[table.lag_state_at]))
    curve = FrictionCurve(x[VISCOUS], x[COULOMB], x[STATIC], stribeck.omega_s, stribeck.law)
    if tau > 0.0 and not goes_evenly(omega, most_drive, curve, left):
        h = min(left, max(0.5 * tau, left / _LAG_STEPS))
        if at + h <= at:  # of a lag of next to nothing: a step that moves no time would be taken for ever
            h = left
    mean, end[table.lag_state_at] = lagged(table.lag_code, tau, table.lag_shape, end[table.lag_state_at], current, h)
    return h, mean


def effect_interval(
    x: Any, table: EffectTable, stribeck: Stribeck, pieces: Pieces, interval: Interval, slopes: bool, row: Any, end: Any
) -> None:
    """Propagate the state x (n,) over an interval: end (n,) gets speed and hidden states, row (n,) the slopes.

    With `slopes` the row has those of the speed by the state, but not by the coefficient of a delay, a current's lag, a
    window or a Stribeck shape, nor by their hidden states. For a friction with a memory it is `row_size` long, the
    memory's slopes follow, and those by speed and memory at the interval's begin are left zero. Without, row is not
    touched.
    The coefficients in `end` are those of x.
    """
    from_s, to_s, temperature, angle, first, start, stop, columns = interval
    stribeck = stribeck_of(x, table, stribeck)
    begins, durations, currents = pieces
    _begin(x, table, slopes, row, end)
    delay = lateness(x, table)
    piece = start
    while piece > first and begins[piece] > from_s - delay:
        piece -= 1
    omega = x[SPEED]
    if table.window_at >= 0:
        omega -= rounding(x, table, pieces, first, start, from_s, omega)
    at = from_s
    while at < to_s:
        until = begins[piece] + durations[piece] + delay
        if until > to_s or piece + 1 >= stop:
            until = to_s
        while at < until:
            left = until - at
            h = left
            current = currents[piece]
            if table.lag_at >= 0:
                h, current = _lag(x, table, stribeck, end, omega, current, at, left)
            moment = Moment(omega, current, temperature, angle, at + 0.5 * h, h, columns)
            terms, drive, curve = driven_by(x, table, stribeck, moment)
            before = omega
            if table.memory_at >= 0:
                if table.memory_holds and abs(omega) < _HELD * stribeck.omega_s and abs(drive) <= curve.s:
                    # No estimate is exactly zero: below this speed a wheel that cannot break away counts as held.
                    omega = 0.0
                held = end[table.memory_state_at]
                start_omega = omega
                omega, end[table.memory_state_at] = memory_flow(
                    table.memory_code, omega, held, drive, curve, x[table.memory_at], table.memory_shape, h
                )
                if slopes:
                    moment = Moment(start_omega, current, temperature, angle, at + 0.5 * h, h, columns)
                    step = MemoryStep(start_omega, held, drive, curve, x[table.memory_at], h)
                    _chain_memory(x, table, row, moment, terms, step, (omega, end[table.memory_state_at]))
            else:
                omega, keep, of_drive, of_b, of_c, of_s = flow(omega, drive, curve, h, slopes)
                if slopes:
                    _chain(x, table, row, moment, terms, (keep, of_drive, of_b, of_c, of_s))
            angle += 0.5 * (before + omega) * h
            at = until if h == left else at + h
        piece += 1
    if table.window_at >= 0:
        omega += rounding(x, table, pieces, first, stop - 1, to_s, omega)
    end[SPEED] = omega
