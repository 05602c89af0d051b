"""What happens on the bench: body, wheel, controller, noise, and when the wheel reverses; YAML may say otherwise."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

from pydantic import Field

from rw_ekf.checking.findings import checked
from rw_ekf.checking.section import Section
from rw_ekf.checking.yaml_loader import load_yaml
from rw_ekf.settings.schema import Effect, TrueWheelSection
from rw_ekf.units import rad_s_from_rpm


class BodySection(Section):
    """The one-axis table, or the spacecraft's axis."""

    inertia_kg_m2: float = Field(0.5, gt=0, le=1e6, description="inertia of the body about the wheel's axis [kg m^2]")
    disturbance_Nm: float = Field(-0.46e-3, ge=-1e3, le=1e3, description="constant torque on it: the fan [N m]")
    flexible_hz: float | None = Field(
        None, gt=0, le=1e3, description="frequency of a flexible appendage; null: none [Hz]"
    )
    flexible_damping: float = Field(0.005, gt=0, lt=1, description="its damping ratio [-]")
    flexible_gain: float = Field(0.1, ge=0, le=1, description="its share in the body's acceleration [-]")


class ControlSection(Section):
    """The PID of the attitude, in torque on the body; the same for all compensations."""

    proportional_Nm_rad: float = Field(0.073, gt=0, le=1e6, description="gain of the attitude [N m/rad]")
    derivative_Nms_rad: float | None = Field(
        None, gt=0, le=1e6, description="gain of the rate; null: 2 sqrt(Kp J), critical damping [N m s/rad]"
    )
    integral_Nm_rad_s: float = Field(4.24e-4, ge=0, le=1e6, description="gain of the attitude's integral [N m/(rad s)]")
    settling_s: float = Field(
        60.0, ge=0, le=1e4, description="before time 0 the integral is let settle so long, by a larger gain [s]"
    )
    settling_integral_Nm_rad_s: float = Field(
        0.006, gt=0, le=1e6, description="gain of the attitude's integral while it settles [N m/(rad s)]"
    )


class GyroSection(Section):
    """The gyroscope that attitude and rate come from."""

    rate_noise_deg_s: float = Field(0.001, ge=0, le=1e3, description="white noise of one rate reading [deg/s]")
    walk_deg_per_sqrt_h: float = Field(0.001, ge=0, le=1e3, description="random walk of the attitude [deg/sqrt(h)]")


class BenchWheelSection(TrueWheelSection):
    """The true wheel, which no compensation reads."""

    stribeck_speed_rpm: float = Field(4.0, gt=0, le=1e4, description="speed scale of the Stribeck bump [rpm]")
    inertia_kg_m2: float = Field(1.5e-3, gt=0, le=1e3, description="rotor inertia [kg m^2]")
    start_rpm: float = Field(
        674.0, ge=-1e5, le=1e5, description="speed at time 0, if the attitude is held by then [rpm]"
    )
    spread_percent: float = Field(
        0.0, ge=0, le=90, description="each seed draws gain and frictions within so much of these [%]"
    )
    age_percent: float = Field(
        0.0, ge=-90, le=1e3, description="friction grows, and the motor weakens by a fifth of it, over the run [%]"
    )
    torque_noise_rpm_per_sqrt_s: float = Field(0.0, ge=0, le=1e4, description="random walk of the speed [rpm/sqrt(s)]")
    effects: tuple[Effect, ...] = Field(
        (), strict=False, description='effects of the catalogue, as "ID:name=value,name=value"'
    )


class BeliefSection(Section):
    """What compensations believe of the wheel, where it is to be wrong."""

    friction_error_percent: float = Field(
        0.0, gt=-100, le=1e3, description="friction is believed larger by so much, and never learned better [%]"
    )
    gain_error_percent: float = Field(
        0.0, gt=-100, le=1e3, description="the motor gain is believed larger by so much, and never learned better [%]"
    )


class CycleSection(Section):
    """The loop: the daemon's own, on a virtual clock."""

    rate_hz: float = Field(10.0, ge=1, le=2000, description="cycles per second [Hz]")
    command_delay_s: float = Field(0.010, ge=0, le=1, description="from a reading until its command acts [s]")
    current_A: float = Field(0.6, gt=0, le=1e3, description="limit of the guard [A]")
    slew_A_per_s: float = Field(5.0, gt=0, le=1e6, description="limit of the guard [A/s]")
    duration_s: float = Field(350.0, gt=0, le=1e5, description="length of a run, from time 0 on [s]")
    speed_noise_rpm: tuple[float, ...] = Field(
        (1.0, 5.0), strict=False, min_length=1, description="noises of a speed reading, one contest each [rpm]"
    )


class Scenario(Section):
    """A whole scenario. The defaults are the experiment of [CK13] 4."""

    body: BodySection = Field(default_factory=BodySection, description="the body that is pointed")
    control: ControlSection = Field(default_factory=ControlSection, description="the attitude controller")
    gyro: GyroSection = Field(default_factory=GyroSection, description="the gyroscope")
    wheel: BenchWheelSection = Field(default_factory=BenchWheelSection, description="the true wheel")
    belief: BeliefSection = Field(default_factory=BeliefSection, description="what compensations are told wrongly")
    cycle: CycleSection = Field(default_factory=CycleSection, description="the loop and the readings")

    def changed(self, section: str, **values: Any) -> Scenario:
        """The same with other values, unchecked, in one of its sections."""
        return self.model_copy(update={section: getattr(self, section).model_copy(update=values)})

    @property
    def derivative_Nms_rad(self) -> float:
        """Gain of the rate."""
        given = self.control.derivative_Nms_rad
        return 2.0 * math.sqrt(self.control.proportional_Nm_rad * self.body.inertia_kg_m2) if given is None else given

    @property
    def lasts_s(self) -> float:
        """Length of a run with its settling [s]."""
        return self.control.settling_s + self.cycle.duration_s

    @property
    def first_speed_rad_s(self) -> float:
        """The wheel's speed when the settling begins: it takes up the disturbance's momentum from there to time 0."""
        gained = self.body.disturbance_Nm / self.wheel.inertia_kg_m2 * self.control.settling_s
        return rad_s_from_rpm(self.wheel.start_rpm) - gained

    @property
    def reversal_s(self) -> float | None:
        """When the wheel would cross zero if the attitude were held: its momentum by the disturbance; None: never."""
        momentum = self.wheel.inertia_kg_m2 * rad_s_from_rpm(self.wheel.start_rpm)
        rate = self.body.disturbance_Nm
        return -momentum / rate if momentum * rate < 0.0 else None


def load_scenario(path: str | Path) -> Scenario:
    """Read and check a scenario. Raises ConfigError with one finding per mistake, each with file:line:column."""
    document = load_yaml(path)
    data = document.data
    if isinstance(data, dict):
        data = {name: {} if section is None else section for name, section in data.items()}
    return checked(Scenario, data, "a scenario", document.where, document.where_key)
