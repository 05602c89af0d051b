"""The only module that picks a driver: a wheel on a line, a logged run, a simulated wheel."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING

from rw_ekf.errors import ConfigError
from rw_ekf.records import Clock, IssuedCommand, WheelDriver, WheelSample
from rw_ekf.units import rad_s_from_rpm, rpm_from_rad_s

if TYPE_CHECKING:
    from drivers.line.wire_map import WireMap
    from drivers.sim.plant_parameters import PlantParameters
    from rw_ekf.settings.schema import Configuration


def load_wire_map(protocol: str) -> WireMap:
    """Wire map by a name from config/ or a path. Raises ConfigError with every finding."""
    from drivers.line.wire_map import wire_map_from_mapping
    from rw_ekf.settings.resources import protocol_path
    from rw_ekf.settings.yaml_loader import load_yaml

    document = load_yaml(protocol_path(protocol))
    return wire_map_from_mapping(document.data, document.where)


def scale_places(protocol: str) -> dict[str, str]:
    """Where in the wire map the scales of speed and current stand: "speed" and "current" to file:line and register."""
    from drivers.line.wire_map import wire_map_from_mapping
    from rw_ekf.settings.resources import protocol_path
    from rw_ekf.settings.yaml_loader import load_yaml

    document = load_yaml(protocol_path(protocol))
    wire_map = wire_map_from_mapping(document.data, document.where)
    places = {}
    for word, register, name in (
        ("speed", wire_map.speed_register, "speed"),
        ("current", wire_map.current_command, wire_map.current_command.fields[0].name),
    ):
        at = wire_map.registers.index(register)
        field = [f.name for f in register.fields].index(name)
        place = document.where(("registers", at, "fields", field, "scale")).rsplit(":", 1)[0]
        places[word] = f"{place} (scale of {name} in register {register.name})"
    return places


def beyond_wire(configuration: Configuration, wire_map: WireMap) -> list[tuple[tuple[str, ...], str]]:
    """What the wire map cannot carry, as (keys, finding): a limit that could never be sent or seen, a missing value."""
    found: list[tuple[tuple[str, ...], str]] = []
    name = configuration.wheel.protocol
    low_A, high_A = wire_map.current_range_A
    limit_A = configuration.limits.current_A
    if limit_A > high_A or -limit_A < low_A:
        text = f"limits.current_A is {limit_A:g} A, but the wire map {name!r} carries commands"
        found.append((("limits", "current_A"), f"{text} from {low_A:g} to {high_A:g} A: lower the limit."))
    low, high = (rpm_from_rad_s(v) for v in wire_map.speed_range_rad_s)
    limit_rpm = configuration.limits.speed_rpm
    if limit_rpm > high or -limit_rpm < low:
        text = f"limits.speed_rpm is {limit_rpm:g} rpm, but the wire map {name!r} carries speeds"
        found.append((("limits", "speed_rpm"), f"{text} from {low:g} to {high:g} rpm: lower the limit."))
    told = {field.name for register in wire_map.readable() for field in register.fields}
    if configuration.command.profile == "none" and not told & {"current_command", "current"}:
        text = f"command.profile is none, but the wire map {name!r} has no current_command or current in its telemetry"
        found.append((("command", "profile"), f"{text}: without one of them it is not known what drives the wheel."))
    temperatures = [f for register in wire_map.readable() for f in register.fields if f.name == "temperature"]
    hottest = max((field.si_range[1] for field in temperatures), default=None)
    limit_degC = configuration.limits.temperature_degC
    if hottest is None and "temperature_degC" in configuration.limits.model_fields_set:
        text = f"limits.temperature_degC is {limit_degC:g} degC, but the wire map {name!r} has no temperature in its"
        text += " telemetry, so that it could not be kept: drop the limit, or add the register to the map."
        found.append((("limits", "temperature_degC"), text))
    if hottest is not None and limit_degC > hottest:
        text = f"limits.temperature_degC is {limit_degC:g} degC, but the wire map {name!r} carries temperatures"
        found.append((("limits", "temperature_degC"), f"{text} up to {hottest:g} degC: lower the limit."))
    return found


def check_wire(configuration: Configuration) -> WireMap:
    """Wire map of a configuration; raises ConfigError where it cannot carry what the configuration asks for."""
    wire_map = load_wire_map(configuration.wheel.protocol)
    found = beyond_wire(configuration, wire_map)
    if found:
        raise ConfigError([text for _, text in found])
    return wire_map


def serial_opener(
    configuration: Configuration, wire_map: WireMap, clock: Clock, *, probe: bool = True, exclusive: bool = True
) -> Callable[[WheelDriver | None], WheelDriver]:
    """Return what opens the wheel's line; given the wheel that was lost, its clock and counters go on.

    probe: the first time, wait until the wheel answers. Never for a wheel that was lost: zero must reach it first, even
    where its answers do not come through. exclusive: False writes beside a process that has locked the port.
    """
    from drivers.line.serial_wheel import SerialWheel, open_serial_wheel

    def open_wheel(lost: WheelDriver | None) -> WheelDriver:
        return open_serial_wheel(
            configuration.wheel.port,
            wire_map,
            clock,
            1e-3 * configuration.loop.reply_timeout_ms,
            baud=configuration.wheel.baud,
            probe=probe and lost is None,
            previous=lost if isinstance(lost, SerialWheel) else None,
            exclusive=exclusive,
        )

    return open_wheel


def replay_wheel(rows: Iterable[tuple[WheelSample, IssuedCommand]], name: str) -> WheelDriver:
    """Return a logged run as a wheel."""
    from drivers.replay_wheel import ReplayWheel

    return ReplayWheel(rows, name)


def plant_of(configuration: Configuration | None, effects: list[str]) -> PlantParameters:
    """Truth of the simulated wheel: the configuration's `simulation` and `wheel`, then effects ("ID:name=value")."""
    from drivers.sim.plant_effect_text import parse_effects
    from drivers.sim.plant_parameters import STRIBECK_LAWS, PlantParameters

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
