"""An air-bearing table and its wheel, and attitude control that asks the wheel's daemon for torques over its socket.

The wheel is simulated in this process, behind a tty of its own, because the table feels the wheel itself and not what a
daemon believes of it: conservation of momentum, from the true speed and angle. A gyroscope and the PID of [CK13] 4 ask
for torques. Real time: one turn of the daemon, one of the controller.
"""

from __future__ import annotations

import contextlib
import json
import math
import socket
import threading
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from rw_ekf.attitude_bench.attitude import AttitudePid, Axis, Gyroscope, PidGains
from rw_ekf.attitude_bench.scenario import Scenario
from rw_ekf.checking.yaml_loader import load_yaml
from rw_ekf.drivers.line.wire_map import wire_map_from_mapping
from rw_ekf.drivers.sim.plant_effect_text import parse_effects
from rw_ekf.drivers.sim.plant_parameters import PlantNoise, PlantParameters, PlantState
from rw_ekf.drivers.sim.plant_runner import PlantRunner
from rw_ekf.drivers.sim.pty_server import PtyServer
from rw_ekf.drivers.sim.register_server import RegisterServer
from rw_ekf.settings.resources import protocol_path
from rw_ekf.units import rad_s_from_rpm, rpm_from_rad_s
from tools.demo.wheel import Lot

OUTPUT = Path("demo-output")
SETTLES_S = 26.0  # the integral finds fan and friction, by a larger gain
CROSSES_S = 12.0  # after that, where the attitude is held
LASTS_S = 32.0  # the largest error comes at 28
_SETTLING_GAIN_NM_RAD_S = 0.008
_STEADY_S = 3.5  # compensation is on, and faded in
_HOLD_NM_PER_RPM = 3.0e-4  # of the wheel, before the table is let go
_NEAR_RPM = 12.0
_PATIENCE_S = 60.0


@dataclass
class Crossing:
    """A reversal of the wheel under the table, as it truly was; times since the integral has settled [s]."""

    time_s: list[float] = field(default_factory=list)
    attitude_deg: list[float] = field(default_factory=list)
    speed_rpm: list[float] = field(default_factory=list)

    @property
    def peak_deg(self) -> float:
        """The largest attitude error, from when the integral has settled."""
        late = zip(self.time_s, self.attitude_deg, strict=True)
        return max((abs(attitude) for time_s, attitude in late if time_s >= 0.0), default=math.nan)

    @property
    def crossed(self) -> bool:
        """Whether the wheel did reverse."""
        return bool(self.speed_rpm) and self.speed_rpm[-1] * self.speed_rpm[0] < 0.0


class Table:
    """Table, gyroscope and attitude control around one wheel; asked once a turn."""

    def __init__(self, wheel: PlantRunner, seed: int) -> None:
        self._wheel = wheel
        scenario = Scenario()
        body, control, gyro = scenario.body, scenario.control, scenario.gyro
        self._wheel_inertia = scenario.wheel.inertia_kg_m2
        self._body = body
        gains = PidGains(
            control.proportional_Nm_rad,
            scenario.derivative_Nms_rad,
            control.integral_Nm_rad_s,
            _SETTLING_GAIN_NM_RAD_S,
        )
        self._pid = AttitudePid(gains, self._wheel_inertia)
        degree = math.radians(1.0)
        self._gyro = Gyroscope(gyro.rate_noise_deg_s * degree, gyro.walk_deg_per_sqrt_h * degree / 60.0, seed)
        self._axis: Axis | None = None
        self._free = wheel.state  # when the table was let go
        self.crossing = Crossing()

    def torque_Nm(self) -> float:
        """The torque on the wheel that keeps the attitude; the table is let go with the first call."""
        now = self._wheel.state
        if self._axis is None:
            inertia, disturbance = self._body.inertia_kg_m2, self._body.disturbance_Nm
            self._axis = Axis(inertia, self._wheel_inertia, disturbance, now.speed_rad_s)
            self._free = now
        since_s = now.time_s - self._free.time_s
        truth = self._axis.at(since_s, now.speed_rad_s, now.angle_rad - self._free.angle_rad)
        self.crossing.time_s.append(since_s - SETTLES_S)
        self.crossing.attitude_deg.append(math.degrees(truth.attitude_rad))
        self.crossing.speed_rpm.append(rpm_from_rad_s(now.speed_rad_s))
        read = self._gyro.read(since_s, truth)
        return self._wheel_inertia * self._pid.request_rad_s2(since_s - SETTLES_S, read)


def first_rpm() -> float:
    """The wheel's speed when the table is let go: the fan's momentum takes it through zero at CROSSES_S."""
    scenario = Scenario()
    rate_rad_s2 = -scenario.body.disturbance_Nm / scenario.wheel.inertia_kg_m2
    return rpm_from_rad_s(rate_rad_s2 * (SETTLES_S + CROSSES_S))


@contextlib.contextmanager
def wheel_of_table(lot: Lot, link: Path) -> Iterator[PlantRunner]:
    """Serve the lot's wheel at a tty, in real time, by a thread, for the length of a with block; it turns already."""
    state = PlantState(speed_rad_s=rad_s_from_rpm(first_rpm()))
    plant = parse_effects([lot.effect_text], PlantParameters(**lot.parameters))
    runner = PlantRunner(plant, PlantNoise(rad_s_from_rpm(1.0)), lot.seed, state)
    document = load_yaml(protocol_path("sunspace-wheel"))
    wire_map = wire_map_from_mapping(document.data, document.where)
    serial_number = lot.seed % 65_536 % 65_535 + 1  # as `rw-ekf simulate` numbers it: the models are this wheel's
    server = PtyServer(RegisterServer(wire_map, runner, serial_number=serial_number), link)
    over = threading.Event()
    thread = threading.Thread(target=server.run, args=(over.is_set,), daemon=True)
    thread.start()
    try:
        yield runner
    finally:
        over.set()
        thread.join()
        server.close()


def cross(wheel: PlantRunner, path: Path, seed: int) -> Crossing:
    """Connect to the daemon's socket, hold the wheel at its first speed, let the table go, and reverse.

    Raises SystemExit where the daemon is not there, compensates nothing within a minute, or ends.
    """
    table, hold = Table(wheel, seed), _Hold(first_rpm())
    with contextlib.suppress(OSError), _connected(path) as daemon:
        for line in daemon.makefile():
            turn: dict[str, Any] = json.loads(line)
            torque_Nm = table.torque_Nm() if hold.over else hold.torque_Nm(turn)
            if table.crossing.time_s and table.crossing.time_s[-1] >= LASTS_S:
                return table.crossing
            daemon.sendall(json.dumps({"torque_Nm": torque_Nm}).encode() + b"\n")
    raise SystemExit(f"{path}: the daemon ended before the wheel had reversed; its log stands in {OUTPUT}")


class _Hold:
    """Keeps the wheel at a speed until the compensation has been faded in."""

    def __init__(self, speed_rpm: float) -> None:
        self._speed_rpm = speed_rpm
        self._first_s: float | None = None
        self._steady_since_s: float | None = None
        self.over = False

    def torque_Nm(self, turn: dict[str, Any]) -> float:
        """The torque after a turn. Raises SystemExit where the compensation does not come."""
        now_s, off_rpm = turn["time_s"], self._speed_rpm - turn["speed_rpm"]
        self._first_s = now_s if self._first_s is None else self._first_s
        if not (turn["compensating"] and abs(off_rpm) < _NEAR_RPM):
            self._steady_since_s = None
        elif self._steady_since_s is None:
            self._steady_since_s = now_s
        self.over = self._steady_since_s is not None and now_s - self._steady_since_s >= _STEADY_S
        if not self.over and now_s - self._first_s > _PATIENCE_S:
            raise SystemExit(f"the daemon is {turn['state']} and did not begin to compensate within a minute")
        return _HOLD_NM_PER_RPM * float(off_rpm)


def _connected(path: Path) -> socket.socket:
    end_s = time.monotonic() + _PATIENCE_S
    while True:
        daemon = socket.socket(socket.AF_UNIX)
        daemon.settimeout(_PATIENCE_S)
        try:
            daemon.connect(str(path))
            daemon.sendall(b'{"torque_Nm": 0.0}\n')
            return daemon
        except OSError:
            daemon.close()
            if time.monotonic() > end_s:
                raise SystemExit(f"{path}: no daemon listens there") from None
            time.sleep(0.1)
