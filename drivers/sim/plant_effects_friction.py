"""Effects in what slows a simulated wheel: drag, dry friction, temperature and memory."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from drivers.sim.plant_effect import Catalogued, PlantOnly
from drivers.sim.plant_parameters import STRIBECK_LAWS, PlantParameters
from rw_ekf.units import RAD_S_PER_RPM


@dataclass(frozen=True)
class ViscousAsymmetry(Catalogued):
    """f = difference |omega|: viscous friction b + difference forward, b - difference backward."""

    id: ClassVar[str] = "viscous_asymmetry"
    difference_1_s: float = 0.0002

    def applied_to(self, parameters: PlantParameters) -> PlantParameters:
        """Set the difference."""
        return parameters._replace(asymmetry_1_s=self.difference_1_s)


@dataclass(frozen=True)
class QuadraticDrag(Catalogued):
    """f = coefficient omega |omega|: windage."""

    id: ClassVar[str] = "quadratic_drag"
    coefficient_1_rad: float = 1.0e-6

    def applied_to(self, parameters: PlantParameters) -> PlantParameters:
        """Set the coefficient."""
        return parameters._replace(quadratic_drag_1_rad=self.coefficient_1_rad)


@dataclass(frozen=True)
class CubicDrag(Catalogued):
    """f = coefficient omega^3: S-shaped drag; negative bends the other way."""

    id: ClassVar[str] = "cubic_drag"
    coefficient_s_rad2: float = 5.0e-9

    def applied_to(self, parameters: PlantParameters) -> PlantParameters:
        """Set the coefficient."""
        return parameters._replace(cubic_drag_s_rad2=self.coefficient_s_rad2)


@dataclass(frozen=True)
class ViscousTemperature(Catalogued):
    """b(T) = b (1 + slope (T - 20 degC)): thinner lubricant when warm."""

    id: ClassVar[str] = "viscous_temperature"
    slope_1_K: float = -0.02

    def applied_to(self, parameters: PlantParameters) -> PlantParameters:
        """Set the slope."""
        return parameters._replace(viscous_temperature_1_K=self.slope_1_K)


@dataclass(frozen=True)
class CoulombTemperature(Catalogued):
    """c(T) = c (1 + slope (T - 20 degC)); the break-away friction moves by as much, so that s - c stays."""

    id: ClassVar[str] = "coulomb_temperature"
    slope_1_K: float = -0.01

    def applied_to(self, parameters: PlantParameters) -> PlantParameters:
        """Set the slope."""
        return parameters._replace(coulomb_temperature_1_K=self.slope_1_K)


@dataclass(frozen=True)
class PreslidingHysteresis(Catalogued):
    """A bristle [L17 (5)] in place of dry friction that sticks: break-away when bent by deflection; hysteresis below.

    damping: damping ratio of the wheel on its bristle (0 is Dahl's model [L17 (4)]).
    """

    id: ClassVar[str] = "presliding_hysteresis"
    deflection_rad: float = 0.05
    damping: float = 0.3

    def applied_to(self, parameters: PlantParameters) -> PlantParameters:
        """Set bristle and damping."""
        return parameters._replace(presliding_rad=self.deflection_rad, presliding_damping=self.damping)


@dataclass(frozen=True)
class FrictionLag(Catalogued):
    """Dry friction follows its static value with a first-order lag (Walrath) [L17 (7)]."""

    id: ClassVar[str] = "friction_lag"
    time_constant_s: float = 0.1

    def applied_to(self, parameters: PlantParameters) -> PlantParameters:
        """Set the time constant."""
        return parameters._replace(friction_lag_s=self.time_constant_s)


@dataclass(frozen=True)
class DragSpike(Catalogued):
    """Extra dry friction amplitude exp(-(t - onset)/decay) from onset on: an "oil jog" [L17 IV]."""

    id: ClassVar[str] = "drag_spike"
    amplitude_rad_s2: float = 0.05
    onset_s: float = 120.0
    decay_s: float = 60.0

    def applied_to(self, parameters: PlantParameters) -> PlantParameters:
        """Set amplitude, onset and decay. Raises ValueError where the decay is not positive."""
        if self.decay_s <= 0.0:
            raise ValueError(f"drag_spike: decay_s must be above 0, not {self.decay_s:g}")
        return parameters._replace(
            spike_rad_s2=self.amplitude_rad_s2, spike_onset_s=self.onset_s, spike_decay_s=self.decay_s
        )


@dataclass(frozen=True)
class CoulombDrift(Catalogued):
    """Dry friction that moves with running time: rate tau (1 - exp(-t/tau)) plus a random walk.

    rate_rad_s3: slope at the start; time_constant_s: tau, 0 for a straight line; wander_rad_s2: per sqrt(s).
    """

    id: ClassVar[str] = "coulomb_drift"
    rate_rad_s3: float = -2.0e-4
    time_constant_s: float = 300.0
    wander_rad_s2: float = 0.0

    def applied_to(self, parameters: PlantParameters) -> PlantParameters:
        """Set rate, time constant and walk."""
        return parameters._replace(
            drift_rad_s3=self.rate_rad_s3, drift_time_s=self.time_constant_s, drift_wander_rad_s2=self.wander_rad_s2
        )


@dataclass(frozen=True)
class StribeckShape(Catalogued):
    """Another Stribeck speed, or another law (gauss, tustin, lorentz), than the model has."""

    id: ClassVar[str] = "stribeck_shape"
    speed_rad_s: float = 10.0 * RAD_S_PER_RPM
    law: str = "gauss"

    def applied_to(self, parameters: PlantParameters) -> PlantParameters:
        """Set speed and law. Raises ValueError for an unknown law or a speed that is not positive."""
        if self.law not in STRIBECK_LAWS:
            raise ValueError(f"stribeck_shape: unknown law {self.law!r}; one of {', '.join(STRIBECK_LAWS)}")
        if self.speed_rad_s <= 0.0:
            raise ValueError(f"stribeck_shape: speed_rad_s must be above 0, not {self.speed_rad_s:g}")
        return parameters._replace(stribeck_speed_rad_s=self.speed_rad_s, stribeck_law=STRIBECK_LAWS[self.law])


@dataclass(frozen=True)
class DragBump(PlantOnly):
    """NOT IN THE CATALOGUE. f = sgn(omega) amplitude exp(-((|omega| - speed)/width)^2): a resonance at one speed."""

    id: ClassVar[str] = "drag_bump"
    amplitude_rad_s2: float = 0.05
    speed_rad_s: float = 600.0 * RAD_S_PER_RPM
    width_rad_s: float = 100.0 * RAD_S_PER_RPM

    def applied_to(self, parameters: PlantParameters) -> PlantParameters:
        """Set the bump. Raises ValueError where the width is not positive."""
        if self.width_rad_s <= 0.0:
            raise ValueError(f"drag_bump: width_rad_s must be above 0, not {self.width_rad_s:g}")
        return parameters._replace(
            bump_rad_s2=self.amplitude_rad_s2, bump_speed_rad_s=self.speed_rad_s, bump_width_rad_s=self.width_rad_s
        )


@dataclass(frozen=True)
class AccelerationFriction(PlantOnly):
    """NOT IN THE CATALOGUE. Dry friction rises by ratio |k I|: a bearing loaded by the torque it transmits."""

    id: ClassVar[str] = "acceleration_friction"
    ratio: float = 0.03

    def applied_to(self, parameters: PlantParameters) -> PlantParameters:
        """Set the ratio."""
        return parameters._replace(load_friction=self.ratio)
