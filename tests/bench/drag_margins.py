"""What a drag estimator leaves of the attitude loop's margins: [L17] V.1 asks for it before its bandwidth is raised."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from rw_ekf.arrays import Complex128Array, Float64Array
from rw_ekf.attitude_bench.margins import OpenLoop, attitude_loop, looked_at, phase_margin
from rw_ekf.attitude_bench.scenario import Scenario
from rw_ekf.control.compensation.pi_drag import CASSINI_DAMPING, PiDragEstimator

_HALVINGS = 50


class DragMargins(NamedTuple):
    """Of the loop opened at the motor: what it bears beyond, or short of, the torque that is believed of it."""

    crossover_rad_s: float
    phase_deg: float
    gain_dB: float  # the motor may be stronger by so much; inf: by anything
    reduction_dB: float  # it may be weaker by so much; inf: by anything


def drag_margins(scenario: Scenario, bandwidth_rad_s: float, damping: float = CASSINI_DAMPING) -> DragMargins:
    """Margins of the bench's attitude controller with the estimator of [L17 (1)] inside, sampled and late as it is."""
    rate_hz = scenario.cycle.rate_hz

    def loop(w: Float64Array) -> Complex128Array:
        return drag_loop(scenario, bandwidth_rad_s, damping, w)

    margin = phase_margin(loop, rate_hz)
    gains = _at_phase_crossings(loop, looked_at(rate_hz))
    above = [-20.0 * math.log10(gain) for gain in gains if gain < 1.0]
    below = [20.0 * math.log10(gain) for gain in gains if gain > 1.0]
    return DragMargins(*margin, min(above, default=math.inf), min(below, default=math.inf))


def drag_loop(scenario: Scenario, bandwidth_rad_s: float, damping: float, w: Float64Array) -> Complex128Array:
    """Open loop at frequencies w [rad/s], (n,): (A + H D) / (1 - H), opened between the current and its torque.

    A: attitude loop; H: estimator, exact for a drag held over a cycle; D: what of a torque that is late falls into the
    cycle of its command. In the limit of fast sampling (A + G)/(1 - G), with G of (1): below the bandwidth the
    estimator's two integrators add to the controller's own.
    """
    cycle = scenario.cycle
    period = 1.0 / cycle.rate_hz
    late = int(cycle.command_delay_s / period)
    early = cycle.command_delay_s - late * period
    z = np.exp(1j * w * period)
    held = _estimator(bandwidth_rad_s, damping, period, z) * z ** (-late)
    loop = (attitude_loop(scenario, w) + held * (early / z + (period - early)) / period) / (1.0 - held)
    return np.asarray(loop)


def _estimator(bandwidth_rad_s: float, damping: float, period_s: float, z: Complex128Array) -> Complex128Array:
    """H(z): from the drag over the cycle that a reading begins to the estimate at that reading.

    Of second order: its poles, and the first two values after a pulse of one cycle, tell it.
    """
    estimator = PiDragEstimator(bandwidth_rad_s, damping)
    first, second = estimator.step(period_s, 1.0), estimator.step(period_s, 0.0)
    turning = bandwidth_rad_s * math.sqrt(1.0 - damping * damping) * period_s
    fade = math.exp(-damping * bandwidth_rad_s * period_s)
    trace, determinant = 2.0 * fade * math.cos(turning), fade * fade
    return np.asarray((first * z + (second - trace * first)) / (z * z - trace * z + determinant))


def _at_phase_crossings(loop: OpenLoop, w: Float64Array) -> list[float]:
    """Gains where the loop crosses the negative real axis."""
    values = loop(w)
    found = []
    for i in np.flatnonzero((values.imag[:-1] * values.imag[1:] < 0.0) & (values.real[:-1] < 0.0)):
        low, high, sign = float(w[i]), float(w[i + 1]), values.imag[i]
        for _ in range(_HALVINGS):
            middle = math.sqrt(low * high)
            low, high = (middle, high) if loop(np.array([middle]))[0].imag * sign > 0.0 else (low, middle)
        found.append(abs(complex(loop(np.array([low]))[0])))
    return [*found, abs(complex(values[-1]))] if values[-1].real < 0.0 else found  # real at half the rate
