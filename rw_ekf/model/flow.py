"""The exact flow of the wheel under a constant drive, zero crossing, stick and break-away included.

With its sensitivity, in scalar functions importing only `math` (docs/model.md eq. 7-16). Far above the Stribeck speed
the drift is linear and the flow has a closed form; near zero it is integrated in fourth-order steps that the Stribeck
curve can bear; the instant of zero speed is located, and the wheel is stopped there or continues the other way (|drive|
against s). The sensitivity obeys the variational equation between such events and is carried across them by the
saltation factor f+/f-: at zero both branches are known, so the factor is exact and lies in [0, 1].

Every function here is compiled as it stands (rw_ekf.c_code) and called as plain Python online.
"""

import math

from rw_ekf.model.averages import phi_1, phi_1_slope
from rw_ekf.model.friction import FrictionCurve, far_limit, stribeck, stribeck_slope

_STEP_IN_STRIBECK_SPEEDS = 0.25  # error below 2e-7 rad/s in 0.1 s at the default wheel (tests/model)
_STEP_TIMES_SLOPE = 0.25
# A drive or a parameter estimate gone wild must neither hang the daemon nor overflow. An interval takes a wheel fewer
# than 200 steps, and no friction is so negative that a speed grows by more than exp(30) in one.
_MAX_STEPS = 2_000
_MAX_GROWTH = 30.0
# Half of it is the share of what a change of the drive moves that its mean may lose: a hundredth, against an adaptive
# integrator (tests/wheel/test_short_lag.py), and in proportion.
_LITTLE_SLOPE = 0.02
_ROOM = 2.0  # times the acceleration that the base model can have: effects add to it


def _far_time(v: float, target: float, net: float, b: float) -> float:
    """Time [s] in which dv/dt = net - b v leads from v to target; it must lie ahead on the way."""
    rate = net - b * target
    if rate == 0.0:  # the target is the equilibrium: it is come near to and not passed
        return math.inf
    z = b * (target - v) / rate
    return (target - v) / rate * (math.log1p(z) / z if abs(z) > 1.0e-12 else 1.0)


def _far_speed(v: float, net: float, b: float, h: float) -> float:
    """The speed h [s] after v, where dv/dt = net - b v  (eq. 9)."""
    return v + (net - b * v) * h * phi_1(b * h)


def _far_slopes(v: float, net: float, b: float, h: float) -> tuple[float, float, float]:
    """Sensitivities of the speed h [s] after v to v, to the push and to b, where dv/dt = net - b v  (eq. 9)."""
    x = b * h
    gain = h * phi_1(x)
    keep = 1.0 - b * gain
    return keep, gain, -h * keep * v + net * h * h * phi_1_slope(x)


def _step(
    v: float, rate: float, slope: float, h: float, push: float, b: float, c: float, s: float, omega_s: float, law: int
) -> tuple[float, float, float]:
    """One step of length h: (v at h, v at h/2, g at h/2). `rate` and `slope` are dv/dt and its derivative at v.

    The two-stage, fourth-order two-derivative Runge-Kutta method (Chan & Tsai 2010): the slope costs nothing beside g,
    so that two evaluations of g do what classical RK4 needs four for.
    """
    half = v + 0.5 * h * (rate + 0.25 * h * rate * slope)
    g = stribeck(half / omega_s, law)
    rate_half = push - b * half - c - (s - c) * g
    slope_half = -b - (s - c) / omega_s * stribeck_slope(half / omega_s, g, law)
    return v + h * (rate + h / 6.0 * (rate * slope + 2.0 * rate_half * slope_half)), half, g


def _exp_small(x: float) -> float:
    """exp(x) for |x| <= 0.6, relative error below 3e-8 at 0.25 and 5e-7 at 0.6 (Pade (3, 3)); cheaper than math.exp."""
    even = 120.0 + 12.0 * x * x
    odd = x * (60.0 + x * x)
    return (even + odd) / (even - odd)


def _time_to_stop(v: float, rate: float, h: float, end: float, end_rate: float) -> float:
    """Time in (0, h] at which the cubic through (0, v, rate) and (h, end, end_rate) is zero; v > 0 >= end.

    Safeguarded Newton: the bracket shrinks in every turn, so that it always ends.
    """
    low, high = 0.0, h
    tau = h * v / (v - end)
    for _ in range(60):
        r = tau / h
        rest = (1.0 - r) * (1.0 - r)
        value = (1.0 + 2.0 * r) * rest * v + r * rest * h * rate
        value += r * r * (3.0 - 2.0 * r) * end - r * r * (1.0 - r) * h * end_rate
        if value > 0.0:
            low = tau
        else:
            high = tau
        slope = (6.0 * r * r - 6.0 * r) * (v - end) / h
        slope += (1.0 - r) * (1.0 - 3.0 * r) * rate + r * (3.0 * r - 2.0) * end_rate
        following = tau - value / slope if slope != 0.0 else 0.5 * (low + high)
        if not low < following < high:
            following = 0.5 * (low + high)
        if abs(following - tau) <= 1.0e-15 * h or high - low <= 1.0e-15 * h:
            break
        tau = following
    return tau


def slip(
    v: float, push: float, curve: FrictionCurve, duration: float, slopes: bool = True
) -> tuple[float, float, float, float, float, float, float]:
    """Move along one branch until the time is up or the wheel comes to rest.

    v [rad/s] >= 0 in the direction of motion; push [rad/s^2]; duration [s].
    Returns (v at the end, time left [s], then the sensitivities of v at the end, time held fixed, to: v at the start,
    push, b, c, s). Between events these solve dS/dt = (df/dv) S + df/dp  (docs/model.md eq. 10). Without `slopes` they
    are not computed and mean nothing.
    """
    b, c, s, omega_s, law = curve
    far = far_limit(law) * omega_s
    left = duration
    if b * duration < -_MAX_GROWTH:
        b = -_MAX_GROWTH / duration
    to_v, to_push, to_b, to_c, to_s = 1.0, 0.0, 0.0, 0.0, 0.0
    for _ in range(_MAX_STEPS):
        if left <= 0.0:
            break
        if v > far:
            net = push - c
            h = left
            end = _far_speed(v, net, b, h)
            if end < far:
                h = min(max(_far_time(v, far, net, b), 0.0), left)
                end = far
            keep, gain, of_b = _far_slopes(v, net, b, h)
            to_v *= keep
            to_push = keep * to_push + gain
            to_b = keep * to_b + of_b
            to_c = keep * to_c - gain
            to_s = keep * to_s
            v = end
            left -= h
            continue
        g0 = stribeck(v / omega_s, law)
        rate = push - b * v - c - (s - c) * g0
        h = left
        reach = _STEP_IN_STRIBECK_SPEEDS * max(omega_s, 0.5 * v)
        if abs(rate) * h > reach:
            h = reach / abs(rate)
        stiffness = abs(b) + abs(s - c) / omega_s
        if stiffness * h > _STEP_TIMES_SLOPE:
            h = _STEP_TIMES_SLOPE / stiffness
        a0 = -b - (s - c) / omega_s * stribeck_slope(v / omega_s, g0, law)
        end, half, gh = _step(v, rate, a0, h, push, b, c, s, omega_s, law)
        stops = end <= 0.0
        if stops and v == 0.0:  # at rest under a push that exceeds s by a rounding error
            break
        if stops and abs(push) <= s:  # it will stay where it stops: when it stopped, and how, no longer matters
            return 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        if stops:
            end_rate = push - b * end - c - (s - c) * stribeck(end / omega_s, law)
            tau = _time_to_stop(v, rate, h, end, end_rate)
            end, half, gh = _step(v, rate, a0, tau, push, b, c, s, omega_s, law)
            stop_rate = push - s  # the drift on this branch at rest, where g = 1
            if stop_rate < 0.0:
                tau = min(max(tau - end / stop_rate, 0.0), h)
            h = tau
            end = 0.0
        if slopes:  # variational equation over the step by Simpson's rule on the trajectory just found
            g1 = stribeck(end / omega_s, law)
            ah = -b - (s - c) / omega_s * stribeck_slope(half / omega_s, gh, law)
            a1 = -b - (s - c) / omega_s * stribeck_slope(end / omega_s, g1, law)
            keep = _exp_small(h / 6.0 * (a0 + 4.0 * ah + a1))
            keep_half = 4.0 * _exp_small(h / 24.0 * (-a0 + 8.0 * ah + 5.0 * a1))
            w = h / 6.0
            to_v *= keep
            to_push = keep * to_push + w * (keep + keep_half + 1.0)
            to_b = keep * to_b - w * (keep * v + keep_half * half + end)
            to_c = keep * to_c - w * (keep * (1.0 - g0) + keep_half * (1.0 - gh) + 1.0 - g1)
            to_s = keep * to_s - w * (keep * g0 + keep_half * gh + g1)
        v = end
        left -= h
        if stops:
            break
    return v, left, to_v, to_push, to_b, to_c, to_s


def flow(
    omega: float, drive: float, curve: FrictionCurve, duration: float, slopes: bool = True
) -> tuple[float, float, float, float, float, float]:
    """Speed after `duration` [s] under a constant drive [rad/s^2], and its sensitivities to omega, drive, b, c, s.

    A wheel at rest stays while |drive| <= s and then ends with all sensitivities zero; a wheel that comes to rest stops
    or goes through, its sensitivity multiplied by the saltation factor (|drive| - s) / (|drive| + s)
    (docs/model.md eq. 13). Under a constant drive there is at most one such event.
    """
    to_omega, to_drive, to_b, to_c, to_s = 1.0, 0.0, 0.0, 0.0, 0.0
    s = curve.s
    left = duration
    far = far_limit(curve.law) * curve.omega_s
    if abs(omega) > far and curve.b * duration >= -_MAX_GROWTH:  # mostly: `slip` says the same, in twice the time
        sigma = math.copysign(1.0, omega)
        v, net = abs(omega), sigma * drive - curve.c
        end = _far_speed(v, net, curve.b, duration)
        if end > far:
            to_omega, to_drive, to_b = _far_slopes(v, net, curve.b, duration)
            return sigma * end, to_omega, to_drive, sigma * to_b, -sigma * to_drive, 0.0
    if omega != 0.0:
        sigma = math.copysign(1.0, omega)
        v, left, to_omega, to_push, to_b, to_c, to_s = slip(sigma * omega, sigma * drive, curve, left, slopes)
        if v > 0.0:
            return sigma * v, to_omega, to_push, sigma * to_b, sigma * to_c, sigma * to_s
        if abs(drive) <= max(s, 0.0):
            return 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        before = abs(drive) + s
        factor = (abs(drive) - s) / before if before > 0.0 else 1.0
        to_omega *= factor
        to_drive = to_push * factor
        to_b *= sigma * factor
        to_c *= sigma * factor
        to_s *= sigma * factor
    elif abs(drive) <= max(s, 0.0):
        return 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    sigma = math.copysign(1.0, drive)
    v, left, keep, of_push, of_b, of_c, of_s = slip(0.0, sigma * drive, curve, left, slopes)
    return (
        sigma * v,
        keep * to_omega,
        keep * to_drive + of_push,
        keep * to_b + sigma * of_b,
        keep * to_c + sigma * of_c,
        keep * to_s + sigma * of_s,
    )


def goes_evenly(omega: float, most_drive: float, curve: FrictionCurve, duration: float) -> bool:
    """Whether a drive that changes within `duration` [s] leads where its mean does; most_drive [rad/s^2]: its largest.

    It does where the wheel does not come to rest and its acceleration hardly depends on its speed: what such a change
    moves is then off by half of that slope times the duration, a hundredth.
    """
    b, c, s, omega_s, law = curve
    change = _ROOM * (most_drive + max(abs(c), abs(s)) + abs(b * omega)) * duration
    slowest = abs(omega) - change
    slope = abs(b)
    if slowest < far_limit(law) * omega_s:
        slope += abs(s - c) / omega_s
    return slowest > 0.0 and slope * duration < _LITTLE_SLOPE
