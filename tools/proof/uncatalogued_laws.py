"""Wheels with laws that are in no catalogue, by an integrator that shares no line with the estimator.

Small explicit steps of a Karnopp wheel; the law is a plain function of what the wheel meets. Conditions (temperature,
pressure, bus voltage) go their own slow ways, so that no law of one looks like a law of time.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from rw_ekf.arrays import Float64Array
from rw_ekf.logs.wheel_log import WheelLog
from rw_ekf.model.state import CK13_STATISTICAL
from rw_ekf.units import RAD_S_PER_RPM

_STRIBECK_RAD_S = 4.0 * RAD_S_PER_RPM
_BAND_RAD_S = 1.0e-3
_STEPS = 50  # of a sample
RATE_HZ = 10.0


class Met(NamedTuple):
    """What a wheel meets at a moment."""

    omega: float  # rad/s
    current: float  # A
    angle: float  # rad
    temperature: float  # degC
    voltage: float  # V
    pressure: float  # Pa
    share: float  # of the record's time that has passed
    switched: float = 0.0  # 0 or 1, on and off at random, some seconds each
    walk: float = 0.0  # a random walk, 1 after a hundred seconds
    lagged: float = 0.0  # rad/s, the speed as it was, with a time constant of 3 s


class Made(NamedTuple):
    """What a law makes of it."""

    drag: float = 0.0  # rad/s^2, against the motion; dry: it holds a wheel at rest as well
    torque: float = 0.0  # rad/s^2, whichever way the wheel turns
    gain: float = 0.0  # relative change of the motor gain
    current: float = 0.0  # A, added to the current


Law = Callable[[Met], Made]
K, B, C, S = CK13_STATISTICAL
TOP_RAD_S, TOP_A = 150.0, 0.35


def _sign(value: float) -> float:
    return math.copysign(1.0, value) if value != 0.0 else 0.0


def _deadzone(met: Met) -> Made:
    if met.share < 0.667:
        return Made()
    return Made(current=-_sign(met.current) * min(abs(met.current), 0.01))


FAMILIES: dict[str, Law] = {  # those that an outside check names
    "gain by bus voltage": lambda m: Made(gain=0.03 * (m.voltage - 28.0) / 1.0),
    "windage by pressure": lambda m: Made(drag=0.25 * C * (m.pressure / 500.0) * (m.omega / TOP_RAD_S) ** 2),
    "load loss": lambda m: Made(drag=0.10 * C * abs(m.current) / TOP_A * 3.0),
    "brakes worse": lambda m: Made(gain=-0.05 if m.current * m.omega < 0.0 else 0.0),
    "offset begins": lambda m: Made(torque=0.05 * C if m.share > 0.667 else 0.0),
    "gain begins": lambda m: Made(gain=-0.05 if m.share > 0.667 else 0.0),
    "dead zone begins": _deadzone,
    "coulomb by speed": lambda m: Made(drag=0.10 * C * (1.0 - math.exp(-abs(m.omega) / 60.0))),
    "detent": lambda m: Made(torque=0.08 * C * math.sin(4.0 * m.angle) + 0.06 * C * math.sin(8.0 * m.angle + 1.0)),
}
LAWS: dict[str, Law] = {  # and those of one quantity each, of 3 to 10 % of Coulomb friction
    "speed, root": lambda m: Made(drag=0.10 * C * math.sqrt(abs(m.omega) / TOP_RAD_S)),
    "speed, step": lambda m: Made(drag=0.04 * C * math.tanh((abs(m.omega) - 90.0) / 15.0)),
    "speed, wave": lambda m: Made(drag=0.05 * C * math.sin(abs(m.omega) / 20.0)),
    "speed, torque": lambda m: Made(torque=0.06 * C * (abs(m.omega) / 100.0) * math.exp(1.0 - abs(m.omega) / 100.0)),
    "angle, triangle": lambda m: Made(torque=0.08 * C * (abs((m.angle / math.pi) % 2.0 - 1.0) - 0.5)),
    "angle, drag": lambda m: Made(drag=0.08 * C * max(math.cos(2.0 * m.angle), 0.0)),
    "current, square": lambda m: Made(drag=0.10 * C * (m.current / TOP_A) ** 2),
    "current, gain": lambda m: Made(gain=-0.03 * math.exp(-abs(m.current) / 0.1)),
    "current, halves": lambda m: Made(gain=0.05 if m.current < 0.0 else 0.0),  # of a bridge, one half the stronger
    "speed, gain": lambda m: Made(gain=-0.02 if m.omega < 0.0 else 0.0),
    "voltage, gain": lambda m: Made(gain=0.02 * math.tanh(2.0 * (m.voltage - 28.0))),
    "voltage, drag": lambda m: Made(drag=0.06 * C * (m.voltage - 28.0)),
    "pressure, drag": lambda m: Made(drag=0.08 * C * math.sqrt(m.pressure / 800.0)),
    "pressure, viscous": lambda m: Made(drag=0.15 * C * (m.pressure / 800.0) * abs(m.omega) / TOP_RAD_S),
}
HARD: dict[str, Law] = {  # what process noise or readings' noise would swallow
    "switched torque": lambda m: Made(torque=0.06 * C * m.switched),
    "friction walks": lambda m: Made(drag=0.06 * C * m.walk),
    "preload by speed": lambda m: Made(drag=0.10 * C * (m.omega / TOP_RAD_S) ** 2 * math.tanh(m.omega / 20.0)),
    "friction grows early": lambda m: Made(drag=0.15 * C * (1.0 - math.exp(-abs(m.omega) / 8.0))),
    "eddy with lag": lambda m: Made(torque=0.10 * C * m.lagged / TOP_RAD_S),
    "bump": lambda m: Made(drag=0.10 * C * math.exp(-(((abs(m.omega) - 70.0) / 8.0) ** 2))),
    "viscosity by temperature": lambda m: Made(
        drag=B * abs(m.omega) * (math.exp(-0.08 * (m.temperature - 20.0)) - 1.0)
    ),
}
Reading = Callable[[Float64Array, Float64Array, np.random.Generator, float], Float64Array]


def _plain(speed: Float64Array, angle: Float64Array, random: np.random.Generator, noise: float) -> Float64Array:
    return speed + noise * random.standard_normal(speed.size)


def _by_speed(speed: Float64Array, angle: Float64Array, random: np.random.Generator, noise: float) -> Float64Array:
    return speed + noise * (0.5 + 3.0 * np.abs(speed) / TOP_RAD_S) * random.standard_normal(speed.size)


def _eccentric(speed: Float64Array, angle: Float64Array, random: np.random.Generator, noise: float) -> Float64Array:
    """An encoder off its centre reads a speed that goes up and down once a turn, in proportion to it."""
    return _plain(speed * (1.0 + 0.01 * np.cos(angle)), angle, random, noise)


def _lost_counts(speed: Float64Array, angle: Float64Array, random: np.random.Generator, noise: float) -> Float64Array:
    """Now and then some counts of a reading are missing."""
    lost = (random.random(speed.size) < 0.03) * random.uniform(4.0, 12.0, speed.size) * noise
    return _plain(speed - np.sign(speed) * lost, angle, random, noise)


def _heavy(speed: Float64Array, angle: Float64Array, random: np.random.Generator, noise: float) -> Float64Array:
    return speed + noise / math.sqrt(3.0) * random.standard_t(3, speed.size)


READINGS: dict[str, Reading] = {
    "noise by speed": _by_speed,
    "eccentric encoder": _eccentric,
    "lost counts": _lost_counts,
    "heavy tails": _heavy,
}
SPELLS: dict[str, Law] = {  # something that lasts a tenth of the record, between three tenths and four of it
    "drag, a while": lambda m: Made(drag=-0.08 * C if 0.3 < m.share < 0.4 else 0.0),
    "gain, a while": lambda m: Made(gain=-0.08 if 0.3 < m.share < 0.4 else 0.0),
    "torque, a while": lambda m: Made(torque=0.08 * C if 0.3 < m.share < 0.4 else 0.0),
}
ALL = {**FAMILIES, **LAWS, **SPELLS}
_LATER: dict[str, Law] = {"gain for good": lambda m: Made(gain=-0.05)}  # of a wheel after something began


@dataclass(frozen=True)
class Nameless:
    """One log of a wheel with such a law."""

    name: str
    seed: int
    seconds: float = 420.0
    noise_rpm: float = 1.0

    @property
    def law(self) -> Law:
        """What the wheel has beyond the base model; nothing for a name that is none."""
        return (ALL | HARD | _LATER).get(self.name, lambda met: Made())

    @property
    def reading(self) -> Reading:
        """How its speed is read."""
        return READINGS.get(self.name, _plain)

    def run(self) -> tuple[WheelLog, Float64Array]:
        """The log as it would be read, and the true speeds (n,)."""
        return _simulated(self)

    def log(self) -> WheelLog:
        """The log alone."""
        return self.run()[0]


def conditions(time_s: Float64Array, seed: int) -> dict[str, Float64Array]:
    """Temperature, pressure and bus voltage, (n,) each: slow waves of their own."""
    random = np.random.default_rng([seed, 7])

    def wave(low_s: float, high_s: float) -> Float64Array:
        periods, phases = random.uniform(low_s, high_s, 4), random.uniform(0.0, 2.0 * np.pi, 4)
        parts = [np.sin(2.0 * np.pi * time_s / p + phase) for p, phase in zip(periods, phases, strict=True)]
        return np.asarray(0.5 * np.sum(parts, axis=0))

    return {
        "temperature_degC": 20.0 + 3.0 * (1.0 - np.exp(-time_s / 200.0)) + 0.3 * wave(100.0, 200.0),
        "pressure_Pa": 400.0 * (1.0 + 0.6 * np.clip(wave(40.0, 160.0), -1.5, 1.5)),
        "bus_voltage_V": 28.0 + 1.0 * np.clip(wave(30.0, 120.0), -1.5, 1.5),
    }


def travels(time_s: Float64Array, seed: int) -> Float64Array:
    """Currents (n,) that take a nominal wheel from speed to speed, either way round, and let it coast at times."""
    random, current_A = np.random.default_rng([seed, 3]), np.zeros(time_s.size)
    omega, at = 0.0, 0
    while at < time_s.size:
        lasts_s = random.uniform(6.0, 25.0)
        towards = random.uniform(-TOP_RAD_S, TOP_RAD_S)
        needed = ((towards - omega) / lasts_s + C * _sign(towards - omega) + B * omega) / K
        current = 0.0 if random.random() < 0.15 else min(max(needed, -TOP_A), TOP_A)
        end = min(at + round(lasts_s * RATE_HZ), time_s.size)
        for i in range(at, end):
            current_A[i] = current
            rate = K * current - B * omega - C * _sign(omega if abs(omega) > 0.1 else current)
            omega = omega + rate / RATE_HZ if abs(K * current) > S or abs(omega) > 0.1 else 0.0
        at = end
    return current_A


def _simulated(case: Nameless) -> tuple[WheelLog, Float64Array]:
    seed = case.seed
    time_s = np.arange(round(case.seconds * RATE_HZ)) / RATE_HZ
    current_A = travels(time_s, seed)
    channels = conditions(time_s, seed)
    speed, angle = _run(case.law, time_s, current_A, channels, seed)
    random = np.random.default_rng([seed, 11])
    log = WheelLog(
        name=f"{case.name.replace(', ', '-').replace(' ', '_')}_{seed}.csv",
        time_s=time_s,
        speed_rad_s=case.reading(speed, angle, random, case.noise_rpm * RAD_S_PER_RPM),
        current_A=current_A,
        drive="current_command_A",
        command_delay_s=np.zeros(time_s.size),
        segment=np.zeros(time_s.size, dtype=np.int64),
        channels={"current_command_A": current_A, **channels, "angle_rad": angle},
        rows_read=time_s.size,
    )
    return log, speed


def _run(
    law: Law, time_s: Float64Array, current_A: Float64Array, channels: dict[str, Float64Array], seed: int
) -> tuple[Float64Array, Float64Array]:
    """True speed and angle at each sample, (n,)."""
    speed, turned = np.zeros(time_s.size), np.zeros(time_s.size)
    random = np.random.default_rng([seed, 5])
    walk = np.cumsum(random.standard_normal(time_s.size)) / math.sqrt(100.0 * RATE_HZ)
    ends = np.cumsum(random.exponential(6.0, time_s.size))
    switched = np.searchsorted(ends, time_s) % 2
    omega = angle = lagged = 0.0
    for i in range(time_s.size - 1):
        h = float(time_s[i + 1] - time_s[i]) / _STEPS
        current, warmth = float(current_A[i]), float(channels["temperature_degC"][i])
        volts, pressure = float(channels["bus_voltage_V"][i]), float(channels["pressure_Pa"][i])
        share = i / time_s.size
        for _ in range(_STEPS):
            made = law(Met(omega, current, angle, warmth, volts, pressure, share, switched[i], walk[i], lagged))
            lagged += h * (omega - lagged) / 3.0
            drive = K * (1.0 + made.gain) * (current + made.current) - made.torque
            if abs(omega) < _BAND_RAD_S and abs(drive) <= S + made.drag:
                omega = 0.0
                continue
            along = _sign(omega) if abs(omega) >= _BAND_RAD_S else _sign(drive)
            bump = math.exp(-((omega / _STRIBECK_RAD_S) ** 2))
            rate = drive - B * omega - along * (C + (S - C) * bump + made.drag)
            angle += h * (omega + 0.5 * h * rate)
            omega += h * rate
        speed[i + 1], turned[i + 1] = omega, angle
    return speed, turned
