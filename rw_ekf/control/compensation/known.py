"""What a compensation may know of the wheel at a tick: the believed speed, the parameters, the friction."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from rw_ekf.model.effect import REFERENCE_DEGC
from rw_ekf.model.friction import Stribeck, friction
from rw_ekf.model.state import FrictionParameters
from rw_ekf.records import Estimate, Outlook, WheelState
from rw_ekf.wheel.effect_table import NO_EFFECTS
from rw_ekf.wheel.interval import Interval, Pieces
from rw_ekf.wheel.outlook import WheelOutlook

Friction = Callable[[float], float]  # at a speed [rad/s]: the friction [rad/s^2], signed as the speed is

_CREEP_RAD_S = 1.0e-12  # of a wheel that has just broken away: with effects that takes more than s
_NO_TABLE = NO_EFFECTS.table()
_NO_TIME = Interval(0.0, 0.0, REFERENCE_DEGC, 0.0, 0, 0, 0)


@dataclass(frozen=True)
class WheelKnown:
    """The wheel as a compensation sees it at one tick.

    estimate: that the parameters are of, with its own propagation; None where they are not the filter's.
    """

    speed_rad_s: float  # as the filter believes it; exactly 0.0 where it believes the wheel at rest
    parameters: FrictionParameters
    friction_rad_s2: Friction
    stribeck: Stribeck
    estimate: Estimate | None = None

    @classmethod
    def of_parameters(cls, speed_rad_s: float, parameters: FrictionParameters, stribeck: Stribeck) -> WheelKnown:
        """Fixed parameters of the base model, and a speed."""
        curve = (parameters.viscous, parameters.coulomb, parameters.static, *stribeck)
        return cls(speed_rad_s, parameters, lambda omega: signed_friction(omega, *curve), stribeck)

    @classmethod
    def of_estimate(cls, estimate: Estimate, stribeck: Stribeck) -> WheelKnown:
        """What the filter believes; with effects in the model their friction is in it."""
        parameters = parameters_of(estimate.state)
        if not estimate.effects:
            curve = (parameters.viscous, parameters.coulomb, parameters.static, *stribeck)
            return cls(
                estimate.state.speed_rad_s, parameters, lambda omega: signed_friction(omega, *curve), stribeck, estimate
            )
        return cls(estimate.state.speed_rad_s, parameters, estimate.friction_value_rad_s2, stribeck, estimate)

    def friction_against_rad_s2(self, drive_rad_s2: float, speed_rad_s: float) -> float:
        """Friction at a speed; of a wheel at rest that which has to be broken in the drive's direction: [CK13 (15)]."""
        if speed_rad_s == 0.0 == drive_rad_s2:
            return 0.0
        return self.friction_rad_s2(speed_against(drive_rad_s2, speed_rad_s))

    def current_for_A(self, drive_rad_s2: float) -> float:
        """The current [A] of a drive: over the motor gain, and more where the model's effects take from it."""
        if self.estimate is None:
            return drive_rad_s2 / self.parameters.motor_gain
        return self.estimate.current_for_A(drive_rad_s2)

    def outlook(self, speed_rad_s: float) -> Outlook:
        """The wheel from when a command acts that is issued now, its speed taken for known.

        Parameters that are not the filter's lead on from the tick itself: how late a command acts is not known.
        """
        if self.estimate is not None and self.estimate.ahead is not None:
            return self.estimate.outlook(speed_rad_s)
        x = np.array([speed_rad_s, *self.parameters])
        return WheelOutlook(x, _NO_TABLE, self.stribeck, _NO_TIME, Pieces([], [], []))


def parameters_of(state: WheelState) -> FrictionParameters:
    """The four parameters of a state."""
    return FrictionParameters(state.motor_gain, state.viscous, state.coulomb, state.static)


def speed_against(drive_rad_s2: float, speed_rad_s: float) -> float:
    """The speed [rad/s] at which friction is evaluated: of a wheel at rest that of the first motion by the drive."""
    return math.copysign(_CREEP_RAD_S, drive_rad_s2) if speed_rad_s == 0.0 else speed_rad_s


def signed_friction(omega: float, b: float, c: float, s: float, omega_s: float, law: int) -> float:
    """Friction of a wheel that turns [rad/s^2], signed as its speed: docs/model.md eq. 1; 0 at rest."""
    return 0.0 if omega == 0.0 else math.copysign(friction(abs(omega), b, c, s, omega_s, law), omega)
