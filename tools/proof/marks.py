"""The marks of a proof: which cases count for what, how many of them, and what share must come out right."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from rw_ekf.drivers.sim.plant_effects import CATALOGUE_IDS
from rw_ekf.errors import BadInputError
from tools.proof.cases import OUTSIDE_IDS, Angle, Case, draw_wheel, draws_of, effect_case, healthy_logging
from tools.proof.mujoco import foreign_case
from tools.proof.sizes import SHARES

PROFILES = ("identification", "P1", "P2", "S1", "S2", "S3", "S4", "S5")
# Profiles and noises for which there is no mark.
ELSEWHERE = (
    ("S1", 1.0),
    ("identification", 0.2),
    ("S4", 1.0),
    ("P2", 5.0),
    ("S2", 1.0),
    ("P1", 5.0),
    ("S5", 1.0),
    ("S3", 1.0),
)
OUTSIDE = (("identification", 1.0), ("identification", 1.0), ("P2", 1.0), ("identification", 5.0), ("S1", 1.0))
# Pairs that a bearing or a drive may well have together and that data can tell apart.
PAIRS = (
    ("offset_torque", "quadratic_drag"),
    ("viscous_temperature", "offset_torque"),
    ("torque_ripple", "offset_torque"),
    ("drag_spike", "quadratic_drag"),
    ("transport_delay", "viscous_asymmetry"),
    ("current_deadzone", "offset_torque"),
    ("coulomb_temperature", "quadratic_drag"),
    ("friction_lag", "offset_torque"),
    ("presliding_hysteresis", "quadratic_drag"),
    ("actuator_lag", "offset_torque"),
    ("motor_saturation", "viscous_asymmetry"),
    ("external_torque", "quadratic_drag"),
    ("drag_spike", "offset_torque"),
    ("speed_quantisation", "offset_torque"),
    ("transport_delay", "cubic_drag"),
    ("motor_gain_temperature", "offset_torque"),
    ("external_torque", "offset_torque"),
    ("actuator_lag", "torque_ripple"),
    ("quadratic_drag", "viscous_asymmetry"),
    ("coulomb_drift", "quadratic_drag"),
)


def _turn(number: int) -> tuple[str, int]:
    """Effect and rung of the number-th case: through all effects, then on to the next size."""
    return CATALOGUE_IDS[number % len(CATALOGUE_IDS)], (number // len(CATALOGUE_IDS)) % len(SHARES)


def _identification(noise_rpm: float) -> Callable[[str, int, int], Case]:
    def build(mark: str, number: int, seed: int) -> Case:
        effect, rung = _turn(number)
        return effect_case(mark, number, seed, (effect,), rung, "identification", noise_rpm)

    return build


def _published(mark: str, number: int, seed: int) -> Case:
    effect, rung = _turn(number)
    round_ = number // len(CATALOGUE_IDS)
    return effect_case(mark, number, seed, (effect,), rung, ("P1", "P2")[(number + round_) % 2], 1.0)


def _elsewhere(mark: str, number: int, seed: int) -> Case:
    """Profiles and noises for which there is no mark; the larger sizes."""
    effect, _ = _turn(number)
    profile, noise_rpm = ELSEWHERE[(number + number // len(CATALOGUE_IDS)) % len(ELSEWHERE)]
    return effect_case(mark, number, seed, (effect,), number % 2, profile, noise_rpm)


def _orders(mark: str, number: int, seed: int) -> Case:
    """Ripple of order 2 to 6: without an angle little of it can be seen at 10 Hz."""
    case = effect_case(mark, number, seed, ("torque_ripple",), number % len(SHARES), "identification", 1.0)
    order = 2 + number % 5
    angles: tuple[Angle, ...] = ("counted", "none", "wrapped", "none")
    text = case.effects[0].replace("order=1.0", f"order={order}.0")
    return replace(case, effects=(text,), angle=angles[(number // 5) % 4])


def _healthy(mark: str, number: int, seed: int) -> Case:
    draws = draws_of(seed, mark, number)
    noise_rpm = float(np.exp(draws.uniform(np.log(0.1), np.log(10.0))))
    logging = healthy_logging(draws, noise_rpm)
    return Case(
        name=f"{mark}-{number:03d}",
        mark=mark,
        expects="adequate",
        expected=(),
        effects=(),
        wheel=draw_wheel(draws),
        profile=PROFILES[number % len(PROFILES)],
        profile_seed=int(draws.integers(1, 100_000)),
        seed=int(draws.integers(1 << 30)),
        noise_rpm=noise_rpm,
        process_rpm=draws.uniform(0.01, 0.03) if draws.random() < 0.5 else 0.0,
        initial_rpm=draws.uniform(-300.0, 300.0) if draws.random() < 0.25 else 0.0,
        telemetry=bool(draws.random() < 0.7),
        angle="wrapped" if draws.random() < 0.1 else "none",
        grid_rpm=logging.grid_rpm,
        delay_s=logging.delay_s,
        jitter_s=logging.jitter_s,
    )


def _outside(mark: str, number: int, seed: int) -> Case:
    profile, noise_rpm = OUTSIDE[(number // len(OUTSIDE_IDS)) % len(OUTSIDE)]
    return effect_case(
        mark, number, seed, (OUTSIDE_IDS[number % len(OUTSIDE_IDS)],), number % len(SHARES), profile, noise_rpm
    )


def _pair(mark: str, number: int, seed: int) -> Case:
    rung = (number // len(PAIRS)) % len(SHARES)
    return effect_case(mark, number, seed, PAIRS[number % len(PAIRS)], rung, "identification", 1.0)


def _foreign(mark: str, number: int, seed: int) -> Case:
    return foreign_case(mark, number, seed, draws_of(seed, mark, number))


@dataclass(frozen=True)
class Mark:
    """A group of cases that is judged together."""

    title: str
    count: int  # in the full proof
    quick: int
    build: Callable[[str, int, int], Case]  # (mark, number, seed)
    reach: float | None = None  # the share that must be right; of healthy wheels, the share that may be accused


MARKS: dict[str, Mark] = {
    "id-1rpm": Mark("right class, identification, 1 rpm", 228, 19, _identification(1.0), 0.95),
    "id-5rpm": Mark("right class, identification, 5 rpm", 114, 0, _identification(5.0), 0.75),
    "p12-1rpm": Mark("right class, P1 and P2, 1 rpm", 114, 0, _published, 0.70),
    "healthy": Mark("healthy wheels accused", 320, 8, _healthy, 0.02),
    "outside": Mark("outside the catalogue called unexplained", 60, 4, _outside, 0.90),
    "pairs": Mark("pairs, both named", 60, 5, _pair, 0.80),
    "ripple-orders": Mark("ripple of order 2 to 6, identification, 1 rpm", 40, 2, _orders),
    "elsewhere": Mark("S1 to S5, other noises", 76, 0, _elsewhere),
    "foreign": Mark("MuJoCo's wheel, identification, 1 rpm", 44, 4, _foreign),
}


def cases_of(mark: str, count: int, seed: int) -> list[Case]:
    """The first `count` cases of a mark."""
    return [MARKS[mark].build(mark, number, seed) for number in range(count)]


def case_called(name: str, seed: int) -> Case:
    """The case of this name, or of its mark and number alone. Raises BadInputError where there is none."""
    for mark, kind in MARKS.items():
        rest = name.removeprefix(f"{mark}-")
        if rest != name and rest[:3].isdigit():
            case = kind.build(mark, int(rest[:3]), seed)
            if case.name == name or rest[:3] == rest:
                return case
    raise BadInputError(f"there is no case {name!r}; --list prints them")
