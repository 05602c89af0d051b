"""How well damped the attitude loop is, sampling and delay included; and the integral gain that this allows at most."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from rw_ekf.arrays import Complex128Array, Float64Array
from rw_ekf.attitude_bench.scenario import Scenario
from rw_ekf.control.compensation.schemes import SchemeEntry

SMALLEST_MARGIN_DEG = 45.0
_FREQUENCIES = 2000  # looked at between a ten-thousandth of the Nyquist frequency and that
_HALVINGS = 50

OpenLoop = Callable[[Float64Array], Complex128Array]  # at frequencies [rad/s]


class Margin(NamedTuple):
    """Where the loop's gain falls through one for the last time, and its phase there above -180 degrees."""

    crossover_rad_s: float
    phase_deg: float


def scenario_for(entry: SchemeEntry, scenario: Scenario) -> Scenario:
    """The scenario with the attitude controller that a scheme is run with: as named, but for the tuned baseline's."""
    return with_largest_integral(scenario) if entry.largest_integral else scenario


def with_largest_integral(scenario: Scenario, margin_deg: float = SMALLEST_MARGIN_DEG) -> Scenario:
    """The largest integral gain that keeps the phase margin; proportional and rate gain stay.

    The peak at a reversal falls all the way there, and the crossover with it: with the gains of [CK13] from 0.79 to
    0.47 rad/s. A scenario whose margin is smaller already stays as it is.
    """
    least, most = scenario.control.integral_Nm_rad_s, _unstable_integral(scenario)
    if margin_of(scenario).phase_deg <= margin_deg or least >= most:
        return scenario
    for _ in range(_HALVINGS):
        middle = 0.5 * (least + most)
        if margin_of(_with_integral(scenario, middle)).phase_deg >= margin_deg:
            least = middle
        else:
            most = middle
    return _with_integral(scenario, least)


def margin_of(scenario: Scenario) -> Margin:
    """Phase margin of a rigid body under the attitude controller, every command held for a cycle and late.

    A wheel without friction is taken: what friction does to the loop is the compensation's affair.
    """
    return phase_margin(lambda w: attitude_loop(scenario, w), scenario.cycle.rate_hz)


def phase_margin(loop: OpenLoop, rate_hz: float) -> Margin:
    """Of an open loop that is sampled at rate_hz [Hz]; -inf degrees where its gain does not fall through one."""
    w = looked_at(rate_hz)
    above = np.flatnonzero(np.abs(loop(w)) >= 1.0)
    if above.size == 0 or above[-1] == w.size - 1:
        return Margin(math.nan, -math.inf)
    low, high = float(w[above[-1]]), float(w[above[-1] + 1])
    for _ in range(_HALVINGS):
        middle = math.sqrt(low * high)
        low, high = (middle, high) if abs(loop(np.array([middle]))[0]) >= 1.0 else (low, middle)
    phase_deg = math.degrees(float(np.angle(-loop(np.array([low]))[0])))
    return Margin(low, phase_deg)


def looked_at(rate_hz: float) -> Float64Array:
    """Frequencies [rad/s] (n,) at which a loop of this rate [Hz] is looked at, up to half of it."""
    nyquist = math.pi * rate_hz
    return np.geomspace(1e-4 * nyquist, nyquist, _FREQUENCIES)


def attitude_loop(scenario: Scenario, w: Float64Array) -> Complex128Array:
    """Open loop at frequencies w [rad/s], (n,), exactly as it is sampled: torque over a cycle is held, d late.

    For a delay d = n T + e, 0 <= e < T, a torque acts e after its cycle began; the next one's begins T - e before the
    end. Then J Omega+ = J Omega + e u_before + (T - e) u, and the attitude the integral of it.
    """
    cycle, control, inertia = scenario.cycle, scenario.control, scenario.body.inertia_kg_m2
    period = 1.0 / cycle.rate_hz
    late = int(cycle.command_delay_s / period)
    e = cycle.command_delay_s - late * period
    z = np.exp(1j * w * period)
    rate = (e / z + (period - e)) / (z - 1.0) / inertia
    pushed = e * (period - 0.5 * e) / z + 0.5 * (period - e) ** 2
    attitude = (period * rate + pushed / inertia) / (z - 1.0)
    integral = control.integral_Nm_rad_s * period * z / (z - 1.0)
    loop = (control.proportional_Nm_rad + integral) * attitude + scenario.derivative_Nms_rad * rate
    return np.asarray(loop * z ** (-late))


def _unstable_integral(scenario: Scenario) -> float:
    """Kd Kp / J: from here on the loop is unstable even without sampling and delay (Routh)."""
    return scenario.derivative_Nms_rad * scenario.control.proportional_Nm_rad / scenario.body.inertia_kg_m2


def _with_integral(scenario: Scenario, integral_Nm_rad_s: float) -> Scenario:
    settling = max(scenario.control.settling_integral_Nm_rad_s, integral_Nm_rad_s)
    return scenario.changed("control", integral_Nm_rad_s=integral_Nm_rad_s, settling_integral_Nm_rad_s=settling)
