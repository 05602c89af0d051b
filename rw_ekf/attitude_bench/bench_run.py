"""One run on the bench: the daemon's loop, guard and estimator on a virtual clock, a simulated wheel, and the body."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from rw_ekf.arrays import Float64Array
from rw_ekf.attach.simulated import simulated_wheel
from rw_ekf.attitude_bench.attitude import AttitudePid, Axis, AxisState, FlexibleMode, Gyroscope, PidGains
from rw_ekf.attitude_bench.bench_wheels import aged
from rw_ekf.attitude_bench.scenario import Scenario
from rw_ekf.clock import VirtualClock
from rw_ekf.control.compensation.scheme import CompensatedController, Compensation, Knowledge
from rw_ekf.filter.estimator import Estimator
from rw_ekf.live.guard import SafetyLimits
from rw_ekf.live.live_wheel import LiveWheel, Place
from rw_ekf.live.loop import run_loop
from rw_ekf.live.stop_signal import StopSignal
from rw_ekf.records import Tick
from rw_ekf.units import rad_s_from_rpm

if TYPE_CHECKING:
    from rw_ekf.drivers.sim.plant_parameters import PlantParameters
    from rw_ekf.drivers.sim.simulated_wheel import SimulatedWheel

_AGES_EVERY_S = 5.0
_LOOKED_AT_S = 0.01  # how often a slow wheel is looked at, for the time that it stands
_SLOW_RAD_S = rad_s_from_rpm(20.0)
_DEGREE = math.pi / 180.0


@dataclass(eq=False, frozen=True)
class BenchRun:
    """What one run came to; arrays (n,), at each reading; truth but for what is named otherwise. It settles until 0."""

    time_s: Float64Array
    attitude_rad: Float64Array
    wheel_rad_s: Float64Array
    request_rad_s2: Float64Array  # by the attitude controller
    current_A: Float64Array  # commanded after the reading
    stood_s: float  # how long the wheel stood still
    body_inertia_kg_m2: float = 0.5

    @property
    def reversal_s(self) -> float | None:
        """When the wheel's speed first reached zero or changed its sign; None: never."""
        turned = np.flatnonzero(self.wheel_rad_s * self.wheel_rad_s[0] <= 0.0)
        return float(self.time_s[turned[0]]) if turned.size else None


class Bench:
    """Body, gyroscope and attitude controller around one wheel: a request for the loop, and a sink that records."""

    def __init__(self, scenario: Scenario, wheel: SimulatedWheel, clock: VirtualClock, seed: int) -> None:
        self._scenario = scenario
        self._wheel = wheel
        self._clock = clock
        body, gyro, control = scenario.body, scenario.gyro, scenario.control
        self._axis = Axis(
            body.inertia_kg_m2, scenario.wheel.inertia_kg_m2, body.disturbance_Nm, wheel.truth.speed_rad_s
        )
        self._mode = (
            None
            if body.flexible_hz is None
            else FlexibleMode(body.flexible_hz, body.flexible_damping, body.flexible_gain)
        )
        self._gyro = Gyroscope(gyro.rate_noise_deg_s * _DEGREE, gyro.walk_deg_per_sqrt_h * _DEGREE / 60.0, seed)
        gains = PidGains(
            control.proportional_Nm_rad,
            scenario.derivative_Nms_rad,
            control.integral_Nm_rad_s,
            control.settling_integral_Nm_rad_s,
        )
        self._began_s = -control.settling_s
        self._pid = AttitudePid(gains, scenario.wheel.inertia_kg_m2)
        self._period_s = 1.0 / scenario.cycle.rate_hz
        self._wanted_s = -math.inf
        self._request_rad_s2 = 0.0
        self._rows: list[tuple[float, float, float, float]] = []
        self._currents: list[float] = []
        self._stood_s = 0.0
        if self._mode is not None:
            assert body.flexible_hz is not None
            self._mode_step_s = min(0.01, 0.05 / body.flexible_hz)
            clock.at(self._mode_step_s, self._bend)

    def request(self, tick: Tick) -> float:
        """The wheel's acceleration [rad/s^2] that attitude control requests; a new one at its own rate only."""
        now_s = tick.sample.time_s
        truth = self._truth(now_s)
        if now_s - self._wanted_s >= 0.999 * self._period_s:
            self._wanted_s = now_s
            self._request_rad_s2 = self._pid.request_rad_s2(now_s + self._began_s, self._gyro.read(now_s, truth))
        wheel = self._wheel.truth
        self._rows.append((now_s + self._began_s, truth.attitude_rad, wheel.speed_rad_s, self._request_rad_s2))
        if abs(wheel.speed_rad_s) < _SLOW_RAD_S:
            steps = round(self._period_s / _LOOKED_AT_S)
            for i in range(1, steps + 1):
                self._clock.at(now_s + i * _LOOKED_AT_S, self._look)
        return self._request_rad_s2

    def write(self, tick: Tick) -> None:
        """Note what was commanded (as a sink of the loop)."""
        if tick.fresh and len(self._currents) < len(self._rows):
            self._currents.append(math.nan if tick.command is None else tick.command.current_A)

    def close(self) -> None:
        """Nothing is left open (as a sink of the loop)."""

    def result(self) -> BenchRun:
        """What was recorded."""
        rows = np.array(self._rows[: len(self._currents)])
        time_s, attitude, wheel, request = rows.T
        return BenchRun(
            time_s,
            attitude,
            wheel,
            request,
            np.array(self._currents),
            self._stood_s,
            self._scenario.body.inertia_kg_m2,
        )

    def _rigid(self, now_s: float) -> AxisState:
        wheel = self._wheel.truth.state
        return self._axis.at(now_s, wheel.speed_rad_s, wheel.angle_rad)

    def _truth(self, now_s: float) -> AxisState:
        axis = self._rigid(now_s)
        if self._mode is None:
            return axis
        return AxisState(axis.attitude_rad + self._mode.deflection_rad, axis.rate_rad_s + self._mode.deflection_rad_s)

    def _look(self) -> None:
        self._wheel.truth.advance_to(self._clock.monotonic())
        if self._wheel.truth.speed_rad_s == 0.0:
            self._stood_s += _LOOKED_AT_S

    def _bend(self) -> None:
        assert self._mode is not None
        now_s = self._clock.monotonic()
        self._wheel.truth.advance_to(now_s)
        self._mode.step(self._rigid(now_s).rate_rad_s, self._mode_step_s)
        self._clock.at(now_s + self._mode_step_s, self._bend)


def run_bench(
    scenario: Scenario,
    plant: PlantParameters,
    noise_rpm: float,
    seed: int,
    estimator: Estimator,
    compensation: Compensation,
    knowledge: Knowledge,
    inner_rate_hz: float | None = None,
) -> BenchRun:
    """Run one compensation on one wheel. Time is virtual; what is random comes from the seed alone.

    inner_rate_hz: of a loop in the wheel's electronics, which acts a tenth of its period late; the attitude controller
    keeps the scenario's rate.
    """
    cycle = scenario.cycle
    rate_hz = cycle.rate_hz if inner_rate_hz is None else inner_rate_hz
    delay_s = cycle.command_delay_s if inner_rate_hz is None else 0.1 / inner_rate_hz
    clock = VirtualClock()
    wheel = simulated_wheel(
        plant,
        clock,
        rate_hz=rate_hz,
        command_delay_s=delay_s,
        speed_noise_rad_s=rad_s_from_rpm(noise_rpm),
        torque_noise=rad_s_from_rpm(scenario.wheel.torque_noise_rpm_per_sqrt_s),
        seed=seed,
        first_speed_rad_s=scenario.first_speed_rad_s,
    )
    bench = Bench(scenario, wheel, clock, 1_000_000 + seed)
    if scenario.wheel.age_percent != 0.0:
        _let_age(scenario, wheel, plant, clock)
    limits = SafetyLimits(cycle.current_A, cycle.slew_A_per_s, rad_s_from_rpm(1e5), 500.0, 10.0)
    with StopSignal() as stop:
        live = LiveWheel(
            Place(lambda lost: wheel), limits, rate_hz, stop, clock, speed_step_rad_s=rad_s_from_rpm(noise_rpm)
        )
        controller = CompensatedController(bench.request, compensation, knowledge)
        run_loop(live.readings(lambda: scenario.lasts_s), estimator, partial(live.issue, controller), [bench])
    return bench.result()


def _let_age(scenario: Scenario, wheel: SimulatedWheel, plant: PlantParameters, clock: VirtualClock) -> None:
    """Change the wheel's parameters a little every few seconds."""
    duration_s = scenario.lasts_s

    def at(share: float) -> Callable[[], None]:
        def change() -> None:
            wheel.truth.advance_to(clock.monotonic())
            wheel.truth.parameters = aged(plant, scenario.wheel.age_percent, share)

        return change

    for i in range(1, int(duration_s / _AGES_EVERY_S) + 1):
        clock.at(i * _AGES_EVERY_S, at(i * _AGES_EVERY_S / duration_s))
