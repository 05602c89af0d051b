"""Every effect of the catalogue: complete, with the right slopes, like its twin in the plant, sized for any plant."""

from __future__ import annotations

import dataclasses
import importlib
import math
import pkgutil
import subprocess
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rw_ekf.effects
from rw_ekf.compiled import Kernel
from rw_ekf.diagnosis.hypotheses.other_starts import has_laws
from rw_ekf.drivers.sim.plant_effects import EFFECTS
from rw_ekf.drivers.sim.plant_parameters import PlantParameters, PlantState
from rw_ekf.drivers.sim.plant_terms import (
    coulomb_shift,
    drag,
    dry_friction,
    external_acceleration,
    motor_acceleration,
    ripple_acceleration,
    spike_acceleration,
)
from rw_ekf.effects import catalogue
from rw_ekf.effects.catalogue import CATALOGUE, CONTRACT_IDS, FORMULAS, MACHINERY
from rw_ekf.effects.measures import dry_scale
from rw_ekf.effects.periodic import PeriodicEffect
from rw_ekf.effects.speed_quantisation import SpeedQuantisation
from rw_ekf.effects.stribeck_shape import StribeckShape
from rw_ekf.errors import ConfigError
from rw_ekf.model.effect import NO_SHAPE, Candidate, Effect, RecordFacts, Shape, Term
from rw_ekf.model.effect_kinds import (
    Contribution,
    CurrentEffect,
    DelayEffect,
    FrictionMemoryEffect,
    ReadingEffect,
    StaticEffect,
    StribeckEffect,
    WindowEffect,
)
from rw_ekf.model.friction import acceleration
from rw_ekf.model.moment import Moment
from rw_ekf.model.state import CK13_STATISTICAL, FrictionParameters
from rw_ekf.units import RAD_S_PER_RPM
from rw_ekf.wheel.equations import EQUATIONS

K, B, C, S = CK13_STATISTICAL
OMEGA_S = 4.0 * RAD_S_PER_RPM
KINDS = (
    StaticEffect, CurrentEffect, DelayEffect, WindowEffect, FrictionMemoryEffect, StribeckEffect, ReadingEffect,
)  # fmt: skip
ALL = FORMULAS
STATIC = [effect for effect in ALL if issubclass(effect, StaticEffect)]
CHANNELS = frozenset({"temperature_degC", "angle_rad"})
DRAWS = 40

WHEEL = RecordFacts(
    first_s=0.0, last_s=600.0, period_s=0.1, top_speed_rad_s=210.0, top_current_A=0.4, friction=CK13_STATISTICAL,
    stribeck_speed_rad_s=OMEGA_S, stribeck_law=0, speed_noise_rad_s=RAD_S_PER_RPM, reversals=8,
    temperature_range_K=15.0, angle=True, channels=CHANNELS,
)  # fmt: skip
# Ninety-five kilograms driven by newtons, at up to a tenth of a metre per second, read every millisecond.
CARRIAGE = RecordFacts(
    first_s=5.0, last_s=30.0, period_s=0.001, top_speed_rad_s=0.1, top_current_A=100.0,
    friction=FrictionParameters(1.0 / 95.0, 2.1, 0.21, 0.22), stribeck_speed_rad_s=0.002, stribeck_law=0,
    speed_noise_rad_s=1.0e-4, reversals=20, temperature_range_K=2.0, angle=True, channels=CHANNELS,
)  # fmt: skip
AIR_BEARING = dataclasses.replace(WHEEL, friction=FrictionParameters(0.0, 0.0, 0.0, 0.0), top_current_A=0.0)


def draw_conditions(rng: np.random.Generator, duration: float) -> Moment:
    """Somewhere in the record, away from zero speed."""
    omega = float(rng.uniform(20.0, 200.0) * rng.choice([-1.0, 1.0]))
    current = float(rng.uniform(-0.4, 0.4) * rng.choice([0.005, 1.0]))  # within a dead zone as well as beyond it
    temperature = float(rng.uniform(10.0, 35.0))
    return Moment(
        omega, current, temperature, float(rng.uniform(-50.0, 50.0)), float(rng.uniform(1.0, 599.0)), duration
    )


def draw_size(rng: np.random.Generator, effect: type[Effect]) -> tuple[float, Shape]:
    """A coefficient of moderate size, within its bounds, and one of the shapes to be tried."""
    a = effect.smallest(WHEEL) * float(rng.uniform(2.0, 30.0) * rng.choice([-1.0, 1.0]))
    a = abs(a) if effect.coefficient.lower >= 0.0 else a
    candidates = effect.candidates(WHEEL)
    shape = candidates[int(rng.integers(len(candidates)))].shape
    laws = effect.starts(Candidate(a, shape), a) if has_laws(effect.id) else []
    shape = laws[int(rng.integers(len(laws)))].shape if laws else shape
    if effect.components == 2 and rng.random() < 0.5:
        shape = (shape[0], math.pi / 2.0, shape[2])
    return a, shape


def cases(effect: type[Effect], duration: float = 0.1) -> list[tuple[float, Shape, Moment]]:
    """Seeded draws of coefficient, shape and conditions, the same for an effect whatever else is in the catalogue."""
    rng = np.random.default_rng([ord(letter) for letter in effect.id])
    return [(*draw_size(rng, effect), draw_conditions(rng, duration)) for _ in range(DRAWS)]


def force(part: Contribution, omega: float) -> float:
    """The acceleration that a contribution, made at one speed, adds at another [rad/s^2]."""
    current, external, viscous, viscous_factor, dry_factor, dry = part
    slipping = math.copysign(C * dry_factor + dry, omega)
    return K * current + external - (B * viscous_factor + viscous) * omega - slipping


def with_part(part: Contribution, at: Moment) -> float:
    """The model's acceleration with the contribution entered as effect_kinds.py says [rad/s^2]."""
    current, external, viscous, viscous_factor, dry_factor, dry = part
    level = C * dry_factor + dry
    drive = K * (at.current + current) + external
    return acceleration(at.omega, drive, B * (1.0 + viscous_factor) + viscous, C + level, S + level, OMEGA_S, 0)


def plant_with(effect: type[Effect], a: float, shape: Shape) -> PlantParameters:
    """The simulated wheel with the effect's twin, its numbers given by name."""
    fields = set(EFFECTS[effect.id].numbers)
    numbers: dict[str, Any] = {effect.coefficient.name: a}
    described = effect.described(a, 0.0, shape)
    numbers |= {c.name: described[c.name]["value"] for c in effect.constants if c.name in fields}
    return EFFECTS[effect.id](**numbers).applied_to(PlantParameters())


def plant_acceleration(p: PlantParameters, at: Moment) -> float:
    """The simulated wheel's acceleration at an instant [rad/s^2], put together as its integrator does."""
    state = PlantState(at.time, at.omega, at.angle, at.temperature, at.current)
    level = coulomb_shift(p, state) + spike_acceleration(p, at.time)
    drive = motor_acceleration(p, at.current, at.temperature, at.omega) - p.offset_rad_s2
    drive -= ripple_acceleration(p, at.angle, 0.0) + external_acceleration(p, at.time)
    return drive - drag(p, at.omega, at.temperature) - math.copysign(dry_friction(p, at.omega, level), at.omega)


def test_every_id_of_the_contract_is_there_and_new_ones_come_behind() -> None:
    """The catalogue has the 19 ids, in the order of the contract's table."""
    assert len(CONTRACT_IDS) == 19
    assert tuple(CATALOGUE)[:19] == CONTRACT_IDS
    assert list(CATALOGUE)[19:] == sorted(set(CATALOGUE) - set(CONTRACT_IDS))


def test_one_effect_one_file_one_name() -> None:
    """A file that defines an effect defines one, is called as its id is, and the class is the id in CamelCase."""
    files = {module.name for module in pkgutil.iter_modules(rw_ekf.effects.__path__)}
    assert files >= MACHINERY
    for effect_id, effect in CATALOGUE.items():
        assert effect.__module__ == f"rw_ekf.effects.{effect_id}"
        assert effect.__name__ == "".join(word.capitalize() for word in effect_id.split("_"))


def test_a_new_effect_is_one_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A file dropped into the package is found, behind the known ones; an id used twice is an error."""
    text = "from rw_ekf.effects.cubic_drag import CubicDrag\nclass Fresh(CubicDrag):\n    id = {!r}\n"
    (tmp_path / "fresh.py").write_text(text.format("a_fresh_one"))
    (tmp_path / "twice.py").write_text(text.format("offset_torque"))
    monkeypatch.setattr(rw_ekf.effects, "__path__", [*rw_ekf.effects.__path__, str(tmp_path)])
    for name in ("fresh", "twice"):
        monkeypatch.delitem(sys.modules, f"rw_ekf.effects.{name}", raising=False)
    fresh, twice, own = (
        importlib.import_module(f"rw_ekf.effects.{name}") for name in ("fresh", "twice", "offset_torque")
    )
    assert fresh in catalogue._own_modules()
    assert list(catalogue._collect([own, fresh])) == ["offset_torque", "a_fresh_one"]
    with pytest.raises(ConfigError, match="offset_torque"):
        catalogue._collect([twice, own])
    for name in ("fresh", "twice"):
        monkeypatch.delitem(sys.modules, f"rw_ekf.effects.{name}")


def test_importing_the_catalogue_is_cheap() -> None:
    """Commands that only name effects do not pay for numerical libraries."""
    code = "import sys, rw_ekf.effects.catalogue; print(sorted({'numba', 'numpy', 'scipy'} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


@pytest.mark.parametrize("effect", ALL, ids=lambda effect: effect.id)
def test_it_says_what_it_is(effect: type[Effect]) -> None:
    """Kind, docstring, equation, source, excitation, units, meanings and bounds are there."""
    assert sum(issubclass(effect, kind) for kind in KINDS) == 1
    assert effect.__doc__ not in (None, *(kind.__doc__ for kind in KINDS))
    assert effect.equation
    assert effect.source
    assert effect.excitation
    assert effect.coefficient.unit
    assert len(effect.constants) <= 3
    for number in (effect.coefficient, *effect.constants):
        assert number.meaning
        assert -math.inf < number.lower < number.upper < math.inf


@pytest.mark.parametrize("effect", ALL, ids=lambda effect: effect.id)
def test_confusions_are_mutual_and_told_apart(effect: type[Effect]) -> None:
    """What an effect can be mistaken for can be mistaken for it, and both say what separates them."""
    for other, separation in effect.confounded.items():
        assert separation
        assert effect.id in CATALOGUE[other].confounded


@pytest.mark.parametrize("effect", ALL, ids=lambda effect: effect.id)
def test_its_names_are_those_of_the_simulated_wheel(effect: type[Effect]) -> None:
    """`--effect ID:name=value` and the document use the same names; start_s, piece_s, reference_s are ours alone."""
    fields = set(EFFECTS[effect.id].numbers)
    assert {effect.coefficient.name, *(c.name for c in effect.constants)} - {
        "start_s",
        "piece_s",
        "reference_s",
    } <= fields


@pytest.mark.parametrize("facts", [WHEEL, CARRIAGE, AIR_BEARING], ids=["wheel", "carriage", "air_bearing"])
@pytest.mark.parametrize("effect", ALL, ids=lambda effect: effect.id)
def test_a_plant_of_any_size_can_be_searched_and_spoken_of(effect: type[Effect], facts: RecordFacts) -> None:
    """Sizes, starts and words are finite and within bounds, even for a plant with no friction at all."""
    assert 0.0 < effect.smallest(facts) < math.inf
    if effect.untestable(facts) is None:
        assert effect.candidates(facts)
        assert effect.smallest(facts) <= effect.coefficient.upper
    for start, shape in effect.candidates(facts)[:5000:7]:
        assert effect.coefficient.lower <= start <= effect.coefficient.upper
        for constant, number in zip(effect.constants, shape, strict=False):
            assert constant.lower <= number <= constant.upper
        sentence = effect.sentence(effect.smallest(facts), 0.1 * effect.smallest(facts), shape, facts)
        assert sentence[0].isupper()
        assert not sentence.endswith(".")
        assert "nan" not in sentence
        assert effect.described(1.0, 0.1, shape)[effect.coefficient.name]["unit"] == effect.coefficient.unit


@pytest.mark.parametrize("facts", [WHEEL, CARRIAGE], ids=["wheel", "carriage"])
@pytest.mark.parametrize("effect", [e for e in STATIC if e.id in CONTRACT_IDS], ids=lambda effect: effect.id)
def test_the_smallest_size_is_half_to_one_percent_of_coulomb_friction(
    effect: type[StaticEffect], facts: RecordFacts
) -> None:
    """At top speed, top current, the warmest sample, the onset or the end, whatever the plant's size.

    0.3 % for an offset, which acts all the time.
    """
    k, b, c, _ = facts.friction
    least = 0.003 if effect.id == "offset_torque" else 0.005
    shape = effect.candidates(facts)[0].shape
    if effect.components == 2:
        shape = (shape[0], math.pi / 2.0, 0.0)
    time = 0.0 if effect.components == 2 else shape[0] if effect.local_in_time else facts.last_s
    warmest = 20.0 + (facts.temperature_range_K or 0.0)
    at = Moment(facts.top_speed_rad_s, facts.top_current_A, warmest, 0.0, time, 0.0)
    part = effect.contribution(effect.smallest(facts), shape, at)
    # Taken at the same speed, so that the linearised pair gives the force itself.
    added = k * part[0] + part[1] - (b * part[3] + part[2]) * facts.top_speed_rad_s - (c * part[4] + part[5])
    assert 0.98 * least < abs(added) / dry_scale(facts) < 0.0101


@pytest.mark.parametrize("effect", STATIC, ids=lambda effect: effect.id)
def test_slope_is_the_derivative(effect: type[StaticEffect]) -> None:
    """The slope by the coefficient equals a central difference of the contribution."""
    for a, shape, at in cases(effect):
        h = 1.0e-4 * abs(a)
        ahead, behind = (np.array(effect.contribution(a + e, shape, at)) for e in (h, -h))
        assert effect.slope(a, shape, at) == pytest.approx((ahead - behind) / (2.0 * h), rel=1e-8, abs=1e-12)


@pytest.mark.parametrize("effect", [e for e in STATIC if e.is_proportional()], ids=lambda effect: effect.id)
def test_a_proportional_effect_is_its_slope(effect: type[StaticEffect]) -> None:
    """What has no slope of its own contributes its coefficient times that of one, at zero coefficient nothing."""
    assert effect.linear
    for a, shape, at in cases(effect):
        unit = effect.slope(a, shape, at)
        assert effect.contribution(a, shape, at) == pytest.approx([a * x for x in unit], rel=1e-13)
        assert not any(effect.contribution(0.0, shape, at))


@pytest.mark.parametrize("effect", STATIC, ids=lambda effect: effect.id)
def test_the_contribution_is_the_tangent_of_the_force(effect: type[StaticEffect]) -> None:
    """A contribution made at one speed is right at another but for a term of second order: half as far, a quarter."""

    def error(a: float, shape: Shape, at: Moment, away: float) -> float:
        there = at._replace(omega=at.omega + away)
        here_part, there_part = (effect.contribution(a, shape, where) for where in (at, there))
        return abs(force(here_part, there.omega) - force(there_part, there.omega))

    for a, shape, at in cases(effect, duration=0.0):
        far, near = error(a, shape, at, 0.5), error(a, shape, at, 0.25)
        assert near <= 0.3 * far + 1e-12


@pytest.mark.parametrize("effect", [e for e in STATIC if e.id in EFFECTS], ids=lambda effect: effect.id)
def test_the_simulated_wheel_agrees(effect: type[StaticEffect]) -> None:
    """Model and contribution give the acceleration of the simulated wheel with the effect's twin, at any instant."""
    moved = 0.0
    for a, shape, at in cases(effect, duration=0.0):
        found = with_part(effect.contribution(a, shape, at), at)
        assert found == pytest.approx(plant_acceleration(plant_with(effect, a, shape), at), rel=1e-11, abs=1e-12)
        moved = max(moved, abs(found - acceleration(at.omega, K * at.current, B, C, S, OMEGA_S, 0)))
    assert moved > 1.0e-3


@pytest.mark.parametrize("effect_id", ["torque_ripple", "drag_spike", "external_torque"])
def test_over_a_piece_it_is_the_mean(effect_id: str) -> None:
    """What changes within a piece contributes its mean over it: the simulated wheel's instants, averaged."""
    effect = CATALOGUE[effect_id]
    assert issubclass(effect, StaticEffect)
    instants = (np.arange(4000) + 0.5) / 4000 - 0.5
    for i, (a, shape, drawn) in enumerate(cases(effect, duration=0.4)):
        # A spike's onset is put into every third piece.
        at = drawn._replace(time=shape[0] + 0.1) if effect.local_in_time and i % 3 == 0 else drawn
        if effect_id == "external_torque":
            shape = (shape[0] % 3.0, *shape[1:])  # noqa: PLW2901 -- keep the average below resolvable
        p = plant_with(effect, a, shape)
        middle = at.angle + 0.5 * at.omega * at.duration
        along = [
            at._replace(time=at.time + x * at.duration, angle=middle + at.omega * x * at.duration) for x in instants
        ]
        mean = sum(plant_acceleration(p, instant) for instant in along) / len(along)
        expected = with_part(effect.contribution(a, shape, at), at)
        assert expected == pytest.approx(mean, abs=2e-3 * abs(a))


def test_an_onset_within_a_piece_counts_from_the_onset_on() -> None:
    """Before the onset nothing, across it the share of the piece that is left, after it the decay."""
    spike = CATALOGUE["drag_spike"]
    assert issubclass(spike, StaticEffect)

    def dry(time: float) -> float:
        return spike.contribution(0.05, (100.0, 60.0, 0.0), Moment(50.0, 0.0, 20.0, 0.0, time, 0.1))[5]

    assert dry(99.94) == 0.0
    assert dry(99.975) == pytest.approx(0.05 * 0.25, rel=1e-3)
    assert dry(160.0) == pytest.approx(0.05 / math.e, rel=1e-3)
    assert dry(1.0e9) == pytest.approx(0.0, abs=1e-100)


def test_drift_before_its_start_is_none() -> None:
    """A model used on a record that begins earlier must neither overflow nor extrapolate."""
    drift = CATALOGUE["coulomb_drift"]
    assert issubclass(drift, StaticEffect)
    for tau in (0.0, 300.0):
        assert drift.contribution(1.0e-3, (tau, 1.0e9, 0.0), Moment(50.0, 0.0, 20.0, 0.0, 0.0, 0.1))[5] == 0.0


@pytest.mark.parametrize("current", [-0.1, 0.0, 0.1])
def test_at_rest_the_current_says_which_way(current: float) -> None:
    """A wheel at rest has the viscous friction of the direction in which its current would move it."""
    asymmetry = CATALOGUE["viscous_asymmetry"]
    assert issubclass(asymmetry, StaticEffect)
    part = asymmetry.contribution(2e-4, NO_SHAPE, Moment(0.0, current, 20.0, 0.0, 0.0, 0.1))
    assert part == (0.0, 0.0, 2e-4 * float(np.sign(current)), 0.0, 0.0, 0.0)


@pytest.mark.slow
@pytest.mark.parametrize("effect", STATIC, ids=lambda effect: effect.id)
def test_compiled_and_plain_are_bitwise_equal(effect: type[StaticEffect]) -> None:
    """An effect's functions are compiled as they are, and give the same numbers to the last bit."""
    nothing = Moment(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)

    def kernel(function: Callable[..., Any]) -> Kernel:
        example = (0.0, NO_SHAPE, nothing)
        return Kernel(function, [*EQUATIONS], lambda: example, effect.id, result=(0.0,) * 6)

    compiled = kernel(effect.contribution)
    for a, shape, at in cases(effect):
        assert compiled(a, shape, at) == effect.contribution(a, shape, at)
        if effect.is_proportional():  # its slope is no function of its own
            assert compiled(1.0, shape, at) == effect.slope(a, shape, at)
    if not effect.is_proportional():
        compiled = kernel(effect.slope)
        for a, shape, at in cases(effect):
            assert compiled(a, shape, at) == effect.slope(a, shape, at)


@pytest.mark.parametrize("law", [0, 1, 2])
def test_another_stribeck_curve_is_the_simulated_wheels(law: int) -> None:
    """Speed and law of `stribeck_shape` give the friction of the simulated wheel with that shape."""
    rng = np.random.default_rng([7, law])
    name = str(StribeckShape.described(1.0, 0.1, (float(law), 0.0, 0.0))["law"]["value"])
    for _ in range(DRAWS):
        speed, omega = float(rng.uniform(0.1, 3.0)), float(rng.uniform(-4.0, 4.0))
        p = EFFECTS["stribeck_shape"](speed_rad_s=speed, law=name).applied_to(PlantParameters())
        expected = plant_acceleration(p, Moment(omega, 0.05, 20.0, 0.0, 0.0, 0.0))
        assert acceleration(omega, K * 0.05, B, C, S, speed, law) == pytest.approx(expected, rel=1e-12)


def test_quantisation_noise_is_that_of_rounded_readings() -> None:
    """Readings rounded to the grid have the variance that the effect adds to that of the noise."""
    rng = np.random.default_rng(11)
    grid, noise = 5.0 * RAD_S_PER_RPM, RAD_S_PER_RPM
    truth = rng.uniform(-100.0, 100.0, 200_000)
    read = grid * np.round((truth + noise * rng.standard_normal(truth.size)) / grid)
    assert np.var(read - truth) == pytest.approx(noise**2 + SpeedQuantisation.variance(grid), rel=0.01)


def sample_pair(
    mean: Sequence[float], covariance: Sequence[Sequence[float]], phase: float
) -> tuple[float, float, float, float]:
    """Mean and standard deviation of amplitude and phase of drawn pairs."""
    drawn = np.random.default_rng(5).multivariate_normal(mean, covariance, 100_000)
    turned = np.arctan2(drawn[:, 1], drawn[:, 0]) + phase
    length = np.hypot(drawn[:, 0], drawn[:, 1])
    return float(length.mean()), float(length.std()), float(turned.mean()), float(turned.std())


@pytest.mark.parametrize("effect", [e for e in STATIC if e.components == 2], ids=lambda effect: effect.id)
def test_a_pair_is_told_as_amplitude_and_phase(effect: type[StaticEffect]) -> None:
    """Sine and cosine add up to the sine described, and its sigmas are those of drawn pairs."""
    assert issubclass(effect, PeriodicEffect)
    sine, cosine, covariance = 0.03, 0.04, [[1.0e-6, 4.0e-7], [4.0e-7, 2.0e-6]]
    shape = (2.0, 0.3, 0.0)
    quarter = effect.component_shape(shape, 1)
    found = Term(effect, (sine, cosine), (0.0, 0.0), shape).described(covariance)
    amplitude, phase = found[effect.coefficient.name], found["phase_rad"]
    values = [amplitude["value"], amplitude["std"], phase["value"], phase["std"]]
    assert values == pytest.approx(sample_pair((sine, cosine), covariance, 0.3), rel=0.02)
    assert isinstance(amplitude["value"], float)
    assert isinstance(phase["value"], float)
    for _, _, at in cases(effect):
        both = effect.contribution(sine, shape, at)[1] + effect.contribution(cosine, quarter, at)[1]
        one = effect.contribution(amplitude["value"], (2.0, phase["value"], 0.0), at)[1]
        assert one == pytest.approx(both, abs=1e-14)
    assert "%" in Term(effect, (sine, cosine), (0.0, 0.0), shape).sentence(covariance, WHEEL)
    assert Term.of(effect, shape).described(covariance)["phase_rad"]["std"] is None


UNTESTABLE = [
    ("offset_torque", {"reversals": 0}, "reversal"),
    ("viscous_asymmetry", {"reversals": 0}, "reversal"),
    ("stribeck_shape", {"reversals": 0}, "reversal"),
    ("viscous_temperature", {"channels": frozenset()}, "not logged"),
    ("coulomb_temperature", {"temperature_range_K": 0.4}, "1 K"),
    ("motor_gain_temperature", {"temperature_range_K": None}, "1 K"),
    ("motor_gain_temperature", {"top_current_A": 0.0}, "current"),
    ("motor_saturation", {"top_current_A": 0.0}, "current"),
    ("current_deadzone", {"top_current_A": 0.0}, "current"),
    ("transport_delay", {"top_current_A": 0.0}, "current"),
    ("speed_averaging", {"top_current_A": 0.0}, "current"),
    ("torque_ripple", {"angle": False}, "angle"),
    ("torque_ripple", {"period_s": 1.0, "top_speed_rad_s": 1.0e4}, "slower turning"),
    ("external_torque", {"last_s": 1.0}, "samples"),
    ("drag_spike", {"last_s": 1.0}, "longer"),
]


@pytest.mark.parametrize(("effect_id", "changes", "reason"), UNTESTABLE)
def test_a_log_that_cannot_show_it_is_told_so(effect_id: str, changes: dict[str, object], reason: str) -> None:
    """What a record lacks is named; the same record with it can be judged."""
    effect = CATALOGUE[effect_id]
    assert effect.untestable(WHEEL) is None
    assert reason in (effect.untestable(dataclasses.replace(WHEEL, **changes)) or "")  # type: ignore[arg-type]


def test_the_search_stays_within_bounds_over_long_records() -> None:
    """A day at 10 Hz has hardly more candidates than ten minutes, and no gap that a spike falls through."""
    day = dataclasses.replace(WHEEL, last_s=86_400.0)
    for facts in (WHEEL, day, CARRIAGE):
        frequencies = [shape[0] for _, shape in CATALOGUE["external_torque"].candidates(facts)]
        spacing = 0.5 / facts.duration_s
        assert frequencies[0] == pytest.approx(3.0 * spacing)
        assert frequencies[-1] == pytest.approx(0.5 / facts.period_s, rel=0.01)
        assert len(frequencies) <= 1500
        assert np.max(np.diff(frequencies[:1200])) == pytest.approx(spacing)
        spikes = CATALOGUE["drag_spike"].candidates(facts)
        onsets = sorted({shape[0] for _, shape in spikes})
        assert len(spikes) <= 1200
        assert facts.first_s < onsets[0]
        assert onsets[-1] < facts.last_s
        assert np.max(np.diff(onsets)) <= 2.0 * min(shape[1] for _, shape in spikes) + 1e-9


@pytest.mark.parametrize(("speed", "width"), [(6.3, 1.6), (20.0, 5.0), (60.0, 8.0), (150.0, 30.0)])
def test_a_bump_has_a_place_near_it_wherever_it_is(speed: float, width: float) -> None:
    """Within a width of its speed, and within the square root of two of its width, slow and narrow ones as well."""
    near = [
        shape
        for _, shape in CATALOGUE["drag_bump"].candidates(WHEEL)
        if abs(shape[0] - speed) <= width and 0.7 <= shape[1] / width <= 1.43
    ]
    assert near


SENTENCES = [
    ("viscous_temperature", -0.03, 0.001, "Viscous friction falls 3.00 +- 0.10 % per K"),
    ("current_deadzone", 0.002, 0.0003, "Currents below 2.0 +- 0.3 mA make no torque, and stronger ones lose as much"),
    ("transport_delay", 0.052, 0.002, "Commands act 52 +- 2 ms later than the log says (0.52 sample periods)"),
    ("transport_delay", 0.052, 0.002, "or readings are as much older than their time stamps: to a log these are one"),
    ("speed_averaging", 0.1, 0.004, "Speed readings are means over 100 +- 4 ms before their time stamps (1 sample"),
    ("offset_torque", 0.03, 0.001, "5.12 +- 0.17 % of Coulomb friction slows forward and helps backward motion"),
    ("offset_torque", 0.03, 0.001, "1.97 +- 0.07 mA below its command"),
    ("quadratic_drag", 1e-6, 1e-7, "by 7.5 +- 0.8 % of Coulomb friction at top speed"),
]


@pytest.mark.parametrize(("effect_id", "value", "std", "words"), SENTENCES)
def test_it_speaks_in_numbers_a_person_can_act_on(effect_id: str, value: float, std: float, words: str) -> None:
    """Sentences carry the size in the unit that a person thinks in, with the digits that mean something."""
    effect = CATALOGUE[effect_id]
    assert words in effect.sentence(value, std, effect.candidates(WHEEL)[0].shape, WHEEL)


@pytest.mark.parametrize("effect", ALL, ids=lambda effect: effect.id)
def test_the_documentation_has_its_line(effect: type[Effect]) -> None:
    """docs/effects.md has one line for it, with coefficient, unit, constants and all that it is confounded with."""
    document = (Path(__file__).parents[2] / "docs" / "effects.md").read_text(encoding="utf-8")
    (line,) = [line for line in document.splitlines() if line.startswith("|") and f" | `{effect.id}` | " in line]
    cells = [cell.strip() for cell in line.replace(r"\|", "").split(" | ")]
    assert cells[3].split(";")[0] == f"`{effect.coefficient.name}` {effect.coefficient.unit}"
    for constant in effect.constants:
        assert f"`{constant.name}`" in cells[3]
    for other in effect.confounded:
        assert other in cells[6]
