"""One run of one scheme: started as its registry entry says, with the controller that it is run with."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from rw_ekf.attitude_bench.bench_run import BenchRun, run_bench
from rw_ekf.attitude_bench.bench_start import start_of
from rw_ekf.attitude_bench.margins import scenario_for
from rw_ekf.attitude_bench.scenario import Scenario
from rw_ekf.control.compensation.schemes import SchemeEntry
from rw_ekf.wheel.model_file import WheelModel

if TYPE_CHECKING:
    from rw_ekf.drivers.sim.plant_parameters import PlantParameters


def run_scheme(
    entry: SchemeEntry,
    scenario: Scenario,
    noise_rpm: float,
    seed: int,
    model: WheelModel | None = None,
    *,
    plant: PlantParameters | None = None,
    parameters: Mapping[str, Any] | None = None,
) -> BenchRun:
    """Run a scheme on the wheel of a seed.

    model: what a diagnosis made of this wheel, see `start_of`. plant: a wheel in place of the one that was learned
    from. parameters: in place of the scheme's own.
    """
    start = start_of(entry, scenario, noise_rpm, seed, model)
    return run_bench(
        scenario_for(entry, scenario),
        start.plant if plant is None else plant,
        noise_rpm,
        seed,
        start.estimator,
        entry.make(start.sheet, **(parameters or {})),
        start.knowledge,
        entry.inner_rate_hz,
    )
