"""Every effect a simulated wheel can be given, by the id of the catalogue, and two that the catalogue does not know.

Each is a frozen dataclass: named parameters with their unit, a default of moderate size (3 to 10 % of Coulomb
friction where that means something), and `applied_to`, which enters it into the plant's parameters. f > 0 slows a wheel
turning forward. Effects combine; torque_ripple may be given three times.
"""

from __future__ import annotations

from collections.abc import Sequence

from drivers.sim.plant_effect import PlantEffect
from drivers.sim.plant_effects_drive import (
    ActuatorLag,
    CurrentDeadzone,
    ExternalTorque,
    MotorGainTemperature,
    MotorSaturation,
    OffsetTorque,
    SpeedQuantisation,
    TorqueRipple,
    TransportDelay,
)
from drivers.sim.plant_effects_friction import (
    AccelerationFriction,
    CoulombDrift,
    CoulombTemperature,
    CubicDrag,
    DragBump,
    DragSpike,
    FrictionLag,
    PreslidingHysteresis,
    QuadraticDrag,
    StribeckShape,
    ViscousAsymmetry,
    ViscousTemperature,
)
from drivers.sim.plant_parameters import PlantParameters

EFFECTS: dict[str, type[PlantEffect]] = {
    effect.id: effect
    for effect in (
        OffsetTorque, ViscousAsymmetry, QuadraticDrag, CubicDrag, ViscousTemperature, CoulombTemperature,
        MotorGainTemperature, MotorSaturation, CurrentDeadzone, ActuatorLag, TransportDelay, PreslidingHysteresis,
        FrictionLag, TorqueRipple, DragSpike, CoulombDrift, StribeckShape, ExternalTorque, SpeedQuantisation,
        DragBump, AccelerationFriction,
    )
}  # fmt: skip
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
