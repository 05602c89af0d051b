"""A simulated wheel in this process, by a clock or a period a read: as fast as that allows, the same every time."""

from __future__ import annotations

import math
from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

from rw_ekf.clock import Clock
from rw_ekf.driver import WheelDriver, WireLimits
from rw_ekf.drivers.sim.plant import advance
from rw_ekf.drivers.sim.plant_parameters import QUICK_STEP_S, PlantNoise, PlantParameters, PlantState
from rw_ekf.drivers.sim.plant_runner import Advance, PlantRunner
from rw_ekf.errors import DriverError
from rw_ekf.records import IssuedCommand, LinkCounters, WheelIdentity, WheelSample


class SimulatedWheel:
    """A WheelDriver over a plant. Each read() lets one sample period pass; a command acts command_delay_s after it.

    With a clock the wheel's time is that clock's, and a read takes command_delay_s of it, as a line would.
    `truth` is the plant itself (true speed, parameters, state), for tests and benches only. While `silent`, the wheel
    takes commands and nothing comes back; while `unplugged`, its line fails.
    speed_step_rad_s: resolution of a reading (0: none), e.g. 0.5 rpm as on the wire.
    """

    def __init__(
        self,
        parameters: PlantParameters | None = None,
        *,
        rate_hz: float = 10.0,
        command_delay_s: float = 0.010,
        noise: PlantNoise | None = None,
        seed: int = 0,
        initial_speed_rad_s: float = 0.0,
        speed_step_rad_s: float = 0.0,
        clock: Clock | None = None,
        fine_step_s: float = QUICK_STEP_S,
        law: Advance = advance,
    ) -> None:
        if not rate_hz > 0.0 or not command_delay_s >= 0.0:
            raise ValueError(f"rate_hz {rate_hz} must be above 0 and command_delay_s {command_delay_s} not below 0")
        parameters = parameters if parameters is not None else PlantParameters()
        state = PlantState(speed_rad_s=initial_speed_rad_s, temperature_degC=parameters.ambient_degC)
        self.source = "sim+in-process"
        self.link = LinkCounters()
        self.identity: WheelIdentity | None = WheelIdentity(
            kind=6, version=1, serial_number=seed & 0xFFFF, uptime_s=0.0
        )
        self.truth = PlantRunner(parameters, noise, seed, state, fine_step_s, law)
        self._rate_hz = rate_hz
        self._delay_s = command_delay_s
        self._speed_step_rad_s = speed_step_rad_s
        self._reads = 0
        self._closed = False
        self._clock = clock
        self._began_s = clock.monotonic() if clock is not None else 0.0
        self._read_s = 0.0
        self.silent = self.unplugged = False

    def read(self, timeout_s: float) -> WheelSample | None:
        """The sample one period after the last one (the first at time 0), at once; with a clock, the one of now."""
        self._check_open()
        self.link.requests += 1
        if self._clock is not None and self.silent:
            self._clock.sleep(timeout_s)
            self.link.timeouts += 1
            return None
        if self._clock is None:
            self.truth.advance_to(self._reads / self._rate_hz)
        else:
            self._read_s = self._clock.monotonic() - self._began_s
            self.truth.advance_to(self._read_s)
        self._reads += 1
        sample = WheelSample(
            time_s=self.truth.time_s,
            speed_rad_s=_on_grid(self.truth.read_speed(), self._speed_step_rad_s),
            current_A=self.truth.flowing_A,
            current_command_A=self.truth.current_A,
            temperature_degC=self.truth.state.temperature_degC,
            angle_rad=self.truth.state.angle_rad,
            status=0,
        )
        if self._clock is not None:
            self._clock.sleep(self._delay_s)
        return sample

    def command_current(self, current_A: float) -> IssuedCommand:
        """Command a current [A]; it acts command_delay_s after the last sample."""
        self._check_open()
        if not math.isfinite(current_A):
            raise DriverError(f"{self.source}: a current of {current_A} A cannot be commanded; it must be finite")
        if self._clock is None:
            self.truth.command(current_A, self.truth.time_s + self._delay_s)
            return IssuedCommand(current_A, self._delay_s)
        now_s = self._clock.monotonic() - self._began_s
        self.truth.command(current_A, now_s)
        self.truth.advance_to(now_s)
        return IssuedCommand(current_A, now_s - self._read_s, not self.silent, "timeout" if self.silent else None)

    def stop_current(self, by: str | None = None) -> IssuedCommand:
        """Command zero."""
        return self.command_current(0.0)

    def open_again(self) -> None:
        """Be opened after its line was lost. Raises DriverError while there is none."""
        self._closed = False
        self._check_open()
        self.link.reconnects += 1

    def close(self) -> None:
        """End the simulation; a wheel that is no longer driven keeps its last current."""
        self._closed = True

    def _check_open(self) -> None:
        if self.unplugged:
            raise DriverError(f"{self.source}: its line is gone")
        if self._closed:
            raise DriverError(f"{self.source} is closed; open it again before use")


class SimulatedProtocol:
    """A WheelProtocol to one wheel in this process, whatever the port's name."""

    limits = WireLimits((-1.0, 1.0), (-1.0e3, 1.0e3), hottest_degC=500.0)
    scale_places: Mapping[str, str] = MappingProxyType({})
    fingerprint: str | None = "simulated in this process"

    def __init__(self, wheel: SimulatedWheel) -> None:
        self.wheel = wheel

    def open_wheel(self, port: str, clock: Clock, reply_timeout_s: float, **how: Any) -> WheelDriver:
        """Give the wheel, again where it was lost. Raises DriverError while its line is gone."""
        if how.get("previous") is not None:
            self.wheel.open_again()
        return self.wheel

    def serve(self, plant: Any, link_path: str, **options: Any) -> None:
        """Nobody serves it: it is in this process."""
        raise DriverError(f"{link_path}: a wheel simulated in this process has no line")


def _on_grid(value: float, step: float) -> float:
    """Rounded to a multiple of `step`, where there is one."""
    return round(value / step) * step if step > 0.0 else value
