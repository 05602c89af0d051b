"""How long a designed motion takes to settle what a first log leaves open, beside the fixed identification profile.

    python -m tools.measure.settle [--wheels 20] [--pair lag-delay ...] [--first-seed 1]

Each wheel is drawn within 15 % of [CK13] and simulated by the plant of drivers/sim in steps of 0.2 ms. A first log of
300 s is diagnosed; then the wheel goes on, one minute later and from rest, with a motion designed for what stands, two
minutes at a time, or with `identification` from its beginning. The time is that of such motion until the explanation
that is true, and those that no motion tells from it, weighed with those that stood beside it on all logs, have a
probability of 0.95; it must not fall below that again at the next look. What has not settled by the end counts with it.
"""

from __future__ import annotations

import argparse
import statistics
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from rw_ekf.arrays import Float64Array
from rw_ekf.control.profiles import make_profile, sample_profile
from rw_ekf.course.warming import Warming, ended
from rw_ekf.diagnosis.ledger.evidence import log_evidence
from rw_ekf.diagnosis.log_diagnosis import diagnose_log
from rw_ekf.diagnosis.prepare.preparation import prepare
from rw_ekf.diagnosis.prepare.source import source_of
from rw_ekf.diagnosis.thresholds import LEAST_POSTERIOR
from rw_ekf.diagnosis.verdict.explanations import Explanation as Weighed
from rw_ekf.diagnosis.verdict.explanations import with_posteriors
from rw_ekf.drivers.sim.plant_batch import PlantRun, simulate_run
from rw_ekf.drivers.sim.plant_effect_text import parse_effects
from rw_ekf.drivers.sim.plant_parameters import PlantNoise, PlantParameters
from rw_ekf.logs.wheel_log import WheelLog
from rw_ekf.settings.schema import Configuration, LimitsSection, WheelSection
from rw_ekf.settle.motion_limits import SETTLE_S, MotionLimits, bounds_of
from rw_ekf.settle.predicted import Scene
from rw_ekf.settle.search import Design, design_motion
from rw_ekf.settle.standing_explanations import Explanation, Standing, most_probable, standing_of_document
from rw_ekf.units import RAD_S_PER_RPM

RATE_HZ, DELAY_S = 10.0, 0.010
GAP_S = 60.0  # between the first log and what follows
ENOUGH = 0.95
ROUNDS = 3
_DESIGNED = (5.0, 10.0, 15.0, 20.0, 30.0, 45.0, 60.0, 90.0, 120.0)
_FIXED = (5.0, 10.0, 15.0, 20.0, 30.0, 45.0, 60.0, 90.0, 120.0, 180.0, 240.0, 300.0, 450.0, 600.0)
_CONFIGURATION = Configuration(wheel=WheelSection(port="none"), limits=LimitsSection(current_A=0.4))


@dataclass(frozen=True)
class Pair:
    """What a first log does not tell apart: the effects by turns, and the log."""

    name: str
    truths: tuple[str, ...]
    profile: str
    noise_rpm: float


PAIRS = (
    Pair("lag-delay", ("actuator_lag:time_constant_s=0.05", "transport_delay:delay_s=0.05"), "P1", 1.0),
    Pair(
        "drift-temperature", ("coulomb_drift:rate_rad_s3=-0.00005", "coulomb_temperature:slope_1_K=-0.005"), "P1", 1.0
    ),
    Pair("bristle-friction-lag", ("presliding_hysteresis:deflection_rad=0.05", "friction_lag"), "P2", 1.0),
    Pair("offset-5rpm", ("offset_torque:torque_rad_s2=0.006", "offset_torque:torque_rad_s2=-0.006"), "P2", 5.0),
)


@dataclass(frozen=True)
class Wheel:
    """One wheel: its first log, and how it goes on."""

    number: int
    truth: str
    parameters: PlantParameters
    noise: PlantNoise
    first: WheelLog
    warmth_degC: float  # a gap after the first log

    @classmethod
    def drawn(cls, pair: Pair, number: int) -> Wheel:
        """Draw a wheel within 15 %, and record its first log."""
        draws, usual = np.random.default_rng([number, *pair.name.encode()]), PlantParameters()
        k, b, c, s = draws.uniform(0.85, 1.15, 4)
        truth = pair.truths[number % len(pair.truths)]
        plain = usual._replace(
            motor_gain=k * usual.motor_gain,
            viscous=b * usual.viscous,
            coulomb=c * usual.coulomb,
            static=max(s * usual.static, c * usual.coulomb),
        )
        parameters, noise = parse_effects([truth], plain), PlantNoise(pair.noise_rpm * RAD_S_PER_RPM)
        times, currents = map(np.array, sample_profile(make_profile(pair.profile, seed=number), RATE_HZ))
        rest = int(GAP_S * RATE_HZ)
        whole = np.arange(times.size + rest) / RATE_HZ
        run = simulate_run(
            parameters, np.concatenate((currents, np.zeros(rest))), whole, noise, seed=number, command_delay_s=DELAY_S
        )
        first = _log("first.csv", run, times.size)
        return cls(number, truth, parameters, noise, first, float(run.temperature_degC[-1]))

    @property
    def effect(self) -> str:
        """The id of what it has."""
        return self.truth.split(":", maxsplit=1)[0]

    def goes_on(self, current_A: Float64Array, number: int) -> WheelLog:
        """The log of what follows the first one, the number-th after it, from rest."""
        begin = float(self.first.time_s[-1]) + GAP_S + (SETTLE_S + GAP_S) * number
        run = simulate_run(
            self.parameters,
            current_A,
            begin + np.arange(current_A.size) / RATE_HZ,
            self.noise,
            seed=10_000 * (number + 1) + self.number,
            command_delay_s=DELAY_S,
            initial_temperature_degC=self.warmth_degC,
        )
        return _log("second.csv", run, current_A.size)


def _log(name: str, run: PlantRun, rows: int) -> WheelLog:
    return WheelLog(
        name=name,
        time_s=run.time_s[:rows].copy(),
        speed_rad_s=run.measured_speed_rad_s[:rows],
        current_A=run.current_command_A[:rows].copy(),
        drive="current_command_A",
        command_delay_s=np.full(rows, run.command_delay_s),
        segment=np.zeros(rows, dtype=np.int64),
        channels={
            "current_command_A": run.current_command_A[:rows],
            "temperature_degC": np.round(run.temperature_degC[:rows], 2),
        },
        rows_read=rows,
    )


def beginning(log: WheelLog, seconds: float) -> WheelLog:
    """The first seconds of a log."""
    rows = min(round(seconds * RATE_HZ), len(log))
    return replace(
        log,
        time_s=log.time_s[:rows],
        speed_rad_s=log.speed_rad_s[:rows],
        current_A=log.current_A[:rows],
        command_delay_s=log.command_delay_s[:rows],
        segment=log.segment[:rows],
        channels={name: values[:rows] for name, values in log.channels.items()},
        rows_read=rows,
    )


def weigh(standing: Standing, logs: Sequence[WheelLog]) -> list[Weighed]:
    """The explanations that stood, fitted to several logs together and weighed anew."""
    prepared = prepare(source_of(logs), None, None, "blocks")
    whole = prepared.base
    found = []
    for item in standing.explanations:
        fit = whole.refitted(replace(whole.model, effects=item.model.effects)) if item.effects else whole
        found.append(Weighed(item.effects, fit, log_evidence(fit, item.effects, prepared.facts)))
    return with_posteriors(found)


Effects = tuple[str, ...]


def like(effect: str, standing: Standing, design: Design) -> set[Effects]:
    """The true explanation, and those that no motion tells from it."""
    items = standing.explanations
    true = [i for i, item in enumerate(items) if item.effects == (effect,)]
    return {(effect,), *(items[j].effects for i in true for j in np.flatnonzero(design.alike[i]))}


def settled_s(
    standing: Standing, true: set[Effects], before: Sequence[WheelLog], log: WheelLog, looks: Sequence[float]
) -> float | None:
    """Time of a log [s] until it and those before have settled the truth, looked at now and then; None if not."""
    reached: float | None = None
    for seconds in looks:
        weighed = weigh(standing, [*before, beginning(log, seconds)])
        if sum(item.posterior for item in weighed if item.effects in true) < ENOUGH:
            reached = None
        elif reached is not None:
            return reached
        else:
            reached = seconds
    return reached


def design_for(scene: Scene) -> Design:
    """The motion of two minutes."""
    base = scene.standing.explanations[0].model.parameters
    found = design_motion(scene, base, bounds_of(_CONFIGURATION), MotionLimits.of(_CONFIGURATION), seed=1)
    assert found is not None
    return found


def designed(wheel: Wheel, standing: Standing, true: set[Effects], design: Design) -> float | None:
    """Time of designed motion until it is settled [s]; None if it is not within the rounds, each from rest."""
    logs = [wheel.first]
    for number in range(ROUNDS):
        log = wheel.goes_on(design.current_A, number)
        time_s = settled_s(standing, true, logs, log, _DESIGNED)
        if time_s is not None:
            return SETTLE_S * number + time_s
        logs.append(log)
        if number + 1 < ROUNDS:
            design = design_for(Scene(_standing_after(weigh(standing, logs), standing), 1.0 / RATE_HZ))
    return None


def _standing_after(weighed: Sequence[Weighed], before: Standing) -> Standing:
    """What stands on all logs so far, for the next two minutes; how they ended is read as a diagnosis reads it."""
    best = weighed[0].fit
    course = best.linearised.record.course
    end = ended(course, best.trajectory.speed, with_temperature=True)
    found = []
    for item in weighed:
        fit, known = item.fit, item.fit.model.known
        found.append(
            Explanation(
                effects=item.effects,
                posterior=max(item.posterior, LEAST_POSTERIOR),
                model=fit.model,
                covariance=fit.likelihood.covariance[:known, :known],
                variance=fit.noise.variance,
                density=fit.noise.ratio * fit.noise.variance * RATE_HZ,
            )
        )
    return replace(
        before,
        explanations=most_probable(found),
        ended_s=end["time_s"],
        temperature_degC=end["temperature_degC"],
        warming=Warming.of(end["warming"]),
    )


def fixed(wheel: Wheel, standing: Standing, true: set[Effects]) -> float | None:
    """Time of the identification profile until it is settled [s]; None if it is not by its end."""
    _, currents = sample_profile(make_profile("identification"), RATE_HZ)
    return settled_s(standing, true, [wheel.first], wheel.goes_on(np.array(currents), 0), _FIXED)


@dataclass(frozen=True)
class Outcome:
    """One wheel's times [s]; None where it did not come to it."""

    wheel: Wheel
    stood: float  # probability of the truth, and of what is like it, after the first log
    designed_s: float | None
    fixed_s: float | None


def outcome_of(pair: Pair, number: int) -> Outcome:
    """Diagnose the first log, then both ways on."""
    wheel = Wheel.drawn(pair, number)
    document = diagnose_log(wheel.first).document()
    if len(document["explanations"]) < 2:
        alone = [item["effects"] for item in document["explanations"]] == [[wheel.effect]]
        return Outcome(wheel, float(alone), None, None)
    standing = standing_of_document("first log", document)
    design = design_for(Scene(standing, 1.0 / RATE_HZ))
    true = like(wheel.effect, standing, design)
    stood = sum(item.posterior for item in standing.explanations if item.effects in true)
    if stood == 0.0 or stood >= ENOUGH:
        return Outcome(wheel, stood, None, None)
    return Outcome(wheel, stood, designed(wheel, standing, true, design), fixed(wheel, standing, true))


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0] if __doc__ else None)
    parser.add_argument("--wheels", type=int, default=20)
    parser.add_argument("--first-seed", type=int, default=1)
    parser.add_argument("--pair", nargs="*", default=[pair.name for pair in PAIRS], choices=[p.name for p in PAIRS])
    args = parser.parse_args()
    for pair in (pair for pair in PAIRS if pair.name in args.pair):
        found = []
        for number in range(args.first_seed, args.first_seed + args.wheels):
            item = outcome_of(pair, number)
            print(
                f"  {pair.name} {number} {item.wheel.effect}: {item.stood:.3f} {item.designed_s} {item.fixed_s}",
                flush=True,
            )
            found.append(item)
        print(_row(pair, found), flush=True)


def _row(pair: Pair, found: list[Outcome]) -> str:
    """One line: of the wheels that the first log left open, the median times, and how many were settled."""
    left_open = [item for item in found if 0.0 < item.stood < ENOUGH]
    lost = sum(item.stood == 0.0 for item in found)
    if not left_open:
        return f"{pair.name}: nothing left open"
    one = statistics.median(ROUNDS * SETTLE_S if item.designed_s is None else item.designed_s for item in left_open)
    other = statistics.median(600.0 if item.fixed_s is None else item.fixed_s for item in left_open)
    ours, theirs = ([getattr(item, key) for item in left_open].count(None) for key in ("designed_s", "fixed_s"))
    return (
        f"{pair.name}: {len(left_open)} of {len(found)} left open (the truth not standing in {lost}); designed "
        f"{one:.0f} s, not settled {ours}; identification {other:.0f} s, not settled {theirs}; "
        f"ratio of medians {one / other:.2f}"
    )


if __name__ == "__main__":
    main()
