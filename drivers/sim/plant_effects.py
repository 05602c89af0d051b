"""Every effect a simulated wheel can be given, by the id of the catalogue, and what the catalogue does not know.

Each is a frozen dataclass: named parameters with their unit, and a default of moderate size (3 to 10 % of Coulomb
friction where that means something). f > 0 slows a wheel turning forward. Effects combine; torque_ripple may be given
three times.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import astuple, dataclass
from typing import ClassVar

from rw_ekf.drivers.sim.plant_parameters import STRIBECK_LAWS, TEMPERATURE_LAWS, PlantParameters
from rw_ekf.units import RAD_S_PER_RPM


@dataclass(frozen=True)
class PlantEffect:
    """One effect with its numbers."""

    id: ClassVar[str]
    fills: ClassVar[tuple[str, ...]] = ()  # parameters of the plant, in the order of the effect's own
    in_catalogue: ClassVar[bool] = True  # the estimator's; without, a diagnosis must call it unexplained
    positive: ClassVar[tuple[str, ...]] = ()

    def applied_to(self, parameters: PlantParameters) -> PlantParameters:
        """The same wheel with the effect. Raises ValueError for numbers that cannot be."""
        for name in self.positive:
            if getattr(self, name) <= 0.0:
                raise ValueError(f"{self.id}: {name} must be above 0, not {getattr(self, name):g}")
        return parameters._replace(**dict(zip(self.fills, astuple(self), strict=False)))


@dataclass(frozen=True)
class OffsetTorque(PlantEffect):
    """f = torque, whatever the direction; the same as unequal Coulomb friction by direction, or as a current offset."""

    id = "offset_torque"
    fills = ("offset_rad_s2",)
    torque_rad_s2: float = 0.03


@dataclass(frozen=True)
class ViscousAsymmetry(PlantEffect):
    """f = difference |omega|: viscous friction b + difference forward, b - difference backward."""

    id = "viscous_asymmetry"
    fills = ("asymmetry_1_s",)
    difference_1_s: float = 0.0002


@dataclass(frozen=True)
class QuadraticDrag(PlantEffect):
    """f = coefficient omega |omega|: windage."""

    id = "quadratic_drag"
    fills = ("quadratic_drag_1_rad",)
    coefficient_1_rad: float = 1.0e-6


@dataclass(frozen=True)
class CubicDrag(PlantEffect):
    """f = coefficient omega^3: S-shaped drag; negative bends the other way."""

    id = "cubic_drag"
    fills = ("cubic_drag_s_rad2",)
    coefficient_s_rad2: float = 5.0e-9


@dataclass(frozen=True)
class ViscousTemperature(PlantEffect):
    """b(T) = b (1 + slope (T - 20 degC)), or b exp(slope (T - 20 degC)): thinner lubricant when warm."""

    id = "viscous_temperature"
    fills = ("viscous_temperature_1_K",)
    slope_1_K: float = -0.02
    law: str = "linear"

    def applied_to(self, parameters: PlantParameters) -> PlantParameters:
        """Set slope and law. Raises ValueError for an unknown law."""
        if self.law not in TEMPERATURE_LAWS:
            raise ValueError(f"viscous_temperature: unknown law {self.law!r}; one of {', '.join(TEMPERATURE_LAWS)}")
        return super().applied_to(parameters)._replace(viscous_temperature_law=TEMPERATURE_LAWS[self.law])


@dataclass(frozen=True)
class CoulombTemperature(PlantEffect):
    """c(T) = c (1 + slope (T - 20 degC)); the break-away friction moves by as much, so that s - c stays."""

    id = "coulomb_temperature"
    fills = ("coulomb_temperature_1_K",)
    slope_1_K: float = -0.01


@dataclass(frozen=True)
class MotorGainTemperature(PlantEffect):
    """k(T) = k (1 + slope (T - 20 degC)): magnets weaken when warm."""

    id = "motor_gain_temperature"
    fills = ("motor_gain_temperature_1_K",)
    slope_1_K: float = -0.002


@dataclass(frozen=True)
class MotorSaturation(PlantEffect):
    """k(I) = k (1 - slope |I|)."""

    id = "motor_saturation"
    fills = ("motor_saturation_1_A",)
    slope_1_A: float = 0.1


@dataclass(frozen=True)
class CurrentDeadzone(PlantEffect):
    """No torque up to |I| = width; beyond it I - sgn(I) width drives the wheel."""

    id = "current_deadzone"
    fills = ("current_deadzone_A",)
    width_A: float = 0.002


@dataclass(frozen=True)
class ActuatorLag(PlantEffect):
    """The winding current follows the command with a first-order lag."""

    id = "actuator_lag"
    fills = ("actuator_lag_s",)
    time_constant_s: float = 0.05


@dataclass(frozen=True)
class TransportDelay(PlantEffect):
    """Each command acts later by delay, on top of any delay that the driver reports."""

    id = "transport_delay"
    fills = ("transport_delay_s",)
    delay_s: float = 0.05


@dataclass(frozen=True)
class PreslidingHysteresis(PlantEffect):
    """A bristle [L17 (5)] in place of dry friction that sticks: break-away when bent by deflection; hysteresis below.

    damping: damping ratio of the wheel on its bristle (0 is Dahl's model [L17 (4)]).
    """

    id = "presliding_hysteresis"
    fills = ("presliding_rad", "presliding_damping")
    deflection_rad: float = 0.05
    damping: float = 0.3


@dataclass(frozen=True)
class FrictionLag(PlantEffect):
    """Dry friction follows its static value with a first-order lag (Walrath) [L17 (7)]."""

    id = "friction_lag"
    fills = ("friction_lag_s",)
    time_constant_s: float = 0.1


@dataclass(frozen=True)
class TorqueRipple(PlantEffect):
    """f = amplitude sin(order angle + phase): cogging or imbalance. Give it again (three at most) for more orders."""

    id = "torque_ripple"
    amplitude_rad_s2: float = 0.03
    order: float = 1.0
    phase_rad: float = 0.0

    def applied_to(self, parameters: PlantParameters) -> PlantParameters:
        """Take the next free of three places. Raises ValueError when there is none."""
        for number in (1, 2, 3):
            if getattr(parameters, f"ripple_{number}_rad_s2") == 0.0:
                names = (f"ripple_{number}_rad_s2", f"ripple_{number}_order", f"ripple_{number}_phase_rad")
                return parameters._replace(**dict(zip(names, astuple(self), strict=True)))
        raise ValueError("torque_ripple may be given three times at most")


@dataclass(frozen=True)
class DragSpike(PlantEffect):
    """Extra dry friction amplitude exp(-(t - onset)/decay) from onset on: an "oil jog" [L17 IV]."""

    id = "drag_spike"
    fills = ("spike_rad_s2", "spike_onset_s", "spike_decay_s")
    positive = ("decay_s",)
    amplitude_rad_s2: float = 0.05
    onset_s: float = 120.0
    decay_s: float = 60.0


@dataclass(frozen=True)
class CoulombDrift(PlantEffect):
    """Dry friction that moves with running time: rate tau (1 - exp(-t/tau)) plus a random walk.

    rate_rad_s3: slope at the start; time_constant_s: tau, 0 for a straight line; wander_rad_s2: per sqrt(s).
    """

    id = "coulomb_drift"
    fills = ("drift_rad_s3", "drift_time_s", "drift_wander_rad_s2")
    rate_rad_s3: float = -2.0e-4
    time_constant_s: float = 300.0
    wander_rad_s2: float = 0.0


@dataclass(frozen=True)
class StribeckShape(PlantEffect):
    """Another Stribeck speed, or another law (gauss, tustin, lorentz), than the model has."""

    id = "stribeck_shape"
    fills = ("stribeck_speed_rad_s",)
    positive = ("speed_rad_s",)
    speed_rad_s: float = 10.0 * RAD_S_PER_RPM
    law: str = "gauss"

    def applied_to(self, parameters: PlantParameters) -> PlantParameters:
        """Set speed and law. Raises ValueError for an unknown law or a speed that is not positive."""
        if self.law not in STRIBECK_LAWS:
            raise ValueError(f"stribeck_shape: unknown law {self.law!r}; one of {', '.join(STRIBECK_LAWS)}")
        return super().applied_to(parameters)._replace(stribeck_law=STRIBECK_LAWS[self.law])


@dataclass(frozen=True)
class ExternalTorque(PlantEffect):
    """f = amplitude sin(2 pi frequency t + phase), t the wheel's running time."""

    id = "external_torque"
    fills = ("external_rad_s2", "external_Hz", "external_phase_rad")
    amplitude_rad_s2: float = 0.03
    frequency_Hz: float = 0.05
    phase_rad: float = 0.0


@dataclass(frozen=True)
class SpeedQuantisation(PlantEffect):
    """The speed reading is rounded to a multiple of grid, after the noise."""

    id = "speed_quantisation"
    fills = ("speed_grid_rad_s",)
    grid_rad_s: float = 5.0 * RAD_S_PER_RPM


@dataclass(frozen=True)
class DragBump(PlantEffect):
    """f = sgn(omega) amplitude exp(-((|omega| - speed)/width)^2): a resonance at one speed."""

    id = "drag_bump"
    fills = ("bump_rad_s2", "bump_speed_rad_s", "bump_width_rad_s")
    positive = ("width_rad_s",)
    amplitude_rad_s2: float = 0.05
    speed_rad_s: float = 600.0 * RAD_S_PER_RPM
    width_rad_s: float = 100.0 * RAD_S_PER_RPM


@dataclass(frozen=True)
class SpeedAveraging(PlantEffect):
    """The speed reading is the angle turned in the window before it, over the window; noise and grid come after."""

    id = "speed_averaging"
    fills = ("speed_window_s",)
    window_s: float = 0.1


@dataclass(frozen=True)
class MotorGainSpeed(PlantEffect):
    """NOT IN THE CATALOGUE. k(omega) = k (1 - slope |omega|): commutation that lags behind a fast rotor."""

    id = "motor_gain_speed"
    fills = ("gain_speed_s_rad",)
    in_catalogue = False
    slope_s_rad: float = 0.0003


@dataclass(frozen=True)
class AccelerationFriction(PlantEffect):
    """NOT IN THE CATALOGUE. Dry friction rises by ratio |k I|: a bearing loaded by the torque it transmits."""

    id = "acceleration_friction"
    fills = ("load_friction",)
    in_catalogue = False
    ratio: float = 0.03


EFFECTS: dict[str, type[PlantEffect]] = {effect.id: effect for effect in PlantEffect.__subclasses__()}
CATALOGUE_IDS = tuple(name for name, effect in EFFECTS.items() if effect.in_catalogue)


def with_effects(parameters: PlantParameters, effects: Sequence[PlantEffect]) -> PlantParameters:
    """The same wheel with all the effects. Raises ValueError for one given twice or out of range."""
    seen: set[str] = set()
    for effect in effects:
        if effect.id in seen and effect.id != TorqueRipple.id:
            raise ValueError(f"effect {effect.id} is given twice; give it once")
        seen.add(effect.id)
        parameters = effect.applied_to(parameters)
    return parameters
