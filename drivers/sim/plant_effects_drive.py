"""Effects in what drives a simulated wheel: motor, command, torques in angle and time, and the telemetry."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from drivers.sim.plant_effect import Catalogued
from drivers.sim.plant_parameters import PlantParameters
from rw_ekf.units import RAD_S_PER_RPM


@dataclass(frozen=True)
class OffsetTorque(Catalogued):
    """f = torque, whatever the direction; the same as unequal Coulomb friction by direction, or as a current offset."""

    id: ClassVar[str] = "offset_torque"
    torque_rad_s2: float = 0.03

    def applied_to(self, parameters: PlantParameters) -> PlantParameters:
        """Add to the constant torque."""
        return parameters._replace(offset_rad_s2=parameters.offset_rad_s2 + self.torque_rad_s2)


@dataclass(frozen=True)
class MotorGainTemperature(Catalogued):
    """k(T) = k (1 + slope (T - 20 degC)): magnets weaken when warm."""

    id: ClassVar[str] = "motor_gain_temperature"
    slope_1_K: float = -0.002

    def applied_to(self, parameters: PlantParameters) -> PlantParameters:
        """Set the slope."""
        return parameters._replace(motor_gain_temperature_1_K=self.slope_1_K)


@dataclass(frozen=True)
class MotorSaturation(Catalogued):
    """k(I) = k (1 - slope |I|)."""

    id: ClassVar[str] = "motor_saturation"
    slope_1_A: float = 0.1

    def applied_to(self, parameters: PlantParameters) -> PlantParameters:
        """Set the slope."""
        return parameters._replace(motor_saturation_1_A=self.slope_1_A)


@dataclass(frozen=True)
class CurrentDeadzone(Catalogued):
    """No torque up to |I| = width; beyond it I - sgn(I) width drives the wheel."""

    id: ClassVar[str] = "current_deadzone"
    width_A: float = 0.002

    def applied_to(self, parameters: PlantParameters) -> PlantParameters:
        """Set the width."""
        return parameters._replace(current_deadzone_A=self.width_A)


@dataclass(frozen=True)
class ActuatorLag(Catalogued):
    """The winding current follows the command with a first-order lag."""

    id: ClassVar[str] = "actuator_lag"
    time_constant_s: float = 0.05

    def applied_to(self, parameters: PlantParameters) -> PlantParameters:
        """Set the time constant."""
        return parameters._replace(actuator_lag_s=self.time_constant_s)


@dataclass(frozen=True)
class TransportDelay(Catalogued):
    """Each command acts later by delay, on top of any delay that the driver reports."""

    id: ClassVar[str] = "transport_delay"
    delay_s: float = 0.05

    def applied_to(self, parameters: PlantParameters) -> PlantParameters:
        """Set the delay."""
        return parameters._replace(transport_delay_s=self.delay_s)


@dataclass(frozen=True)
class TorqueRipple(Catalogued):
    """f = amplitude sin(order angle + phase): cogging or imbalance. Give it again (three at most) for more orders."""

    id: ClassVar[str] = "torque_ripple"
    amplitude_rad_s2: float = 0.03
    order: float = 1.0
    phase_rad: float = 0.0

    def applied_to(self, parameters: PlantParameters) -> PlantParameters:
        """Take the next free of three places. Raises ValueError when there is none."""
        if parameters.ripple_1_rad_s2 == 0.0:
            return parameters._replace(
                ripple_1_rad_s2=self.amplitude_rad_s2, ripple_1_order=self.order, ripple_1_phase_rad=self.phase_rad
            )
        if parameters.ripple_2_rad_s2 == 0.0:
            return parameters._replace(
                ripple_2_rad_s2=self.amplitude_rad_s2, ripple_2_order=self.order, ripple_2_phase_rad=self.phase_rad
            )
        if parameters.ripple_3_rad_s2 == 0.0:
            return parameters._replace(
                ripple_3_rad_s2=self.amplitude_rad_s2, ripple_3_order=self.order, ripple_3_phase_rad=self.phase_rad
            )
        raise ValueError("torque_ripple may be given three times at most")


@dataclass(frozen=True)
class ExternalTorque(Catalogued):
    """f = amplitude sin(2 pi frequency t + phase), t the wheel's running time."""

    id: ClassVar[str] = "external_torque"
    amplitude_rad_s2: float = 0.03
    frequency_Hz: float = 0.05
    phase_rad: float = 0.0

    def applied_to(self, parameters: PlantParameters) -> PlantParameters:
        """Set amplitude, frequency and phase."""
        return parameters._replace(
            external_rad_s2=self.amplitude_rad_s2, external_Hz=self.frequency_Hz, external_phase_rad=self.phase_rad
        )


@dataclass(frozen=True)
class SpeedQuantisation(Catalogued):
    """The speed reading is rounded to a multiple of grid, after the noise."""

    id: ClassVar[str] = "speed_quantisation"
    grid_rad_s: float = 5.0 * RAD_S_PER_RPM

    def applied_to(self, parameters: PlantParameters) -> PlantParameters:
        """Set the grid."""
        return parameters._replace(speed_grid_rad_s=self.grid_rad_s)
