"""A simulated wheel: its truth, itself, a record of it, and several of them behind one line."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from rw_ekf.clock import Clock
from rw_ekf.driver import WheelProtocol
from rw_ekf.units import rad_s_from_rpm

if TYPE_CHECKING:
    from rw_ekf.arrays import Float64Array
    from rw_ekf.checking.effect_file import OwnFormula
    from rw_ekf.drivers.sim.plant_batch import PlantRun
    from rw_ekf.drivers.sim.plant_parameters import PlantParameters
    from rw_ekf.drivers.sim.simulated_wheel import SimulatedWheel
    from rw_ekf.model.state import FrictionParameters
    from rw_ekf.settings.schema import Configuration


def serve_bus(
    wheels: Sequence[tuple[WheelProtocol, PlantParameters, dict[str, Any]]],
    link_path: str,
    faults: Sequence[Any],
    seed: int,
    baud: int | None,
    **options: Any,
) -> None:
    """Serve simulated wheels behind one pseudo-terminal until a signal, as `WheelProtocol.serve` one.

    wheels: what each speaks, its truth, and its options (seed, noise, faults, ...). faults: of the line; baud: its
    speed, None: the wire map's. Raises DriverError where the link cannot be made.
    """
    from rw_ekf.drivers.line.register_protocol import AddressedRegisterProtocol
    from rw_ekf.drivers.sim.faults import FaultInjector
    from rw_ekf.drivers.sim.pty_server import serve_electronics
    from rw_ekf.drivers.sim.wheel_line import BusElectronics

    made = [
        protocol.simulated(plant, **own)
        for protocol, plant, own in wheels
        if isinstance(protocol, AddressedRegisterProtocol)
    ]
    serve_electronics(BusElectronics(made, FaultInjector(faults, seed), baud), link_path, **options)


def plant_of(configuration: Configuration | None, effects: list[str]) -> PlantParameters:
    """Truth of the simulated wheel: the configuration's `simulation` and `wheel`, then effects ("ID:name=value")."""
    from rw_ekf.drivers.sim.plant_effect_text import parse_effects
    from rw_ekf.drivers.sim.plant_parameters import STRIBECK_LAWS, PlantParameters

    plant = PlantParameters()
    listed: list[str] = []
    if configuration is not None:
        truth = configuration.simulation
        plant = plant._replace(
            motor_gain=truth.motor_gain,
            viscous=truth.viscous,
            coulomb=truth.coulomb,
            static=truth.static,
            ambient_degC=truth.ambient_degC,
            stribeck_speed_rad_s=rad_s_from_rpm(configuration.wheel.stribeck_speed_rpm),
            stribeck_law=STRIBECK_LAWS[configuration.wheel.stribeck_law],
        )
        listed = list(truth.effects)
    return parse_effects([*listed, *effects], plant)


def simulated_plant(parameters: FrictionParameters, stribeck_speed_rad_s: float, effects: list[str]) -> PlantParameters:
    """Truth of a simulated wheel: its parameters, then effects ("ID:name=value")."""
    from rw_ekf.drivers.sim.plant_effect_text import parse_effects
    from rw_ekf.drivers.sim.plant_parameters import PlantParameters

    base = PlantParameters(**parameters._asdict(), stribeck_speed_rad_s=stribeck_speed_rad_s)
    return parse_effects(effects, base)


def simulated_wheel(
    plant: PlantParameters,
    clock: Clock,
    *,
    speed_noise_rad_s: float,
    torque_noise: float,
    first_speed_rad_s: float,
    **options: Any,
) -> SimulatedWheel:
    """Return a wheel in this process, on a clock, by the compiled plant; torque_noise: [rad/s per sqrt(s)]."""
    from rw_ekf.drivers.sim.plant_batch import compiled_advance
    from rw_ekf.drivers.sim.plant_parameters import PlantNoise
    from rw_ekf.drivers.sim.simulated_wheel import SimulatedWheel

    noise = PlantNoise(speed_noise_rad_s, torque_noise)
    return SimulatedWheel(
        plant, noise=noise, initial_speed_rad_s=first_speed_rad_s, clock=clock, law=compiled_advance, **options
    )


def with_own_formulas(
    effects: list[str], formulas: Sequence[OwnFormula], *, compiled: bool = False
) -> tuple[list[str], dict[str, Any], dict[str, dict[str, float]]]:
    """Effects ("ID:name=value") that are no formula, options of what runs a plant with those that are, their numbers.

    compiled: for `simulated_record`; else for a protocol that serves a wheel.
    """
    from rw_ekf.drivers.sim.plant import advance
    from rw_ekf.drivers.sim.plant_formula import split_formulas, with_formulas

    rest, own = split_formulas(effects, formulas)
    if not own:
        return rest, {}, {}
    numbers = {item.formula.id: item.numbers for item in own}
    if not compiled:
        return rest, {"law": with_formulas(advance, own)}, numbers
    from rw_ekf.drivers.sim.plant_batch import compiled_advance, run_by

    return rest, {"run": run_by(with_formulas(compiled_advance, own))}, numbers


def simulated_record(
    plant: PlantParameters,
    current_A: Float64Array,
    times_s: Float64Array,
    *,
    speed_noise_rad_s: float,
    torque_noise: float,
    seed: int,
    **options: Any,
) -> PlantRun:
    """Return a run of a simulated wheel under given currents (n,) at sample times (n,), compiled.

    options: those of `with_own_formulas`, where it has any.
    """
    from rw_ekf.drivers.sim.plant_batch import simulate_run
    from rw_ekf.drivers.sim.plant_parameters import PlantNoise

    return simulate_run(plant, current_A, times_s, PlantNoise(speed_noise_rad_s, torque_noise), seed=seed, **options)
