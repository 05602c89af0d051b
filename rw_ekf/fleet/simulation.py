"""A fleet that nobody has: wheels that differ, age, feel the seasons, have spikes and fail; one log a wheel and day.

Everything is drawn from the seed and the wheel's number, so that a fleet of more wheels or days begins with the same
ones. What was drawn stands in `truth.json` beside the logs.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from datetime import date, timedelta
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from rw_ekf.arrays import Float64Array
from rw_ekf.errors import BadInputError
from rw_ekf.fleet.executors import executor_of
from rw_ekf.json_output import json_text
from rw_ekf.logs.atomic import make_folder, write_text
from rw_ekf.model.state import CK13_STATISTICAL
from rw_ekf.units import rad_s_from_rpm

if TYPE_CHECKING:
    from rw_ekf.drivers.sim.plant_parameters import PlantParameters

SCHEMA = "rw_ekf.fleet_simulation/1"
FIRST_DAY = date(2026, 1, 1)
PROFILE = "identification"  # ten minutes that show all four parameters
_DAYS_PER_MONTH, _DAYS_PER_YEAR = 365.25 / 12.0, 365.25
_DAYS_A_TASK = 50
# How wheels of one design differ [1 sigma, relative]: chosen near what [CK13] and [F12] report of like wheels.
_SPREAD = {"motor_gain": 0.02, "viscous": 0.10, "coulomb": 0.08}
_EXCESS = (0.02, 0.06)  # of break-away over Coulomb friction, relative
_SEASON_K = 8.0  # amplitude of the ambient temperature over a year
_WEATHER_K = 1.0  # from day to day [1 sigma]
_THINS_1_K, _COULOMB_1_K = -0.02, -0.003  # of viscous and Coulomb friction per kelvin: oils and greases of bearings
_WANDER = 0.003  # of the frictions from day to day about their course, relative [1 sigma]
_SPIKE_SHARE, _SPIKE_DECAY_S = (0.15, 0.6), (30.0, 300.0)  # of Coulomb friction [L17]
_STEP = (0.10, 0.30)  # of Coulomb friction at a failure, relative
_READING_RPM, _TORQUE_RPM = 1.0, 0.03  # noises, per sqrt(s) the second


@dataclass(frozen=True)
class FleetShape:
    """How large a fleet, and how much happens in it."""

    wheels: int = 20
    days: int = 30
    seed: int = 0
    ageing_share: float = 0.1  # of the wheels
    ageing_percent_per_month: float = 0.5  # of their Coulomb friction
    spikes_per_100_days: float = 2.0  # of each wheel
    failing_share: float = 0.05  # of the wheels: Coulomb friction steps up one day and stays so
    lost_share: float = 0.01  # of the days: no log
    torn_share: float = 0.0  # of the logs: the file is cut short

    def checked(self) -> FleetShape:
        """Itself. Raises BadInputError for a fleet that cannot be."""
        if not (1 <= self.wheels <= 1_000_000 and 1 <= self.days <= 36_500 and self.seed >= 0):
            raise BadInputError("a fleet has 1 to 1,000,000 wheels, 1 to 36,500 days, and a seed that is not negative")
        return self


@dataclass(frozen=True)
class WheelTruth:
    """What was drawn of one wheel."""

    wheel: str
    motor_gain: float
    viscous: float
    coulomb: float
    static: float
    ageing_percent_per_month: float
    fails_on: str | None
    step: float  # of Coulomb friction from then on, relative


def simulate_fleet(directory: str | Path, shape: FleetShape, workers: int | None) -> dict[str, Any]:
    """Write a fleet's logs as `DIR/wheel=W/DAY.parquet`; returns the document of `simulate fleet`.

    Raises BadInputError where the shape cannot be, or the place not be written.
    """
    shape.checked()
    root = Path(directory)
    make_folder(root)
    samples = logs = 0
    spans = [(first, min(first + _DAYS_A_TASK, shape.days)) for first in range(0, shape.days, _DAYS_A_TASK)]
    jobs = [(number, span) for number in range(shape.wheels) for span in spans]
    with executor_of(workers, None) as executor:
        waiting = iter(jobs)

        def submit(count: int) -> None:
            for number, span in islice(waiting, count):
                executor.submit(f"{number}-{span[0]}", write_days, (str(root.absolute()), shape, number, span))

        submit(4 * executor.cores)
        for done in executor.as_completed():
            if done.error is not None:
                raise done.error
            logs, samples = logs + done.result[0], samples + done.result[1]
            submit(1)
    truths = [asdict(truth_of(shape, number)) for number in range(shape.wheels)]
    document = {"schema": SCHEMA, "directory": str(directory), **asdict(shape), "logs": logs, "samples": samples}
    write_text(root / "truth.json", json_text({**document, "truth": truths}))
    return document


def truth_of(shape: FleetShape, number: int) -> WheelTruth:
    """Draw a wheel."""
    rng = np.random.default_rng([shape.seed, number, 0])
    base = {
        name: getattr(CK13_STATISTICAL, name) * (1.0 + share * rng.standard_normal()) for name, share in _SPREAD.items()
    }
    static = base["coulomb"] * (1.0 + rng.uniform(*_EXCESS))
    ages, fails = rng.random(2)
    day, step = rng.integers(shape.days // 4, max(3 * shape.days // 4, 1) + 1), rng.uniform(*_STEP)
    failing = fails < shape.failing_share
    return WheelTruth(
        name_of(number), **base, static=static,
        ageing_percent_per_month=shape.ageing_percent_per_month if ages < shape.ageing_share else 0.0,
        fails_on=(FIRST_DAY + timedelta(days=int(day))).isoformat() if failing else None,
        step=float(step) if failing else 0.0,
    )  # fmt: skip


def name_of(number: int) -> str:
    """W00000, W00001, ..."""
    return f"W{number:05d}"


def truth_by_day(shape: FleetShape, truth: WheelTruth, number: int) -> dict[str, Float64Array]:
    """The wheel's four parameters at 20 degC and its ambient temperature, day by day: (days,) each."""
    rng = np.random.default_rng([shape.seed, number, 1])
    days = np.arange(shape.days)
    weather = np.random.default_rng([shape.seed, 0, 2]).standard_normal(shape.days)  # the same for all
    ambient = 20.0 + _SEASON_K * np.sin(2.0 * np.pi * days / _DAYS_PER_YEAR) + _WEATHER_K * weather
    failed = (
        np.zeros(shape.days)
        if truth.fails_on is None
        else days >= (date.fromisoformat(truth.fails_on) - FIRST_DAY).days
    )
    older = (1.0 + 0.01 * truth.ageing_percent_per_month * days / _DAYS_PER_MONTH) * (1.0 + truth.step * failed)
    wander = 1.0 + _WANDER * rng.standard_normal((2, shape.days))
    return {
        "motor_gain": np.full(shape.days, truth.motor_gain),
        "viscous": truth.viscous * wander[0],
        "coulomb": truth.coulomb * older * wander[1],
        "static": truth.static * older * wander[1],
        "ambient_degC": ambient,
    }


def write_days(job: tuple[str, FleetShape, int, tuple[int, int]]) -> tuple[int, int]:
    """Simulate and write some days of a wheel; how many logs and samples they are."""
    from rw_ekf.attach.simulated import simulated_plant, simulated_record
    from rw_ekf.control.profiles import make_profile
    from rw_ekf.logs.tables import write_table

    root, shape, number, (first, end) = job
    truth = truth_of(shape, number)
    course = truth_by_day(shape, truth, number)
    law = make_profile(PROFILE, seed=shape.seed)
    times_s = np.arange(round((law.duration_s or 600.0) * 10.0)) / 10.0
    currents_A = np.array([law.current_A(float(t)) for t in times_s])
    folder = Path(root) / f"wheel={truth.wheel}"
    make_folder(folder)
    plant = simulated_plant(CK13_STATISTICAL, rad_s_from_rpm(4.0), [])
    logs = 0
    for day in range(first, end):
        rng = np.random.default_rng([shape.seed, number, 3, day])
        lost, torn, spikes = rng.random(3)
        if lost < shape.lost_share:
            continue
        run = simulated_record(
            _plant_of_day(plant, course, day, spikes < 0.01 * shape.spikes_per_100_days, float(times_s[-1]), rng),
            currents_A * rng.uniform(0.9, 1.0),  # no two days command the same
            times_s,
            speed_noise_rad_s=rad_s_from_rpm(_READING_RPM),
            torque_noise=rad_s_from_rpm(_TORQUE_RPM),
            seed=int(rng.integers(2**31)),
        )
        path = folder / f"{(FIRST_DAY + timedelta(days=day)).isoformat()}.parquet"
        columns = {"time_s": run.time_s, "speed_rad_s": run.measured_speed_rad_s}
        columns |= {"current_command_A": run.current_command_A, "temperature_degC": run.temperature_degC}
        write_table(path, columns)
        if torn < shape.torn_share:
            with path.open("r+b") as stream:
                stream.truncate(path.stat().st_size // 2)
        logs += 1
    return logs, logs * times_s.size


def _plant_of_day(
    plant: PlantParameters, course: dict[str, Float64Array], day: int, with_spike: bool, lasts_s: float,
    rng: np.random.Generator,
) -> PlantParameters:  # fmt: skip
    """The wheel as it is on a day."""
    numbers = {name: float(values[day]) for name, values in course.items()}
    if with_spike:
        numbers |= {
            "spike_rad_s2": numbers["coulomb"] * rng.uniform(*_SPIKE_SHARE),
            "spike_onset_s": rng.uniform(0.2, 0.8) * lasts_s,
            "spike_decay_s": rng.uniform(*_SPIKE_DECAY_S),
        }
    return plant._replace(
        **numbers,
        viscous_temperature_1_K=_THINS_1_K,
        viscous_temperature_law=1.0,
        coulomb_temperature_1_K=_COULOMB_1_K,
        ambient_cycle_degC=0.0,
        heating_degC_s_rad=0.0,  # within a log the wheel is as warm as the day: four parameters describe it
        heating_degC_A2=0.0,
    )
