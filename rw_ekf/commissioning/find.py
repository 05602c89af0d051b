"""Which port, wire map and baud a wheel answers on: by reads alone, one candidate after another.

A family whose wheel has to be started by a write (StartedByWrite) is read without it; a boot loader that answers is a
finding of its own, and is started only once somebody has agreed.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from rw_ekf.attach.wire import load_protocol
from rw_ekf.checking.yaml_loader import load_yaml
from rw_ekf.clock import Clock
from rw_ekf.commissioning.dialogue import Dialogue, RefusedError, Stopped
from rw_ekf.driver import StartedByWrite, WheelDriver, WheelProtocol
from rw_ekf.errors import DriverError, NotStartedError
from rw_ekf.live.port_claim import PortClaim
from rw_ekf.live.stop_signal import StopSignal
from rw_ekf.records import WheelSample
from rw_ekf.settings.resources import available_resources, config_resource
from rw_ekf.units import rad_s_from_rpm, rpm_from_rad_s

USUAL_BAUDS = (9600, 19200, 38400, 57600, 115200, 230400, 460800, 921600)
REPLY_TIMEOUT_S = 0.08  # twice what the shipped maps say: behind an adapter that holds replies back for 16 ms too
_READS = 3  # of which one must be answered
_READ_S = 0.3
_LOOKS = 30  # samples that show what readings are worth before anything is written
_FASTEST_RAD_S = rad_s_from_rpm(1.0e5)  # no wheel's rotor holds together beyond
_HOTTEST_DEGC, _COLDEST_DEGC = 200.0, -100.0


@dataclass(frozen=True)
class Found:
    """A wheel that answered."""

    port: str
    protocol: str  # name or path of the wire map
    baud: int | None  # None: the map's own
    sample: WheelSample
    identity: dict[str, Any] | None
    reply_ms: float | None  # beyond the bytes' own time
    read_ms: float  # a whole sample, however many replies it takes
    scatter_rad_s: float  # of readings, as one differs from the next
    started: bool = False  # its program, by the write that was agreed to

    @property
    def answered(self) -> int:
        """How many quantities it reported: of two maps that fit, the one that says more is the wheel's."""
        sample = self.sample
        reported = (sample.current_A, sample.current_command_A, sample.temperature_degC, sample.bus_voltage_V)
        return sum(value is not None for value in (*reported, sample.angle_rad, sample.pressure_Pa))

    def document(self) -> dict[str, Any]:
        """As commission.json has it."""
        sample = self.sample
        return {
            "port": self.port,
            "protocol": self.protocol,
            "baud": self.baud,
            "identity": self.identity,
            "started": self.started,
            "telemetry": {
                "speed_rpm": None if sample.speed_rad_s is None else rpm_from_rad_s(sample.speed_rad_s),
                "current_A": sample.current_A,
                "temperature_degC": sample.temperature_degC,
                "bus_voltage_V": sample.bus_voltage_V,
            },
            "reply_ms": self.reply_ms,
            "read_ms": self.read_ms,
            "scatter_rad_s": self.scatter_rad_s,
        }

    def text(self) -> str:
        """For a person."""
        who = "" if self.identity is None else f", serial number {self.identity.get('serial_number')}"
        reported = ", ".join(
            f"{name.rpartition('_')[0]} {value:.4g} {name.rpartition('_')[2]}"
            for name, value in self.document()["telemetry"].items()
            if value is not None
        )
        baud = "its own baud" if self.baud is None else f"{self.baud} baud"
        return f"{self.port} answers through {self.protocol} at {baud}{who}; {reported}"


def shipped_maps() -> list[str]:
    """Names of the wire maps that come with the program."""
    names = []
    for name in available_resources():
        data = load_yaml(config_resource(name)).data
        if isinstance(data, dict) and ("registers" in data or "family" in data):
            names.append(name)
    return names


class Search:
    """Goes through ports, maps and bauds, and keeps what was tried."""

    def __init__(
        self, clock: Clock, stop: StopSignal, protocol_of: Callable[[str], WheelProtocol] = load_protocol
    ) -> None:
        self._clock = clock
        self._stop = stop
        self._protocol_of = protocol_of
        self.tried: list[str] = []
        self.heard = False  # whether a port could be used

    def answers(self, port: str, names: Sequence[str], bauds: Sequence[int | None]) -> list[Found]:
        """Every map that the port answers through, at the first baud where one does. A boot loader counts last."""
        waiting: tuple[str, int | None] | None = None
        try:
            with PortClaim(port, self._clock):
                for baud in bauds:
                    found = []
                    for name in names:
                        try:
                            answer = self._ask(port, name, baud)
                        except NotStartedError:
                            waiting = waiting or (name, baud)
                            continue
                        found += [] if answer is None else [answer]
                    if found:
                        return found
                self.heard = True
                self.tried.append(f"{port}: no valid reply through {', '.join(names)} at {_words(bauds)}")
        except DriverError as error:
            self.tried.append(str(error).rstrip("."))
        if waiting is not None:
            raise _Waiting(port, *waiting)
        return []

    def start(self, port: str, name: str, baud: int | None) -> Found | None:
        """Start the wheel's program, by a write to its boot loader, and ask again."""
        with PortClaim(port, self._clock):
            return self._ask(port, name, baud, starts=True)

    def _ask(self, port: str, name: str, baud: int | None, *, starts: bool = False) -> Found | None:
        """What a wheel says through a map. Raises DriverError where the port cannot be used."""
        if self._stop.requested is not None:
            raise Stopped
        protocol = self._protocol_of(name)
        if isinstance(protocol, StartedByWrite) and not starts:
            protocol = protocol.reading_only()
        wheel = protocol.open_wheel(port, self._clock, REPLY_TIMEOUT_S, baud=baud, probe=starts)
        try:
            sample = next((taken for taken in _samples(wheel) if is_plausible(taken)), None)
            if sample is None:
                return None
        finally:
            wheel.close()
        known = protocol.open_wheel(port, self._clock, REPLY_TIMEOUT_S, baud=baud)  # queries its identity as well
        try:
            read_ms, scatter = _looked_at(known, self._clock)
            return Found(port, name, baud, sample, identity_of(known), known.link.reply_ms, read_ms, scatter, starts)
        finally:
            known.close()


class _Waiting(Exception):  # noqa: N818 - an outcome
    """A boot loader answers."""

    def __init__(self, port: str, name: str, baud: int | None) -> None:
        super().__init__(port)
        self.port, self.name, self.baud = port, name, baud


def is_plausible(sample: WheelSample) -> bool:
    """Whether a wheel can be like that."""
    speed, heat = sample.speed_rad_s, sample.temperature_degC
    if speed is None or not abs(speed) < _FASTEST_RAD_S:
        return False
    if heat is not None and not _COLDEST_DEGC < heat < _HOTTEST_DEGC:
        return False
    return all(v is None or math.isfinite(v) for v in (sample.current_A, sample.bus_voltage_V, sample.pressure_Pa))


def identity_of(wheel: WheelDriver) -> dict[str, Any] | None:
    """Who answers, as commission.json has it; None where the wheel does not say."""
    who = wheel.identity
    if who is None:
        return None
    return {"serial_number": who.serial_number, "kind": who.kind, "version": who.version}


def find_wheel(
    search: Search,
    ports: Sequence[str],
    names: Sequence[str],
    bauds: Sequence[int | None],
    dialogue: Dialogue,
    may_start: Callable[[str], bool],
) -> Found:
    """The wheel that is meant. may_start: asks whether a boot loader may be commanded to start the wheel's program.

    Raises RefusedError with what was tried where none answers, or where several do and nobody can say which.
    """
    found: list[Found] = []
    waiting: list[_Waiting] = []
    for port in ports:
        try:
            found += _best(search.answers(port, names, bauds))
        except _Waiting as boot:
            waiting.append(boot)
    for loader in waiting if not found else ():
        place = f"{loader.port}: a boot loader answers through {loader.name}"
        if not may_start(f"{place}. Start the wheel's program? It moves nothing"):
            raise RefusedError(f"{place}: what starts the program is a write: agree to it, or give --yes")
        found += _started(search, loader, names)
    if not found:
        tried = "; ".join(search.tried) or "there is no serial port on this machine"
        if search.tried and not search.heard:
            raise RefusedError(f"no port could be used: {tried}")
        raise RefusedError(
            f"no wheel answers. Tried: {tried}. Give --port, --protocol with the wheel's wire map, or --baud"
        )
    if len(found) == 1:
        return found[0]
    number = dialogue.choose("several answers; which one is the wheel?", [one.text() for one in found])
    if number is None:
        raise RefusedError("several answers, give --port and --protocol: " + "; ".join(one.text() for one in found))
    return found[number]


def _started(search: Search, boot: _Waiting, names: Iterable[str]) -> list[Found]:
    """What answers once it was started: maps of other generations have other start addresses."""
    for name in (boot.name, *(name for name in names if name != boot.name)):
        try:
            answer = search.start(boot.port, name, boot.baud)
        except DriverError as error:
            search.tried.append(str(error))
            continue
        if answer is not None:
            return [answer]
    return []


def _best(found: list[Found]) -> list[Found]:
    most = max((one.answered for one in found), default=0)
    return [one for one in found if one.answered == most]


def _samples(wheel: WheelDriver) -> Iterator[WheelSample]:
    for _ in range(_READS):
        sample = wheel.read(_READ_S)
        if sample is not None:
            yield sample


def _looked_at(wheel: WheelDriver, clock: Clock) -> tuple[float, float]:
    """How long a sample takes [ms], and how far readings one after another differ, over the square root of two."""
    speeds: list[float] = []
    took_ms: list[float] = []
    for _ in range(_LOOKS):
        began_s = clock.monotonic()
        sample = wheel.read(_READ_S)
        if sample is not None and sample.speed_rad_s is not None:
            took_ms.append(1e3 * (clock.monotonic() - began_s))
            speeds.append(sample.speed_rad_s)
    steps = [now - last for last, now in itertools.pairwise(speeds)]
    scatter = math.sqrt(0.5 * sum(step * step for step in steps) / len(steps)) if steps else 0.0
    return max(took_ms, default=0.0), scatter


def _words(bauds: Sequence[int | None]) -> str:
    return ", ".join("the map's baud" if baud is None else str(baud) for baud in bauds)
