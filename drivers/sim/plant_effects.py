"""Every effect a simulated wheel can be given, by the id of the catalogue, and what the catalogue does not know.

Each has named numbers with their unit, and defaults of moderate size (3 to 10 % of Coulomb friction where that means
something). f > 0 slows a wheel turning forward. Effects combine; torque_ripple may be given three times.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

from rw_ekf.drivers.sim.plant_parameters import STRIBECK_LAWS, TEMPERATURE_LAWS, PlantParameters
from rw_ekf.units import RAD_S_PER_RPM


class Number(NamedTuple):
    """A number of an effect."""

    fills: str  # the plant's parameter; {} for the number of a place, where there are several
    default: float | str
    laws: Mapping[str, float] = {}  # codes by name, of a law
    positive: bool = False


@dataclass(frozen=True)
class PlantEffect:
    """An effect that a simulated wheel can have, or one that it has, with its own numbers."""

    id: str
    meaning: str
    numbers: Mapping[str, Number]
    places: int = 1  # how often it may be given
    in_catalogue: bool = True  # the estimator's; without, a diagnosis must call it unexplained
    values: Mapping[str, float | str] = field(default_factory=dict)  # of the numbers that are not as by default

    def __call__(self, **values: float | str) -> PlantEffect:
        """The effect with these numbers."""
        return replace(self, values=values)

    def applied_to(self, parameters: PlantParameters) -> PlantParameters:
        """The same wheel with the effect. Raises ValueError for numbers that cannot be, or where no place is left."""
        filled = {number.fills: self._value(name, number) for name, number in self.numbers.items()}
        for place in range(1, self.places + 1):
            found = {fills.format(place): value for fills, value in filled.items()}
            if self.places == 1 or getattr(parameters, next(iter(found))) == 0.0:
                return parameters._replace(**found)
        raise ValueError(f"{self.id} may be given {self.places} times at most")

    def _value(self, name: str, number: Number) -> float:
        value = self.values.get(name, number.default)
        if isinstance(value, str):
            if value not in number.laws:
                raise ValueError(f"{self.id}: unknown law {value!r}; one of {', '.join(number.laws)}")
            return number.laws[value]
        if number.positive and value <= 0.0:
            raise ValueError(f"{self.id}: {name} must be above 0, not {value:g}")
        return value


_ALL = (
    PlantEffect(
        "offset_torque",
        "f = torque, whatever the direction; the same as unequal Coulomb friction by direction, or as a current "
        "offset.",
        {"torque_rad_s2": Number("offset_rad_s2", 0.03)},
    ),
    PlantEffect(
        "viscous_asymmetry",
        "f = difference |omega|: viscous friction b + difference forward, b - difference backward.",
        {"difference_1_s": Number("asymmetry_1_s", 0.0002)},
    ),
    PlantEffect(
        "quadratic_drag",
        "f = coefficient omega |omega|: windage.",
        {"coefficient_1_rad": Number("quadratic_drag_1_rad", 1.0e-6)},
    ),
    PlantEffect(
        "cubic_drag",
        "f = coefficient omega^3: S-shaped drag; negative bends the other way.",
        {"coefficient_s_rad2": Number("cubic_drag_s_rad2", 5.0e-9)},
    ),
    PlantEffect(
        "viscous_temperature",
        "b(T) = b (1 + slope (T - 20 degC)), or b exp(slope (T - 20 degC)): thinner lubricant when warm.",
        {
            "slope_1_K": Number("viscous_temperature_1_K", -0.02),
            "law": Number("viscous_temperature_law", "linear", TEMPERATURE_LAWS),
        },
    ),
    PlantEffect(
        "coulomb_temperature",
        "c(T) = c (1 + slope (T - 20 degC)), or c exp(slope (T - 20 degC)); the break-away friction moves by as much, "
        "so that s - c stays.",
        {
            "slope_1_K": Number("coulomb_temperature_1_K", -0.01),
            "law": Number("coulomb_temperature_law", "linear", TEMPERATURE_LAWS),
        },
    ),
    PlantEffect(
        "motor_gain_temperature",
        "k(T) = k (1 + slope (T - 20 degC)): magnets weaken when warm.",
        {"slope_1_K": Number("motor_gain_temperature_1_K", -0.002)},
    ),
    PlantEffect(
        "motor_saturation",
        "k(I) = k (1 - slope |I|).",
        {"slope_1_A": Number("motor_saturation_1_A", 0.1)},
    ),
    PlantEffect(
        "current_deadzone",
        "No torque up to |I| = width; beyond it I - sgn(I) width drives the wheel.",
        {"width_A": Number("current_deadzone_A", 0.002)},
    ),
    PlantEffect(
        "actuator_lag",
        "The winding current follows the command with a first-order lag.",
        {"time_constant_s": Number("actuator_lag_s", 0.05)},
    ),
    PlantEffect(
        "transport_delay",
        "Each command acts later by delay, on top of any delay that the driver reports.",
        {"delay_s": Number("transport_delay_s", 0.05)},
    ),
    PlantEffect(
        "presliding_hysteresis",
        "A bristle [L17 (5)] in place of dry friction that sticks: break-away when bent by deflection; hysteresis "
        "below.",
        {  # damping: damping ratio of the wheel on its bristle (0 is Dahl's model [L17 (4)]).
            "deflection_rad": Number("presliding_rad", 0.05),
            "damping": Number("presliding_damping", 0.3),
        },
    ),
    PlantEffect(
        "friction_lag",
        "Dry friction follows its static value with a first-order lag (Walrath) [L17 (7)].",
        {"time_constant_s": Number("friction_lag_s", 0.1)},
    ),
    PlantEffect(
        "torque_ripple",
        "f = amplitude sin(order angle + phase): cogging or imbalance. Give it again (three at most) for more orders.",
        {
            "amplitude_rad_s2": Number("ripple_{}_rad_s2", 0.03),
            "order": Number("ripple_{}_order", 1.0),
            "phase_rad": Number("ripple_{}_phase_rad", 0.0),
        },
        places=3,
    ),
    PlantEffect(
        "drag_spike",
        'Extra dry friction amplitude exp(-(t - onset)/decay) from onset on: an "oil jog" [L17 IV].',
        {
            "amplitude_rad_s2": Number("spike_rad_s2", 0.05),
            "onset_s": Number("spike_onset_s", 120.0),
            "decay_s": Number("spike_decay_s", 60.0, positive=True),
        },
    ),
    PlantEffect(
        "coulomb_drift",
        "Dry friction that moves with running time: rate tau (1 - exp(-t/tau)) plus a random walk.",
        {  # rate_rad_s3: slope at the start; time_constant_s: tau, 0 for a straight line; wander_rad_s2: per sqrt(s).
            "rate_rad_s3": Number("drift_rad_s3", -2.0e-4),
            "time_constant_s": Number("drift_time_s", 300.0),
            "wander_rad_s2": Number("drift_wander_rad_s2", 0.0),
        },
    ),
    PlantEffect(
        "stribeck_shape",
        "Another Stribeck speed, or another law (gauss, tustin, lorentz), than the model has.",
        {
            "speed_rad_s": Number("stribeck_speed_rad_s", 10.0 * RAD_S_PER_RPM, positive=True),
            "law": Number("stribeck_law", "gauss", STRIBECK_LAWS),
        },
    ),
    PlantEffect(
        "external_torque",
        "f = amplitude sin(2 pi frequency t + phase), t the wheel's running time.",
        {
            "amplitude_rad_s2": Number("external_rad_s2", 0.03),
            "frequency_Hz": Number("external_Hz", 0.05),
            "phase_rad": Number("external_phase_rad", 0.0),
        },
    ),
    PlantEffect(
        "speed_quantisation",
        "The speed reading is rounded to a multiple of grid, after the noise.",
        {"grid_rad_s": Number("speed_grid_rad_s", 5.0 * RAD_S_PER_RPM)},
    ),
    PlantEffect(
        "drag_bump",
        "f = sgn(omega) amplitude exp(-((|omega| - speed)/width)^2): a resonance at one speed.",
        {
            "amplitude_rad_s2": Number("bump_rad_s2", 0.05),
            "speed_rad_s": Number("bump_speed_rad_s", 600.0 * RAD_S_PER_RPM),
            "width_rad_s": Number("bump_width_rad_s", 100.0 * RAD_S_PER_RPM, positive=True),
        },
    ),
    PlantEffect(
        "speed_averaging",
        "The speed reading is the angle turned in the window before it, over the window; noise and grid come after.",
        {"window_s": Number("speed_window_s", 0.1)},
    ),
    PlantEffect(
        "motor_gain_speed",
        "NOT IN THE CATALOGUE. k(omega) = k (1 - slope |omega|): commutation that lags behind a fast rotor.",
        {"slope_s_rad": Number("gain_speed_s_rad", 0.0003)},
        in_catalogue=False,
    ),
    PlantEffect(
        "acceleration_friction",
        "NOT IN THE CATALOGUE. Dry friction rises by ratio |k I|: a bearing loaded by the torque it transmits.",
        {"ratio": Number("load_friction", 0.03)},
        in_catalogue=False,
    ),
)
EFFECTS: dict[str, PlantEffect] = {effect.id: effect for effect in _ALL}
CATALOGUE_IDS = tuple(name for name, effect in EFFECTS.items() if effect.in_catalogue)


def with_effects(parameters: PlantParameters, effects: Sequence[PlantEffect]) -> PlantParameters:
    """The same wheel with all the effects. Raises ValueError for one given twice or out of range."""
    seen: set[str] = set()
    for effect in effects:
        if effect.id in seen and effect.places == 1:
            raise ValueError(f"effect {effect.id} is given twice; give it once")
        seen.add(effect.id)
        parameters = effect.applied_to(parameters)
    return parameters
