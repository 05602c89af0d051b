"""The limits of a motion before it moves anything: those of the configuration, with room for what is not known."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from rw_ekf.arrays import Float64Array
from rw_ekf.errors import BadInputError, RwEkfError
from rw_ekf.likelihood.model_vector import Model
from rw_ekf.settle.named_moves import Bounds
from rw_ekf.settle.predicted import Scene
from rw_ekf.units import rad_s_from_rpm

if TYPE_CHECKING:
    from rw_ekf.settings.schema import Configuration

SETTLE_S = 120.0
_AIMED = 0.7  # of limits.speed_rpm: no move aims higher
_PREDICTED = 0.85  # no explanation predicts a higher speed
_MISTAKEN = 0.95  # nor would a wheel with so much more gain and less friction than it is believed to have reach it:
_GAIN_ERROR, _FRICTION_ERROR = 0.15, 0.3
_SLEW = 0.8  # of limits.slew_A_per_s: a tick may come a fifth too soon
_BELOW_HOT_K = 3.0  # of limits.temperature_degC


@dataclass(frozen=True)
class MotionLimits:
    """What a motion keeps to as it is predicted."""

    speed_rad_s: float
    temperature_degC: float

    @classmethod
    def of(cls, configuration: Configuration) -> MotionLimits:
        """From the `limits` of a configuration."""
        section = configuration.limits
        return cls(rad_s_from_rpm(section.speed_rpm), section.temperature_degC)

    def kept(self, scene: Scene, current_A: Float64Array) -> bool:
        """Whether speed and temperature stay below the limits under every explanation, and on a wheel unlike all."""
        for item in scene.standing.explanations:
            course = scene.course(item.model, current_A)
            if not self._below(course.speed_rad_s, _PREDICTED):
                return False
            hottest = scene.hottest(course, current_A)
            if hottest is not None and hottest > self.temperature_degC - _BELOW_HOT_K:
                return False
        believed = scene.standing.explanations[0].model
        return all(
            self._below(scene.course(_mistaken(believed, gain, friction), current_A).speed_rad_s, _MISTAKEN)
            for gain, friction in ((1.0 + _GAIN_ERROR, 1.0 - _FRICTION_ERROR), (1.0 + _GAIN_ERROR, 1.0))
        )

    def _below(self, speed: Float64Array, share: float) -> bool:
        return bool(np.isfinite(speed).all() and np.max(np.abs(speed), initial=0.0) <= share * self.speed_rad_s)


def _mistaken(model: Model, gain: float, friction: float) -> Model:
    """The base of a model with another gain and another friction."""
    p = model.parameters
    other = p._replace(
        motor_gain=gain * p.motor_gain,
        viscous=friction * p.viscous,
        coulomb=friction * p.coulomb,
        static=friction * p.static,
    )
    return replace(model.base, parameters=other)


def bounds_of(configuration: Configuration) -> Bounds:
    """What currents are made with. Raises BadInputError where the configuration leaves no room for a motion."""
    limits, period = configuration.limits, 1.0 / configuration.loop.rate_hz
    ticks = int(SETTLE_S / period)
    if ticks < 2 * SETTLE_S:
        raise BadInputError(
            f"loop.rate_hz is {configuration.loop.rate_hz:g}: a motion is designed for 2 Hz or more, set it higher"
        )
    return Bounds(
        current_A=limits.current_A,
        step_A=_SLEW * limits.slew_A_per_s * period,
        speed_rad_s=_AIMED * rad_s_from_rpm(limits.speed_rpm),
        period_s=period,
        ticks=ticks,
    )


def refuse_hot(scene: Scene, configuration: Configuration) -> None:
    """Raise RwEkfError where the wheel was as warm as it may get when the record ended."""
    now, limit = scene.standing.temperature_degC, configuration.limits.temperature_degC
    if now is not None and now > limit - _BELOW_HOT_K:
        raise RwEkfError(
            f"the record ended at {now:.3g} degC, and limits.temperature_degC is {limit:g}: let the wheel cool down, "
            "record a short log, and diagnose it with the others"
        )
