"""The flow of a wheel whose dry friction F has a memory: Walrath's lag and the bristle, in one integrator.

docs/effects.md, "Friction with a memory". In the direction of motion, v = sigma omega >= 0, f = sigma F and
push = sigma drive, both models are two smooth equations,

    d(v + kappa f)/dt = push - b v - f
    df/dt = m(v, f)     lag:     [T(v) - f]/tau,                  kappa = 0
                        bristle: sigma0 v [1 - f/T(v)],           kappa = 2 zeta/sqrt(sigma0)
    T(v) = c + (s - c) g(v/omega_s)

kappa f is the momentum that the bristle's damping holds: so written, damping is never stiff. What is stiff, the memory
of a fast wheel, an L-stable Rosenbrock step of order four bears (two unknowns: its linear system is written out). The
step follows the embedded error. Where v comes to zero the instant is located and the direction changes there, or, with
the lag, the wheel holds. Far from zero, with T constant, there mostly is a closed form (`memory_coast`).

Scalar functions that import only `math`: they are compiled as they stand.
"""

from __future__ import annotations

import math

from rw_ekf.model.flow import _time_to_stop, flow
from rw_ekf.model.friction import FrictionCurve, far_limit, stribeck, stribeck_slope
from rw_ekf.model.memory_coast import BRISTLE, LAG, TOLERANCE, Wheel, coast, plain_beyond

_REACH = 0.5  # a step changes the speed by no more than this share of max(omega_s, v), so that no stage overlooks zero
_FIRST_BEND = 2.5e-3  # in Stribeck speeds
_AT_ZERO = 1.0e-9  # in Stribeck speeds: a crossing this shallow need not be located
_MAX_STEPS = 500  # a wheel needs fewer than 200; parameters gone wild continue without a memory
_MAX_TRIES = 20  # of one step
_SHORTEST = 1.0e-15  # a step shorter than this share of what is left leads nowhere
_MAX_GROWTH = 30.0  # as in model.propagation: no negative b lets a speed grow by more than exp(30)
_LEAST_FRICTION = 1.0e-3  # a bristle needs something to hold to: c and s are at least this share of the larger


def _dry(v: float, c: float, s: float, omega_s: float, law: int) -> tuple[float, float]:
    """Static dry friction T(v) [rad/s^2] and its slope [1/s]; a stage may look a little past v = 0."""
    u = max(v / omega_s, -1.0)
    g = stribeck(u, law)
    return c + (s - c) * g, (s - c) / omega_s * stribeck_slope(u, g, law)


def _memory_rate(v: float, f: float, wheel: Wheel) -> tuple[float, float, float]:
    """df/dt = m(v, f) [rad/s^3] and its derivatives by v and f."""
    _, c, s, omega_s, law, kind, rate, _ = wheel
    level, slope = _dry(v, c, s, omega_s, law)
    if kind == LAG:
        return rate * (level - f), rate * slope, -rate
    x = 1.0 / level
    left = 1.0 - f * x
    return rate * v * left, rate * (left + v * f * x * slope * x), -rate * v * x


def _stage(
    w: float, f: float, carry_w: float, carry_f: float, push: float, wheel: Wheel,
    i_ww: float, i_wf: float, i_fw: float, i_ff: float,
) -> tuple[float, float]:  # fmt: skip
    """One stage: (4/h - J)^-1 applied to the right-hand side at (w, f) plus what earlier stages carry over."""
    v = w - wheel[7] * f
    m, _, _ = _memory_rate(v, f, wheel)
    of_w = push - wheel[0] * v - f + carry_w
    of_f = m + carry_f
    return i_ww * of_w + i_wf * of_f, i_fw * of_w + i_ff * of_f


def _step(
    v: float, f: float, m: float, m_v: float, m_f: float, push: float, h: float, wheel: Wheel
) -> tuple[float, float, float, float]:
    """One step of length h: (v, f) at its end and their error estimates. m, m_v, m_f: `_memory_rate` at (v, f).

    RODAS (Hairer & Wanner, Solving Ordinary Differential Equations II, IV.10): six stages, order 4 with an embedded 3,
    stiffly accurate. The unknowns are w = v + kappa f and f.
    """
    b, kappa = wheel[0], wheel[7]
    w = v + kappa * f
    q = 1.0 / h
    a_ww, a_wf = 4.0 * q + b, 1.0 - b * kappa
    a_fw, a_ff = -m_v, 4.0 * q - m_f + kappa * m_v
    determinant = a_ww * a_ff - a_wf * a_fw
    if determinant == 0.0:  # only with b < 0
        return v, f, math.inf, math.inf
    x = 1.0 / determinant
    i_ww, i_wf, i_fw, i_ff = a_ff * x, -a_wf * x, -a_fw * x, a_ww * x
    of_w = push - b * v - f
    w1, f1 = i_ww * of_w + i_wf * m, i_fw * of_w + i_ff * m
    w2, f2 = _stage(
        w + 1.544 * w1, f + 1.544 * f1, -5.6688 * q * w1, -5.6688 * q * f1, push, wheel, i_ww, i_wf, i_fw, i_ff
    )
    w3, f3 = _stage(
        w + 0.9466785280815826 * w1 + 0.2557011698983284 * w2,
        f + 0.9466785280815826 * f1 + 0.2557011698983284 * f2,
        -q * (2.430093356833875 * w1 + 0.2063599157091915 * w2),
        -q * (2.430093356833875 * f1 + 0.2063599157091915 * f2),
        push, wheel, i_ww, i_wf, i_fw, i_ff,
    )  # fmt: skip
    w4, f4 = _stage(
        w + 3.314825187068521 * w1 + 2.896124015972201 * w2 + 0.9986419139977817 * w3,
        f + 3.314825187068521 * f1 + 2.896124015972201 * f2 + 0.9986419139977817 * f3,
        -q * (0.1073529058151375 * w1 + 9.594562251023355 * w2 + 20.47028614809616 * w3),
        -q * (0.1073529058151375 * f1 + 9.594562251023355 * f2 + 20.47028614809616 * f3),
        push, wheel, i_ww, i_wf, i_fw, i_ff,
    )  # fmt: skip
    w_end = w + 1.221224509226641 * w1 + 6.019134481288629 * w2 + 12.53708332932087 * w3 - 0.6878860361058950 * w4
    f_end = f + 1.221224509226641 * f1 + 6.019134481288629 * f2 + 12.53708332932087 * f3 - 0.6878860361058950 * f4
    w5, f5 = _stage(
        w_end, f_end,
        q * (7.496443313967647 * w1 - 10.24680431464352 * w2 - 33.99990352819905 * w3 + 11.70890893206160 * w4),
        q * (7.496443313967647 * f1 - 10.24680431464352 * f2 - 33.99990352819905 * f3 + 11.70890893206160 * f4),
        push, wheel, i_ww, i_wf, i_fw, i_ff,
    )  # fmt: skip
    w_end += w5
    f_end += f5
    w6, f6 = _stage(
        w_end, f_end,
        q * (8.083246795921522 * w1 - 7.981132988064893 * w2 - 31.52159432874371 * w3 + 16.31930543123136 * w4
             - 6.058818238834054 * w5),
        q * (8.083246795921522 * f1 - 7.981132988064893 * f2 - 31.52159432874371 * f3 + 16.31930543123136 * f4
             - 6.058818238834054 * f5),
        push, wheel, i_ww, i_wf, i_fw, i_ff,
    )  # fmt: skip
    f_end += f6
    return w_end + w6 - kappa * f_end, f_end, w6 - kappa * f6, f6


def _acceleration(v: float, f: float, m: float, push: float, wheel: Wheel) -> float:
    """dv/dt [rad/s^2], the bristle's damping included; m = df/dt."""
    return push - wheel[0] * v - f - wheel[7] * m


def _controlled_step(
    v: float, f: float, push: float, h: float, duration: float, wheel: Wheel
) -> tuple[float, float, float, float]:
    """One step whose error is small enough, of length h [s] or less: (its length, v and f at its end, the next length).

    The length 0 says that there is none. h = 0 requests a first step, of at most `duration`.
    """
    b, c, s, omega_s, _, kind, rate, kappa = wheel
    m, m_v, m_f = _memory_rate(v, f, wheel)
    slope = _acceleration(v, f, m, push, wheel)
    if h == 0.0:
        h = duration
        bend = abs(b * slope) + abs(m) + kappa * abs(m_v * slope + m_f * m)
        if bend * h * h > _FIRST_BEND * omega_s:
            h = math.sqrt(_FIRST_BEND * omega_s / bend)
    reach = _REACH * max(omega_s, v)
    if abs(slope) * h > reach:
        h = reach / abs(slope)
    # How long an error of f continues to move the speed; never nothing, for f itself counts as well.
    largest = max(abs(c), abs(s))
    lasts = 1.0 / ((math.sqrt(rate) if kind == BRISTLE else 0.0) - m_f)
    lasts = min(lasts, duration) + (0.01 * omega_s / largest if largest > 0.0 else 0.0)
    allowed = TOLERANCE * max(omega_s, 0.01 * v)
    for _ in range(_MAX_TRIES):
        if not h > _SHORTEST * duration:
            break
        end, f_end, error, f_error = _step(v, f, m, m_v, m_f, push, h, wheel)
        error = max(abs(error), lasts * abs(f_error)) / allowed
        if not error < 1.0e4:  # or not a number at all
            h *= 0.1
            continue
        following = h * min(0.9 / math.sqrt(math.sqrt(max(error, 1.0e-4))), 5.0)
        if error <= 1.5:
            return h, end, f_end, following
        h = following
    return 0.0, v, f, 0.0


def _crossing(v: float, f: float, push: float, h: float, end: float, f_end: float, wheel: Wheel) -> tuple[float, float]:
    """(time in (0, h] at which the speed is zero, f then), for a step of length h from v > 0 to end < 0.

    On the cubic through both ends and their slopes, then the step again up to there, then one Newton step.
    """
    m, m_v, m_f = _memory_rate(v, f, wheel)
    end_m, _, _ = _memory_rate(end, f_end, wheel)
    slope, end_slope = _acceleration(v, f, m, push, wheel), _acceleration(end, f_end, end_m, push, wheel)
    tau = _time_to_stop(v, slope, h, end, end_slope)
    if tau <= 1.0e-12 * h:  # it starts from next to nothing
        return 0.0, f
    end, f_end, _, _ = _step(v, f, m, m_v, m_f, push, tau, wheel)
    m, _, _ = _memory_rate(end, f_end, wheel)
    slope = _acceleration(end, f_end, m, push, wheel)
    more = min(max(-end / slope, -tau), h - tau) if slope < 0.0 else 0.0
    return tau + more, f_end + more * m


def _follow(omega: float, memory: float, drive: float, duration: float, wheel: Wheel) -> tuple[float, float]:
    """(speed, memory) after `duration`: steps along one direction, and what happens at zero speed between them."""
    b, c, s, omega_s, law, kind, _, _ = wheel
    holds = kind == LAG and abs(drive) <= max(s, 0.0)
    if omega == 0.0 and holds:
        return 0.0, drive
    sigma = math.copysign(1.0, omega if omega != 0.0 else drive)
    v, f, push = sigma * omega, sigma * memory, sigma * drive
    far = plain_beyond(c, s, omega_s, law, duration) if v > 2.0 * omega_s else far_limit(law) * omega_s
    left, h = duration, 0.0
    for _ in range(_MAX_STEPS):
        if left <= 1.0e-12 * duration:
            return sigma * v, sigma * f
        if v > far:
            coasts, end, f_end = coast(v, f, push, far, left, wheel)
            if coasts:
                return sigma * end, sigma * f_end
        if v == 0.0 and push <= f:
            if push < f:  # it leaves zero the other way
                sigma, f, push = -sigma, -f, -push
            elif kind == BRISTLE:  # at rest on the bent bristle
                return 0.0, sigma * f
        h, end, f_end, following = _controlled_step(v, f, push, min(h, left), left, wheel)
        if h == 0.0:
            break
        if end <= 0.0:
            if end < -_AT_ZERO * omega_s:
                if v == 0.0:  # out and back again within the step
                    h *= 0.5
                    continue
                h, f_end = _crossing(v, f, push, h, end, f_end, wheel)
                end = 0.0
            if holds:
                return 0.0, drive
            sigma, end, f_end, push, following = -sigma, -end, -f_end, -push, 0.0
        v, f = end, f_end
        left -= h
        h = following
    return _without_memory(sigma * v, drive, FrictionCurve(b, c, s, omega_s, law), left)


def _without_memory(omega: float, drive: float, curve: FrictionCurve, duration: float) -> tuple[float, float]:
    """(speed, memory) by the model's own flow: static friction, signed as the speed; at rest the drive that is held."""
    end = flow(omega, drive, curve, duration, False)[0]
    if end == 0.0:
        return 0.0, math.copysign(min(abs(drive), max(curve.s, 0.0)), drive)
    return end, math.copysign(1.0, end) * _dry(abs(end), curve.c, curve.s, curve.omega_s, curve.law)[0]


def lag_flow(
    omega: float, memory: float, drive: float, curve: FrictionCurve, time_constant: float, duration: float
) -> tuple[float, float]:
    """(speed [rad/s], friction [rad/s^2]) after `duration` [s] with friction that lags by time_constant [s]."""
    if duration <= 0.0:
        return omega, memory
    if time_constant <= 1.0e-7 * duration:
        return _without_memory(omega, drive, curve, duration)
    b, c, s, omega_s, law = curve
    b = max(b, -_MAX_GROWTH / duration)
    return _follow(omega, memory, drive, duration, (b, c, s, omega_s, law, LAG, 1.0 / time_constant, 0.0))


def bristle_flow(
    omega: float, memory: float, drive: float, curve: FrictionCurve, deflection: float, damping: float, duration: float
) -> tuple[float, float]:
    """(speed [rad/s], bristle's elastic friction [rad/s^2]) after `duration` [s].

    deflection [rad] at break-away; damping: ratio of the wheel's oscillation on its bristle, 0 is Dahl's model.
    """
    if duration <= 0.0:
        return omega, memory
    b, c, s, omega_s, law = curve
    least = _LEAST_FRICTION * max(c, s)
    bends = least > 0.0
    if bends:
        c, s = max(c, least), max(s, least)
        swing = math.sqrt(s * max(deflection, 0.0))  # the speed with which a wheel swings on it
        bends = 1.0e-7 * omega_s < swing < 1.0e7 * omega_s and s / deflection > 0.0
    if not bends:
        return _without_memory(omega, drive, FrictionCurve(b, c, s, omega_s, law), duration)
    b = max(b, -_MAX_GROWTH / duration)
    stiffness = s / deflection
    kappa = 2.0 * max(damping, 0.0) / math.sqrt(stiffness)
    return _follow(omega, memory, drive, duration, (b, c, s, omega_s, law, BRISTLE, stiffness, kappa))
