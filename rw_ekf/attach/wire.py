"""What a wheel speaks, and whether its wire, or a line that several share, carries what a configuration requires."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

from rw_ekf.driver import WheelProtocol, WireLimits
from rw_ekf.errors import ConfigError, DriverError
from rw_ekf.units import rpm_from_rad_s

if TYPE_CHECKING:
    from rw_ekf.settings.schema import Configuration


CAN_PORT = "can:"  # a port of these is no serial line


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
    found += [(("wheel", "port"), text) for text in _no_bus(configuration.wheel.port, wire, the_map)]
    if configuration.wheel.echo and (wire.telemetry_s is not None or configuration.wheel.port.startswith(CAN_PORT)):
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


def _no_bus(port: str, wire: WireLimits, the_map: str) -> Iterator[str]:
    """What is wrong with a port that is a CAN bus by its name: else a run would refuse it, again at every start."""
    if not port.startswith(CAN_PORT):
        return
    from rw_ekf.drivers.can.can_bus import SERIAL_INTERFACE, CanPort

    try:
        interface = CanPort.of(port).interface
    except DriverError:
        yield f"wheel.port is {port}, which names no CAN bus: write can:socketcan:can0, or can:slcan:/dev/ttyACM0."
        return
    if wire.telemetry_s is None:
        yield f"wheel.port is {port}, a CAN bus, but {the_map} is for a serial line: give the wheel's own map of a bus."
    if interface == SERIAL_INTERFACE:  # python-can has no part in it
        return
    try:
        from can.interfaces import VALID_INTERFACES
    except ImportError:  # which opening says, with what to install
        return
    if interface not in VALID_INTERFACES:
        known = ", ".join(sorted(VALID_INTERFACES))
        yield f"wheel.port is {port}, but python-can has no interface {interface}: one of {known}."


def _too_slow(configuration: Configuration, wire: WireLimits, the_map: str) -> Iterator[tuple[tuple[str, ...], str]]:
    """What a wheel that is not polled does too seldom for the loop, or must be commanded more often."""
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
    """Wire protocol of a configuration; raises ConfigError where it cannot carry what the configuration requires."""
    protocol = spoken_by(configuration)
    found = [text for _, text in beyond_wire(configuration, protocol.limits)]
    found = found or [text for _, _, text in beyond_rate([configuration], [protocol])]
    if found:
        raise ConfigError(found)
    return protocol


def beyond_line(
    configurations: Sequence[Configuration], protocols: Sequence[WheelProtocol]
) -> list[tuple[int, tuple[str, ...], str]]:
    """What keeps wheels from sharing one line, as (which of them, keys, finding): they must be distinguished on it."""
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
                (index, ("wheel", "protocol"), f"{text}other wheels of one line; nsp, registers and ascii have them.")
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
    """A rate at which the turns of all wheels of a line do not fit into a period, as `beyond_line` has it.

    Of one wheel alone only where its port is a serial device: a pseudo-terminal is as fast as it is polled.
    """
    from rw_ekf.drivers.line.register_protocol import AddressedRegisterProtocol

    if len(configurations) == 1 and not _is_serial_device(configurations[0].wheel.port):
        return []
    took_s = sum(
        protocol.turn_s(configuration.wheel.baud, writes=configuration.command.writes)
        for configuration, protocol in zip(configurations, protocols, strict=True)
        if isinstance(protocol, AddressedRegisterProtocol)
    )
    rate_hz = configurations[0].loop.rate_hz
    if took_s * rate_hz <= 1.0:
        return []
    turns = "a turn take" if len(configurations) == 1 else f"a turn of each of {len(configurations)} wheels take"
    most_hz = math.floor(100.0 / took_s) / 100.0
    text = f"loop.rate_hz is {rate_hz:g}, but the bytes of {turns} the line {1e3 * took_s:.3g} ms"
    return [(0, ("loop", "rate_hz"), f"{text}: give at most {most_hz:g}, or a faster line.")]


def _is_serial_device(port: str) -> bool:
    """Whether a port's name is that of a line with a baud rate of its own."""
    return port.upper().startswith("COM") or (port.startswith("/dev/") and not port.startswith("/dev/pts/"))
