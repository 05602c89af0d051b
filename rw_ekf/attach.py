"""What a run is attached to; the only module that picks a driver: a wheel on a line, a record, a simulated wheel."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import TYPE_CHECKING, Any

from rw_ekf.clock import Clock, Slot
from rw_ekf.driver import ControlLines, WheelDriver, WheelProtocol, WireLimits
from rw_ekf.errors import ConfigError
from rw_ekf.records import IssuedCommand, WheelSample
from rw_ekf.units import rad_s_from_rpm, rpm_from_rad_s

if TYPE_CHECKING:
    from rw_ekf.arrays import Float64Array
    from rw_ekf.checking.effect_file import OwnFormula
    from rw_ekf.drivers.sim.plant_batch import PlantRun
    from rw_ekf.drivers.sim.plant_parameters import PlantParameters
    from rw_ekf.drivers.sim.simulated_wheel import SimulatedWheel
    from rw_ekf.model.state import FrictionParameters
    from rw_ekf.settings.schema import Configuration

_CAN = "can:"  # a port of these is no serial line


def load_protocol(name: str) -> WheelProtocol:
    """Wire protocol by a name from config/ or a path. Raises ConfigError with every finding."""
    from rw_ekf.checking.yaml_loader import load_yaml
    from rw_ekf.drivers.protocols import protocol_of
    from rw_ekf.settings.resources import protocol_path

    document = load_yaml(protocol_path(name))
    return protocol_of(document.data, document.where)


def spoken_by(configuration: Configuration) -> WheelProtocol:
    """What the wheel of a configuration speaks, at its address. Raises ConfigError with every finding."""
    from rw_ekf.drivers.line.register_protocol import AddressedRegisterProtocol

    protocol, address = load_protocol(configuration.wheel.protocol), configuration.wheel.address
    if address is None:
        return protocol
    if not isinstance(protocol, AddressedRegisterProtocol):
        raise ConfigError(
            f"wheel.address is {address}, but {_the_map(configuration)} is of a family without addresses: drop it"
        )
    try:
        return protocol.at(address)
    except ConfigError as error:
        raise ConfigError(f"wheel.address {error}") from None


def _the_map(configuration: Configuration) -> str:
    return f"the wire map {configuration.wheel.protocol!r}"


def beyond_wire(configuration: Configuration, wire: WireLimits) -> list[tuple[tuple[str, ...], str]]:
    """What the wire cannot carry, as (keys, finding): a limit that could never be sent or seen, a missing value."""
    found: list[tuple[tuple[str, ...], str]] = []
    the_map = _the_map(configuration)
    limits = configuration.limits

    def too_wide(key: str, unit: str, limit: float, carried: str, low: float, high: float) -> None:
        if limit > high or -limit < low:
            text = f"limits.{key} is {limit:g} {unit}, but {the_map} carries {carried} from {low:g} to {high:g} {unit}"
            found.append((("limits", key), f"{text}: lower the limit."))

    too_wide("current_A", wire.current_unit, limits.current_A, "commands", *wire.current_A)
    too_wide("speed_rpm", "rpm", limits.speed_rpm, "speeds", *(rpm_from_rad_s(v) for v in wire.speed_rad_s))
    if wire.current_unit != "A" and configuration.command.writes and "slew_A_per_s" not in limits.model_fields_set:
        text = f"limits.slew_A_per_s is not given, and its default, {limits.slew_A_per_s:g}, is meant for amperes"
        text += (
            f" per second: {the_map} commands {wire.current_unit}, which stands for A in every key that ends in _A. "
        )
        found.append((("limits",), f"{text}Give limits.slew_A_per_s in {wire.current_unit} per second."))
    found += _too_slow(configuration, wire, the_map)
    if configuration.wheel.echo and (wire.telemetry_s is not None or configuration.wheel.port.startswith(_CAN)):
        text = f"wheel.echo is true, but {configuration.wheel.port} and {the_map} are of no serial line: drop it."
        found.append((("wheel", "echo"), text))
    if not configuration.command.writes and not wire.tells_current:
        text = f"command.profile is none, but {the_map} has no current_command or current in its telemetry"
        found.append((("command", "profile"), f"{text}: without one of them it is not known what drives the wheel."))
    too_hot = f"limits.temperature_degC is {limits.temperature_degC:g} degC, but {the_map}"
    if wire.hottest_degC is None and "temperature_degC" in limits.model_fields_set:
        text = f"{too_hot} has no temperature in its telemetry, so that it could not be kept: drop the limit, or add "
        found.append((("limits", "temperature_degC"), f"{text}the register to the map."))
    if wire.hottest_degC is not None and limits.temperature_degC > wire.hottest_degC:
        text = f"{too_hot} carries temperatures up to {wire.hottest_degC:g} degC: lower the limit."
        found.append((("limits", "temperature_degC"), text))
    return found


def _too_slow(configuration: Configuration, wire: WireLimits, the_map: str) -> Iterator[tuple[tuple[str, ...], str]]:
    """What a wheel that is not asked does too seldom for the loop, or wants to be told more often."""
    loop, period_s = configuration.loop, wire.telemetry_s
    if period_s is not None and period_s * loop.rate_hz > 1.0:
        text = f"loop.rate_hz is {loop.rate_hz:g}, but telemetry of {the_map} comes every {1e3 * period_s:g} ms only"
        yield ("loop", "rate_hz"), f"{text}: give at most {1.0 / period_s:.3g}."
    if period_s is not None and configuration.command.writes and loop.reply_timeout_ms < 2e3 * period_s:
        text = f"a command is confirmed by telemetry behind it, and {the_map} has it every {1e3 * period_s:g} ms"
        if 2.0 * period_s * loop.rate_hz < 1.0:
            found = f"loop.reply_timeout_ms is {loop.reply_timeout_ms:g}: {text}: give {2e3 * period_s:g} or more."
            yield ("loop", "reply_timeout_ms"), found
        else:  # which must end within a turn
            slower = f"give less than {0.5 / period_s:.3g}, and loop.reply_timeout_ms: {2e3 * period_s:g}"
            yield ("loop", "rate_hz"), f"loop.rate_hz is {loop.rate_hz:g}: {text}, twice within a turn: {slower}."
    if wire.command_within_s is not None and configuration.command.writes:
        least_hz = 1.0 / wire.command_within_s
        if loop.rate_hz <= least_hz:
            text = f"loop.rate_hz is {loop.rate_hz:g}, but the wheel of {the_map} lets go of a current that is not "
            yield ("loop", "rate_hz"), f"{text}repeated within {1e3 / least_hz:g} ms: give more than {least_hz:g}."


def checked_protocol(configuration: Configuration) -> WheelProtocol:
    """Wire protocol of a configuration; raises ConfigError where it cannot carry what the configuration asks for."""
    protocol = spoken_by(configuration)
    found = beyond_wire(configuration, protocol.limits)
    if found:
        raise ConfigError([text for _, text in found])
    return protocol


def beyond_line(
    configurations: Sequence[Configuration], protocols: Sequence[WheelProtocol]
) -> list[tuple[int, tuple[str, ...], str]]:
    """What keeps wheels from sharing one line, as (which of them, keys, finding): they must be told apart on it."""
    from rw_ekf.drivers.line.register_protocol import AddressedRegisterProtocol

    found: list[tuple[int, tuple[str, ...], str]] = []
    of_address: dict[int, str] = {}
    own = {
        configuration.wheel.name: protocol.own_address
        for configuration, protocol in zip(configurations, protocols, strict=True)
        if isinstance(protocol, AddressedRegisterProtocol)
    }
    first: AddressedRegisterProtocol | None = None
    for index, (configuration, protocol) in enumerate(zip(configurations, protocols, strict=True)):
        name, the_map = configuration.wheel.name, _the_map(configuration)
        if not isinstance(protocol, AddressedRegisterProtocol):
            text = (
                f"wheel.protocol: {the_map} is of a family without addresses, so that {name} cannot be told from the "
            )
            found.append(
                (index, ("wheel", "protocol"), f"{text}other wheels of one line; nsp and registers have them.")
            )
            continue
        if protocol.address is None:
            text = f"wheel.address is required for {name}: it is one of several wheels on a line, and {the_map}"
            found.append((index, ("wheel", "address"), f"{text} has no framing.address."))
        elif protocol.address in of_address:
            text = f"wheel.address {protocol.address} of {name} is that of {of_address[protocol.address]} too"
            found.append((index, ("wheel", "address"), f"{text}: give each wheel the one that it is set to."))
        else:
            of_address[protocol.address] = name
        taken = [other for other in own if protocol.address is not None and own[other] == protocol.address]
        if taken and taken[0] != name:
            text = f"wheel.address {protocol.address} of {name} is this program's own to {taken[0]}"
            found.append((index, ("wheel", "address"), f"{text} (framing.own_address of its wire map): change either."))
        first = first or protocol
        if configuration.wheel.baud is None and protocol.wire_map.link.baud != first.wire_map.link.baud:
            text = f"wheel.baud: {the_map} has another baud rate ({protocol.wire_map.link.baud}) than the wheels before"
            found.append((index, ("wheel", "protocol"), f"{text}: give wheel.baud, the one of the line."))
        its, others = (
            f"{link.data_bits} data bits, parity {link.parity}, {link.stop_bits} stop bits"
            for link in (protocol.wire_map.link, first.wire_map.link)
        )
        if its != others:
            text = f"wheel.protocol: {the_map} has {its}, the wheels before {others}: they cannot be on one line"
            found.append((index, ("wheel", "protocol"), text))
    return found


def beyond_rate(
    configurations: Sequence[Configuration], protocols: Sequence[WheelProtocol]
) -> list[tuple[int, tuple[str, ...], str]]:
    """A rate at which the turns of all wheels of a line do not fit into a period, as `beyond_line` has it."""
    from rw_ekf.drivers.line.register_protocol import AddressedRegisterProtocol

    took_s = sum(
        protocol.turn_s(configuration.wheel.baud, writes=configuration.command.writes)
        for configuration, protocol in zip(configurations, protocols, strict=True)
        if isinstance(protocol, AddressedRegisterProtocol)
    )
    rate_hz = configurations[0].loop.rate_hz
    if took_s * rate_hz <= 1.0:
        return []
    text = f"loop.rate_hz is {rate_hz:g}, but the bytes of a turn of each of {len(configurations)} wheels take the line"
    most_hz = math.floor(100.0 / took_s) / 100.0
    return [(0, ("loop", "rate_hz"), f"{text} {1e3 * took_s:.3g} ms: give at most {most_hz:g}, or a faster line.")]


class SharedLine:
    """One line for several wheels, each with a slot of the loop's period in which it may be asked."""

    def __init__(
        self, configurations: Sequence[Configuration], protocols: Sequence[WheelProtocol], clock: Clock
    ) -> None:
        """Nothing is opened yet. Raises ConfigError where the wheels could not be told apart, or asked so often."""
        from rw_ekf.drivers.line.register_protocol import AddressedRegisterProtocol
        from rw_ekf.drivers.line.shared_port import SharedPort

        found = beyond_line(configurations, protocols) or beyond_rate(configurations, protocols)
        if found:
            raise ConfigError([text for _, _, text in found])
        spoken = [protocol for protocol in protocols if isinstance(protocol, AddressedRegisterProtocol)]
        period_s = 1.0 / configurations[0].loop.rate_hz
        self._clock = clock
        self._configurations = configurations
        self._port = SharedPort(spoken[0].open_port, clock, echoes=configurations[0].wheel.echo, keeps=True)
        self.slots = [Slot(clock, period_s, period_s * index / len(spoken)) for index in range(len(spoken))]
        self.protocols = [
            protocol.over(self._port.end(slot)) for protocol, slot in zip(spoken, self.slots, strict=True)
        ]

    @property
    def is_open(self) -> bool:
        """Whether the port is there, as far as is known."""
        return self._port.is_open

    def close(self) -> None:
        """Release the port."""
        self._port.fail()

    def opener(self, index: int, *, probe: bool = True) -> Callable[[WheelDriver | None], WheelDriver]:
        """What opens the line of one wheel, as `opener`; with a probe that asks once and does not wait."""
        configuration = self._configurations[index]
        return _opener(configuration, self.protocols[index], self._clock, probe=probe)


def opener(
    configuration: Configuration, protocol: WheelProtocol, clock: Clock, *, probe: bool = True, exclusive: bool = True
) -> Callable[[WheelDriver | None], WheelDriver]:
    """Return what opens the wheel's line; given the wheel that was lost, its clock and counters go on.

    probe: the first time, wait until the wheel answers. Never for a wheel that was lost: zero must reach it first, even
    where its answers do not come through. exclusive: False writes beside a process that has locked the port.
    """
    from rw_ekf.drivers.line.register_protocol import RegisterProtocol
    from rw_ekf.drivers.line.shared_port import SharedPort

    serial = protocol.limits.telemetry_s is None and not configuration.wheel.port.startswith(_CAN)
    if configuration.wheel.echo and serial and isinstance(protocol, RegisterProtocol):
        protocol = protocol.over(SharedPort(protocol.open_port, clock, echoes=True).end())
    return _opener(configuration, protocol, clock, probe=probe, exclusive=exclusive)


def _opener(
    configuration: Configuration, protocol: WheelProtocol, clock: Clock, *, probe: bool = True, exclusive: bool = True
) -> Callable[[WheelDriver | None], WheelDriver]:
    """The same over the protocol as it is."""

    def open_wheel(lost: WheelDriver | None) -> WheelDriver:
        return protocol.open_wheel(
            configuration.wheel.port,
            clock,
            1e-3 * configuration.loop.reply_timeout_ms,
            baud=configuration.wheel.baud,
            probe=probe and lost is None,
            exclusive=exclusive,
            control=ControlLines(configuration.wheel.dtr, configuration.wheel.rts),
            previous=lost,
        )

    return open_wheel


def serve_bus(
    wheels: Sequence[tuple[WheelProtocol, PlantParameters, dict[str, Any]]],
    link_path: str,
    faults: Sequence[Any] = (),
    seed: int = 0,
    baud: int | None = None,
    **options: Any,
) -> None:
    """Serve simulated wheels behind one pseudo-terminal until a signal, as `WheelProtocol.serve` one.

    wheels: what each speaks, its truth, and its options (seed, noise, faults, ...). faults: of the line; baud: its
    speed, None: the wire map's. Raises DriverError where the link cannot be made.
    """
    from rw_ekf.drivers.line.register_protocol import AddressedRegisterProtocol
    from rw_ekf.drivers.sim.bus_electronics import BusElectronics
    from rw_ekf.drivers.sim.faults import FaultInjector
    from rw_ekf.drivers.sim.pty_server import serve_electronics

    made = [
        protocol.simulated(plant, **own)
        for protocol, plant, own in wheels
        if isinstance(protocol, AddressedRegisterProtocol)
    ]
    serve_electronics(BusElectronics(made, FaultInjector(faults, seed), baud), link_path, **options)


def replay_wheel(rows: Iterable[tuple[WheelSample, IssuedCommand]], name: str) -> WheelDriver:
    """Return a logged run as a wheel."""
    from rw_ekf.drivers.replay_wheel import ReplayWheel

    return ReplayWheel(rows, name)


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
