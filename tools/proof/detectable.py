"""Which sizes of an effect a log can be asked to show: the amplitudes found with 90 % power at 1 % false alarm.

The table was measured before the diagnosis was written, by prediction errors of a filter with tuned process noise, on a
random-step profile of 300 s (P2) and an identification profile of 600 s, at 1 and 5 rpm. Where it has no row, the
excess chi-square of proof_plants decides.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from rw_ekf.drivers.sim.plant_parameters import PlantParameters
from rw_ekf.units import RAD_S_PER_RPM
from tools.proof.cases import Case
from tools.proof.plants import SEEN_CHI_SQUARE, excess_chi_square
from tools.proof.sizes import reach_of


class _Limits(NamedTuple):
    """Smallest amplitudes; None at 5 rpm: not measured, taken in proportion to the noise."""

    published_1rpm: float
    published_5rpm: float | None
    identification_1rpm: float
    identification_5rpm: float | None


_PERCENT_OF_COULOMB = 0.01
_TABLE = {
    "offset_torque": _Limits(0.17, 0.31, 0.13, 0.19),  # % of c
    "quadratic_drag": _Limits(5.6, 15.0, 2.9, 5.3),  # % of c at top speed
    "viscous_temperature": _Limits(7.5, None, 1.0, None),  # %/K
    "motor_gain_temperature": _Limits(0.29, None, 0.05, None),  # %/K
    "coulomb_temperature": _Limits(0.86, None, 0.21, None),  # %/K
    "presliding_hysteresis": _Limits(0.004, 0.093, 0.002, 0.013),  # rad
    "friction_lag": _Limits(0.023, 0.098, 0.011, 0.062),  # s
    "current_deadzone": _Limits(0.27, 0.76, 0.23, 0.97),  # mA
    "actuator_lag": _Limits(8.0, 31.0, 2.3, 9.5),  # ms
    "transport_delay": _Limits(8.0, 31.0, 2.3, 9.5),  # ms
    "motor_saturation": _Limits(0.26, 0.60, 0.14, 0.52),  # % of k at top current
    "stribeck_shape": _Limits(4.9, 19.0, 1.5, 4.8),  # rpm off
}
# Spikes and high ripple have two rows each: at 1 rpm, (decay 60 s, decay 1 h) and (order 1, order 6).
_SPIKE = {"published": (0.63, 0.38), "identification": (0.86, 0.55)}  # % of c
_RIPPLE = {"published": (1.8, 6.2), "identification": (1.0, 2.9)}  # % of c


class Detectable(NamedTuple):
    """What a case can be expected to show; of several effects, the weakest."""

    table_ratio: float | None  # amplitude over the table's, None where it has no row
    excess_chi_square: float | None  # beyond what a healthy wheel can imitate
    detectable: bool  # by the table, or where it has no row by the excess


def detectable_of(case: Case) -> Detectable:
    """Judge a case by the table and by its own excess; costs some tenths of a second."""
    if case.plant != "own":
        excess = excess_chi_square(case)
        return Detectable(None, excess, excess is not None and excess >= SEEN_CHI_SQUARE)
    singles = [case.with_only(text.split(":")[0]) for text in case.effects]
    found = [_single(single) for single in singles]
    if not found:
        return Detectable(None, None, False)
    ratios = [one.table_ratio for one in found if one.table_ratio is not None]
    excesses = [one.excess_chi_square for one in found if one.excess_chi_square is not None]
    return Detectable(
        min(ratios) if ratios else None, min(excesses) if excesses else None, all(one.detectable for one in found)
    )


def _single(case: Case) -> Detectable:
    excess = excess_chi_square(case)
    seen = excess is not None and excess >= SEEN_CHI_SQUARE
    ratio = table_ratio(case)
    return Detectable(ratio, excess, seen if ratio is None else ratio >= 1.0)


def table_ratio(case: Case) -> float | None:
    """Amplitude of the case's one effect over the table's 90 % amplitude for its profile and noise."""
    effect = case.effects[0].split(":")[0]
    amplitude = _amplitude(effect, case)
    if amplitude is None:
        return None
    where = "identification" if case.profile == "identification" else "published"
    if effect == "drag_spike":
        at_60_s, at_1_h = _SPIKE[where]
        return amplitude / (_spike_limit(case.parameters.spike_decay_s, at_60_s, at_1_h) * case.noise_rpm)
    if effect == "torque_ripple":
        first, sixth = _RIPPLE[where]
        share = math.log(max(case.parameters.ripple_1_order, 1.0)) / math.log(6.0)
        return amplitude / float(first * (sixth / first) ** share * case.noise_rpm)
    limits = _TABLE[effect]
    at_1, at_5 = limits[2:] if where == "identification" else limits[:2]
    power = 1.0 if at_5 is None else math.log(at_5 / at_1) / math.log(5.0)
    return amplitude / float(at_1 * case.noise_rpm**power)


def _spike_limit(decay_s: float, at_60_s: float, at_1_h: float) -> float:
    """Between the rows in proportion of logarithms; a shorter spike has less time to be seen."""
    if decay_s <= 60.0:
        return at_60_s * math.sqrt(60.0 / decay_s)
    share = math.log(decay_s / 60.0) / math.log(60.0)
    return float(at_60_s * (at_1_h / at_60_s) ** min(share, 1.0))


def _amplitude(effect: str, case: Case) -> float | None:
    """Size in the unit of the table's row; None where it has none."""
    p = case.parameters
    percent = _PERCENT_OF_COULOMB * p.coulomb
    reach = reach_of(_healthy(case), case.profile, case.profile_seed)
    sizes = {
        "offset_torque": p.offset_rad_s2 / percent,
        "quadratic_drag": p.quadratic_drag_1_rad * reach.top_speed_rad_s**2 / percent,
        "viscous_temperature": 100.0 * p.viscous_temperature_1_K,
        "motor_gain_temperature": 100.0 * p.motor_gain_temperature_1_K,
        "coulomb_temperature": 100.0 * p.coulomb_temperature_1_K,
        "presliding_hysteresis": p.presliding_rad,
        "friction_lag": p.friction_lag_s,
        "current_deadzone": 1.0e3 * p.current_deadzone_A,
        "actuator_lag": 1.0e3 * p.actuator_lag_s,
        "transport_delay": 1.0e3 * p.transport_delay_s,
        "motor_saturation": 100.0 * p.motor_saturation_1_A * reach.top_current_A,
        "torque_ripple": p.ripple_1_rad_s2 / percent,
        "drag_spike": p.spike_rad_s2 / percent,
    }
    if p.stribeck_law == 0.0:
        sizes["stribeck_shape"] = p.stribeck_speed_rad_s / RAD_S_PER_RPM - 4.0
    size = sizes.get(effect)
    return None if size is None else float(np.abs(size))


def _healthy(case: Case) -> PlantParameters:
    return case.wheel
