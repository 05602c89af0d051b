"""A simulated wheel in time: takes commands that act later, gives noisy readings, remembers the truth."""

from __future__ import annotations

import math
import random
from collections import deque
from collections.abc import Callable

from rw_ekf.drivers.sim.plant import advance
from rw_ekf.drivers.sim.plant_parameters import QUICK_STEP_S, PlantNoise, PlantParameters, PlantState

_STRETCHES = 10  # of a reading's window

Advance = Callable[[PlantParameters, PlantState, float, float, float], PlantState]


class PlantRunner:
    """A plant with its own clock. Time only goes forward; what is random comes from `seed` alone.

    law: how it goes from one state to the next: the plain function, or the same compiled (plant_batch).
    """

    def __init__(
        self,
        parameters: PlantParameters | None = None,
        noise: PlantNoise | None = None,
        seed: int = 0,
        state: PlantState | None = None,
        fine_step_s: float = QUICK_STEP_S,
        law: Advance = advance,
    ) -> None:
        self.parameters = parameters if parameters is not None else PlantParameters()
        self.noise = noise if noise is not None else PlantNoise()
        self.state = state if state is not None else PlantState(temperature_degC=self.parameters.ambient_degC)
        self.current_A = 0.0  # commanded, in force
        self._pending: deque[tuple[float, float]] = deque()  # (from when, current)
        self._turned: deque[tuple[float, float]] = deque()  # (when, angle), back to where the reading's window begins
        self._random = random.Random(seed)
        self._fine_step_s = fine_step_s
        self._law = law

    @property
    def time_s(self) -> float:
        """The plant's clock [s]."""
        return self.state.time_s

    @property
    def speed_rad_s(self) -> float:
        """The true speed [rad/s]."""
        return self.state.speed_rad_s

    @property
    def flowing_A(self) -> float:
        """The true current in the winding [A]."""
        return self.state.winding_current_A if self.parameters.actuator_lag_s > 0.0 else self.current_A

    def command(self, current_A: float, from_s: float | None = None) -> None:
        """Command a current [A] that acts from `from_s` (default: now) plus the plant's transport delay."""
        start_s = (self.time_s if from_s is None else max(from_s, self.time_s)) + self.parameters.transport_delay_s
        while self._pending and self._pending[-1][0] >= start_s:
            self._pending.pop()
        self._pending.append((start_s, current_A))

    def clear_commands(self) -> None:
        """Forget every command: no current from now on (a wheel whose electronics restarted)."""
        self._pending.clear()
        self.current_A = 0.0

    def advance_to(self, time_s: float) -> None:
        """Let the wheel run until `time_s` [s]; a time in the past does nothing."""
        while self._pending and self._pending[0][0] <= time_s:
            switch_s, current_A = self._pending.popleft()
            self._run(switch_s)
            self.current_A = current_A
        self._run(time_s)

    def read_speed(self) -> float:
        """A reading of the speed [rad/s]: the mean over its window, noise, then the telemetry's grid."""
        reading = self._mean_speed() + self._random.gauss(0.0, self.noise.speed_rad_s)
        grid = self.parameters.speed_grid_rad_s
        return round(reading / grid) * grid if grid > 0.0 else reading

    def _mean_speed(self) -> float:
        """Over the window that ends now [rad/s]; over what there is of it where the run began within it."""
        if len(self._turned) < 2:
            return self.state.speed_rad_s
        (from_s, from_rad), (to_s, to_rad), *_ = self._turned
        opens_s = max(self.time_s - self.parameters.speed_window_s, from_s)
        from_rad += (to_rad - from_rad) * (opens_s - from_s) / (to_s - from_s)
        return (self.state.angle_rad - from_rad) / (self.time_s - opens_s)

    def _run(self, time_s: float) -> None:
        """Stretches under one current, short enough for the window of a reading to begin between them."""
        window_s = self.parameters.speed_window_s
        if window_s > 0.0:
            step_s = window_s / _STRETCHES
            while self.state.time_s + step_s < time_s:
                self._stretch(self.state.time_s + step_s)
        self._stretch(time_s)

    def _stretch(self, time_s: float) -> None:
        """One stretch under one current, then the random walks of that stretch."""
        duration_s = time_s - self.state.time_s
        if duration_s <= 0.0:
            return
        if self.parameters.speed_window_s > 0.0 and not self._turned:
            self._turned.append((self.state.time_s, self.state.angle_rad))
        state = self._law(self.parameters, self.state, self.current_A, duration_s, self._fine_step_s)
        root = math.sqrt(duration_s)
        wander = self.parameters.drift_wander_rad_s2
        if wander > 0.0:
            level = state.coulomb_wander_rad_s2 + self._random.gauss(0.0, wander * root)
            state = state._replace(coulomb_wander_rad_s2=level)
        if self.noise.process_rad_s > 0.0 and state.speed_rad_s != 0.0:
            kick = self._random.gauss(0.0, self.noise.process_rad_s * root)
            state = state._replace(speed_rad_s=state.speed_rad_s + kick)
        self.state = state._replace(time_s=time_s)
        if self.parameters.speed_window_s > 0.0:
            self._turned.append((time_s, state.angle_rad))
            while len(self._turned) > 2 and self._turned[1][0] <= time_s - self.parameters.speed_window_s:
                self._turned.popleft()
