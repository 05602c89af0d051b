"""A simulated wheel in this process, on a virtual clock: as fast as the processor allows, the same every time."""

from __future__ import annotations

import math

from drivers.sim.plant_parameters import PlantNoise, PlantParameters, PlantState
from drivers.sim.plant_runner import PlantRunner
from rw_ekf.errors import DriverError
from rw_ekf.records import IssuedCommand, LinkCounters, WheelIdentity, WheelSample


class SimulatedWheel:
    """A WheelDriver over a plant. Each read() lets one sample period pass; a command acts command_delay_s after it.

    `truth` is the plant itself (true speed, parameters, state), for tests and benches only.
    speed_step_rad_s, current_step_A: resolution of the telemetry (0: none), e.g. 0.5 rpm and 0.1 mA as on the wire.
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
        current_step_A: float = 0.0,
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
        self.truth = PlantRunner(parameters, noise, seed, state)
        self._rate_hz = rate_hz
        self._delay_s = command_delay_s
        self._speed_step_rad_s = speed_step_rad_s
        self._current_step_A = current_step_A
        self._reads = 0
        self._closed = False

    def read(self, timeout_s: float) -> WheelSample | None:
        """The sample one period after the last one (the first at time 0), at once."""
        self._check_open()
        self.link.requests += 1
        self.truth.advance_to(self._reads / self._rate_hz)
        self._reads += 1
        return WheelSample(
            time_s=self.truth.time_s,
            speed_rad_s=_on_grid(self.truth.read_speed(), self._speed_step_rad_s),
            current_A=_on_grid(self._current_A, self._current_step_A),
            current_command_A=self.truth.current_A,
            temperature_degC=self.truth.state.temperature_degC,
            angle_rad=self.truth.state.angle_rad,
            status=0,
        )

    def command_current(self, current_A: float) -> IssuedCommand:
        """Command a current [A]; it acts command_delay_s after the last sample."""
        self._check_open()
        if not math.isfinite(current_A):
            raise DriverError(f"{self.source}: a current of {current_A} A cannot be commanded; it must be finite")
        current_A = _on_grid(current_A, self._current_step_A)
        self.truth.command(current_A, self.truth.time_s + self._delay_s)
        return IssuedCommand(current_A, self._delay_s)

    def close(self) -> None:
        """End the simulation; a wheel that is no longer driven keeps its last current."""
        self._closed = True

    @property
    def _current_A(self) -> float:
        """The true current in the winding [A]."""
        lags = self.truth.parameters.actuator_lag_s > 0.0
        return self.truth.state.winding_current_A if lags else self.truth.current_A

    def _check_open(self) -> None:
        if self._closed:
            raise DriverError(f"{self.source} is closed; open it again before use")


def _on_grid(value: float, step: float) -> float:
    """Rounded to a multiple of `step`, where there is one."""
    return round(value / step) * step if step > 0.0 else value
