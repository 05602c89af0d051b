"""What a proof of the diagnosis consists of: cases, each one log of one simulated wheel, and what must be named for it.

A case depends on its mark, its number and the proof's seed alone, so that any one can be made again by its name. Wheels
are drawn around [CK13]: k +-20 %, b +-50 %, c +-30 %, s/c 1.0 to 1.3.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal, NamedTuple

import numpy as np

from rw_ekf.drivers.sim.plant_effect_text import parse_effects
from rw_ekf.drivers.sim.plant_effects import EFFECTS
from rw_ekf.drivers.sim.plant_parameters import PlantNoise, PlantParameters
from rw_ekf.units import RAD_S_PER_RPM
from tools.proof.sizes import SHARES, draw_size, effect_text, reach_of

WIRE_GRID_RPM = 0.5
OUTSIDE_IDS = tuple(name for name, effect in EFFECTS.items() if not effect.in_catalogue)
TEMPERATURE_IDS = ("viscous_temperature", "coulomb_temperature", "motor_gain_temperature")

Expectation = Literal["effects", "adequate", "unexplained"]
Angle = Literal["none", "counted", "wrapped"]


@dataclass(frozen=True)
class Case:
    """One log to be made and diagnosed."""

    name: str
    mark: str  # the mark it counts for
    expects: Expectation
    expected: tuple[str, ...]  # ids that must be named; empty unless expects is "effects"
    effects: tuple[str, ...]  # as rw_ekf.drivers.sim.plant_effect_text takes them
    wheel: PlantParameters  # without the effects
    profile: str
    profile_seed: int
    seed: int
    noise_rpm: float
    process_rpm: float = 0.0  # per sqrt(s)
    grid_rpm: float = 0.0  # of the healthy readings
    delay_s: float = 0.0  # of every command; the log says so
    jitter_s: float = 0.0  # standard deviation of the sample times
    initial_rpm: float = 0.0
    telemetry: bool = True  # temperature and measured current are logged
    angle: Angle = "none"
    size_percent: float | None = None  # nominal, of Coulomb friction
    plant: str = "own"  # or the name of a wheel of proof_mujoco

    @property
    def parameters(self) -> PlantParameters:
        """The wheel with its effects and its readings' grid. Raises BadInputError for an effect that cannot be."""
        wheel = self.wheel._replace(speed_grid_rad_s=self.grid_rpm * RAD_S_PER_RPM)
        return parse_effects(self.effects, wheel)

    @property
    def noise(self) -> PlantNoise:
        """What is random about the wheel."""
        return PlantNoise(self.noise_rpm * RAD_S_PER_RPM, self.process_rpm * RAD_S_PER_RPM)

    def with_only(self, effect: str) -> Case:
        """The same case with one of its effects alone."""
        return replace(self, effects=tuple(text for text in self.effects if text.split(":")[0] == effect))


def draw_wheel(draws: np.random.Generator, least_excess: float = 0.0) -> PlantParameters:
    """A wheel around [CK13]; s/c is at least 1 + least_excess."""
    usual = PlantParameters()
    coulomb = usual.coulomb * draws.uniform(0.7, 1.3)
    return usual._replace(
        motor_gain=usual.motor_gain * draws.uniform(0.8, 1.2),
        viscous=usual.viscous * draws.uniform(0.5, 1.5),
        coulomb=coulomb,
        static=coulomb * draws.uniform(1.0 + least_excess, 1.3),
    )


class Logging(NamedTuple):
    """What varies from log to log without being a fault of the wheel or its drive."""

    grid_rpm: float
    delay_s: float
    jitter_s: float


def healthy_logging(draws: np.random.Generator, noise_rpm: float) -> Logging:
    """Readings on the wire's grid or not (never where it is coarser than the noise), commands late or not, jitter."""
    coarse = noise_rpm >= WIRE_GRID_RPM and draws.random() < 0.5
    return Logging(
        WIRE_GRID_RPM if coarse else 0.0,
        draws.uniform(0.010, 0.020) if draws.random() < 0.5 else 0.0,
        0.001 if draws.random() < 0.5 else 0.0,
    )


def draws_of(seed: int, mark: str, number: int) -> np.random.Generator:
    """What is random about one case."""
    return np.random.default_rng([seed, *mark.encode(), number])


def effect_case(
    mark: str, number: int, seed: int, effects: tuple[str, ...], rung: int, profile: str, noise_rpm: float
) -> Case:
    """A wheel with one effect or several, each of the size of `rung`; what must be named follows from their ids."""
    draws = draws_of(seed, mark, number)
    wheel = draw_wheel(draws, 0.03 if "stribeck_shape" in effects else 0.0)
    profile_seed = int(draws.integers(1, 100_000))
    reach = reach_of(wheel, profile, profile_seed)
    size = draw_size(draws, rung)
    texts = tuple(effect_text(draws, effect, size, wheel, reach) for effect in effects)
    needs_temperature = any(effect in TEMPERATURE_IDS for effect in effects)
    angles: tuple[Angle, ...] = ("none", "none", "counted", "wrapped")
    logging = healthy_logging(draws, noise_rpm)
    outside = any(effect in OUTSIDE_IDS for effect in effects)
    return Case(
        name=f"{mark}-{number:03d}-{'+'.join(effects)}",
        mark=mark,
        expects="unexplained" if outside else "effects",
        expected=() if outside else effects,
        effects=texts,
        wheel=wheel,
        profile=profile,
        profile_seed=profile_seed,
        seed=int(draws.integers(1 << 30)),
        noise_rpm=noise_rpm,
        process_rpm=draws.uniform(0.01, 0.02) if draws.random() < 1.0 / 3.0 else 0.0,
        telemetry=bool(needs_temperature or draws.random() < 0.7),
        angle=angles[int(draws.integers(4))] if "torque_ripple" in effects else "none",
        size_percent=100.0 * SHARES[rung],
        grid_rpm=logging.grid_rpm,
        delay_s=logging.delay_s,
        jitter_s=logging.jitter_s,
    )
