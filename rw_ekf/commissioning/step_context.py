"""What every step has at hand: findings so far, the person, the clock, and the wheel for a while."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from rw_ekf.attach.wire import beyond_wire, load_protocol
from rw_ekf.clock import Clock
from rw_ekf.commissioning.dialogue import Dialogue, RefusedError
from rw_ekf.commissioning.find import identity_of
from rw_ekf.commissioning.guarded_wheel import Bench
from rw_ekf.commissioning.progress import Progress
from rw_ekf.commissioning.setting import CONFIGURATION_FILE, configuration_of
from rw_ekf.commissioning.still import Still
from rw_ekf.driver import WheelProtocol
from rw_ekf.errors import ConfigError
from rw_ekf.live.port_name import serial_ports
from rw_ekf.live.stop_signal import StopSignal
from rw_ekf.settings.schema import Configuration
from rw_ekf.units import rad_s_from_rpm


class Options(NamedTuple):
    """What was given on the command line."""

    port: str | None = None
    protocol: str | None = None
    baud: int | None = None
    current_limit_A: float | None = None
    speed_limit_rpm: float | None = None
    temperature_limit_degC: float | None = None
    speed_ratio: float | None = None  # true speed over the reading
    yes: bool = False


@dataclass
class Work:
    """One commissioning."""

    options: Options
    progress: Progress
    dialogue: Dialogue
    clock: Clock
    stop: StopSignal
    logger: Any
    protocol_of: Callable[[str], WheelProtocol] = load_protocol
    ports: Callable[[], list[str]] = field(default=serial_ports)

    def configuration(self, path: str | None = None) -> Configuration:
        """As far as it is known by now; path: of another wire map. Raises ConfigError."""
        configuration = configuration_of(self.progress)
        if path is None:
            return configuration
        wheel = configuration.wheel.model_copy(update={"protocol": path})
        return configuration.model_copy(update={"wheel": wheel})

    def spoken(self, configuration: Configuration) -> WheelProtocol:
        """What is spoken with the wheel. Raises ConfigError where a limit is beyond it."""
        protocol = self.protocol_of(configuration.wheel.protocol)
        findings = [text for _, text in beyond_wire(configuration, protocol.limits)]
        if findings:
            raise ConfigError(findings)
        return protocol

    @property
    def still(self) -> Still:
        """Readings at rest, in units of true speed."""
        still, sign = Still(**self.progress["still"]), self.progress["sign"]
        ratio = 1.0 if sign is None else sign["speed_ratio"]
        lattice = None if still.lattice_rad_s is None else ratio * still.lattice_rad_s
        return still._replace(
            noise_rad_s=ratio * still.noise_rad_s, lattice_rad_s=lattice, mean_rad_s=ratio * still.mean_rad_s
        )

    @property
    def scatter_rad_s(self) -> float:
        """Noise of a reading, as far as it is known by now."""
        known = self.progress["still"] is not None
        return self.still.noise_rad_s if known else float(self.progress["find"]["scatter_rad_s"])

    @property
    def speed_limit_rad_s(self) -> float:
        """What the wheel's true speed must not exceed."""
        return rad_s_from_rpm(self.progress["limits"]["speed_rpm"])

    @contextmanager
    def at_the_wheel(
        self, *, rate_hz: float | None = None, ceiling_rad_s: float = float("inf"), path: str | None = None
    ) -> Iterator[Bench]:
        """The wheel for one step; the time is counted. Raises RefusedError where another one answers than was found."""
        configuration = self.configuration(path)
        bench = Bench(
            configuration, self.spoken(configuration), self.clock, self.stop, self.logger.warning,
            rate_hz=rate_hz or configuration.loop.rate_hz, step_rad_s=self.scatter_rad_s, ceiling_rad_s=ceiling_rad_s,
            configuration_file=self.progress.directory / CONFIGURATION_FILE,
        )  # fmt: skip
        try:
            with bench:
                self._same(identity_of(bench.live.driver))
                yield bench
        finally:
            self.progress.spent(bench.lasted_s)

    def _same(self, identity: dict[str, Any] | None) -> None:
        known = self.progress["find"]["identity"]
        if known is None or identity is None or identity["serial_number"] == known["serial_number"]:
            return
        raise RefusedError(
            f"another wheel answers: serial number {identity['serial_number']}, and {known['serial_number']} was found "
            "before. Name another --out for it"
        )
