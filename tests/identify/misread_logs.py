"""Logs of machines stepped here with numpy alone, and the ways in which such a log is misread: a file and its map.

The stepping is explicit Euler at 1 ms with a wheel that sticks: nothing of the project's own integration.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from rw_ekf.arrays import Float64Array

RPM = np.pi / 30.0


@dataclass(frozen=True)
class Machine:
    """Gain, viscous, Coulomb, break-away friction (SI per unit inertia), reading noise, rows a second, top drive."""

    k: float
    b: float
    c: float
    s: float
    noise: float
    rate_hz: float
    top: float
    seconds: float = 240.0


@dataclass(frozen=True)
class Motion:
    """What truly happened, (n,) each: time [s], drive from a row to the next, true speed, reading, true angle [rad]."""

    t: Float64Array
    drive: Float64Array
    speed: Float64Array
    reading: Float64Array
    angle: Float64Array


WHEEL = Machine(16.6, 0.0032, 0.59, 0.61, 0.1, 10.0, 0.3)
MACHINES = {
    "wheel": WHEEL,
    "wheel fast rows": Machine(14.0, 0.004, 0.5, 0.53, 0.15, 50.0, 0.25, 120.0),
    "small motor": Machine(70.0, 2.5, 14.0, 16.0, 0.05, 100.0, 2.0, 60.0),
    "carriage": Machine(0.0105, 2.1, 0.21, 0.22, 0.0005, 100.0, 60.0, 60.0),
    "big flywheel": Machine(0.5, 0.0005, 0.02, 0.022, 0.02, 2.0, 4.0, 900.0),
    "cubesat wheel": Machine(2500.0, 0.05, 18.0, 20.0, 0.3, 20.0, 0.06, 120.0),
}


def profile(kind: str, machine: Machine, rng: np.random.Generator) -> Float64Array:
    """Drive of each row (n,): `steps` both ways, `sine`, `forward` only, `coast` (none), `weak`, `brake`."""
    n = int(machine.seconds * machine.rate_hz)
    t = np.arange(n) / machine.rate_hz
    if kind == "coast":
        return np.zeros(n)
    if kind == "sine":
        return machine.top * np.sin(2.0 * np.pi * 5.0 * t / machine.seconds + rng.uniform(0.0, 2.0))
    hold = int(n / 24)
    levels = rng.uniform(0.25, 1.0, 25) * machine.top
    if kind == "steps":
        levels *= np.where(np.arange(25) // 2 % 2 == 0, 1.0, -1.0)
    elif kind == "forward":
        levels *= np.where(np.arange(25) % 2 == 0, 1.0, 0.3)
    elif kind == "brake":  # both signs of the drive and never backward: short brakes after long pushes
        levels = np.where(np.arange(25) % 4 == 3, -0.3 * machine.top, 0.6 * machine.top)
    elif kind == "weak":
        levels = 1.3 * machine.s / machine.k + 0.02 * machine.top * rng.standard_normal(25)
    return np.repeat(levels, hold + 1)[:n]


def motion(machine: Machine, kind: str, seed: int) -> Motion:
    """Step the machine through a profile; a coast-down begins at speed, everything else at rest."""
    rng = np.random.default_rng(seed)
    drive = profile(kind, machine, rng)
    n, inner = drive.size, max(int(1000.0 / machine.rate_hz), 5)
    dt = 1.0 / machine.rate_hz / inner
    top = machine.k * machine.top / max(machine.b, machine.k * machine.top / 200.0)
    w, angle = (0.8 * top if kind == "coast" else 0.0), 0.0
    speed, turned = np.zeros(n), np.zeros(n)
    for i in range(n):
        speed[i], turned[i] = w, angle
        push = machine.k * float(drive[i])
        for _ in range(inner):
            if w == 0.0 and abs(push) <= machine.s:
                break
            way = np.sign(w) if w != 0.0 else np.sign(push)
            new = w + dt * (push - machine.b * w - machine.c * way)
            w = 0.0 if new * way < 0.0 and w != 0.0 else new
            angle += w * dt
    return Motion(np.arange(n) / machine.rate_hz, drive, speed, speed + machine.noise * rng.standard_normal(n), turned)


def write(path: Path, columns: Mapping[str, Float64Array | list[str]], map_text: str = "") -> tuple[Path, Path | None]:
    """A CSV file, and the map beside it where there is one."""
    cells = [[v if isinstance(v, str) else repr(float(v)) for v in values] for values in columns.values()]
    rows = "\n".join(",".join(row) for row in zip(*cells, strict=True))
    path.write_text(",".join(columns) + "\n" + rows + "\n")
    if not map_text:
        return path, None
    beside = path.with_suffix(".map.yaml")
    beside.write_text(map_text)
    return path, beside


PLAIN = "time_s: {column: t}\nspeed_rad_s: {column: v}\ncurrent_A: {column: i}\n"


def misread(path: Path, how: str, machine: Machine, seed: int) -> tuple[Path, Path | None]:
    """A log of this machine, and a map that misreads it in one way."""
    m = motion(machine, "steps", seed)
    plain: dict[str, Float64Array | list[str]] = {"t": m.t, "v": m.reading, "i": m.drive}
    if how == "sign":
        return write(path, plain | {"i": -m.drive}, PLAIN)
    if how in ("ms", "us", "min"):
        return write(path, plain | {"t": m.t * {"ms": 1e3, "us": 1e6, "min": 1.0 / 60.0}[how]}, PLAIN)
    if how == "unsigned current":
        return write(path, plain | {"i": np.abs(m.drive), "dir": np.sign(m.drive)}, PLAIN)
    if how == "unsigned speed":
        return write(path, plain | {"v": np.abs(m.reading)}, PLAIN)
    if how == "int16 speed":
        raw = np.round(m.reading / RPM) % 65536
        return write(path, plain | {"v": raw}, PLAIN.replace("speed_rad_s", "speed_rpm"))
    if how == "int16 current":
        raw = np.round(m.drive * 1e3) % 65536
        return write(path, plain | {"i": raw}, PLAIN.replace("{column: i}", "{column: i, scale: 0.001}"))
    if how in ("clock forward", "clock back", "clock 2 s"):
        step = {"clock forward": 3600.0, "clock back": -3600.0, "clock 2 s": 2.0}[how]
        stamps = 1.7e9 + m.t + np.where(np.arange(m.t.size) > 0.443 * m.t.size, step, 0.0)
        return write(path, plain | {"t": stamps}, PLAIN)
    if how == "iso clock back":
        ms = np.round(1e3 * (m.t - np.where(m.t > 0.5 * m.t[-1], 3600.0, 0.0))).astype("timedelta64[ms]")
        texts = [str(np.datetime64("2026-10-25T02:40:00.000") + v) for v in ms]
        return write(path, plain | {"t": texts}, PLAIN)
    if how in ("wrap rad", "wrap deg"):
        turn = 2.0 * np.pi if how == "wrap rad" else 360.0
        scale = "" if how == "wrap rad" else ", scale: 0.017453292519943295"
        angle = m.angle * turn / (2.0 * np.pi) % turn
        text = PLAIN.replace("{column: v}", f"{{derivative_of: th{scale}}}")
        return write(path, plain | {"th": angle}, text)
    if how == "set-point":
        return write(path, plain | set_point(machine, seed), PLAIN)
    if how == "rpm as rad/s":
        return write(path, plain | {"v": m.reading / RPM}, PLAIN)
    if how == "rad/s as rpm":
        return write(path, plain, PLAIN.replace("speed_rad_s", "speed_rpm"))
    if how == "deg/s as rpm":
        return write(path, plain | {"v": np.degrees(m.reading)}, PLAIN.replace("speed_rad_s", "speed_rpm"))
    if how == "angle in degrees":
        return write(path, plain | {"th": np.degrees(m.angle)}, PLAIN + "angle_rad: {column: th}\n")
    if how == "mA":
        return write(path, plain | {"i": 1e3 * m.drive}, PLAIN)
    if how == "mA by name":
        text = PLAIN.replace("{column: i}", "{column: iq_mA}")
        return write(path, {"t": m.t, "v": m.reading, "iq_mA": 1e3 * m.drive}, text)
    if how == "reversed":
        return write(path, {name: np.asarray(values)[::-1] for name, values in plain.items()}, PLAIN)
    if how == "reversed, no time":
        text = PLAIN.replace("time_s: {column: t}", f"rate_hz: {machine.rate_hz}")
        return write(path, {name: np.asarray(values)[::-1] for name, values in plain.items()}, text)
    if how == "swapped":
        return write(
            path,
            plain,
            PLAIN.replace("{column: v}", "{column: x}").replace("column: i", "column: v").replace("x}", "i}"),
        )
    raise ValueError(how)


def set_point(machine: Machine, seed: int) -> dict[str, Float64Array | list[str]]:
    """A speed loop follows steps of a set-point: rows of the set-point (in the current's place) and of the speed."""
    rng = np.random.default_rng(seed)
    n = int(machine.seconds * machine.rate_hz)
    wanted = np.repeat(rng.uniform(-80.0, 80.0, 16), n // 15)[:n]
    speed, w, held, dt = np.zeros(n), 0.0, 0.0, 1.0 / machine.rate_hz
    for i in range(n):
        speed[i] = w
        held = np.clip(0.6 * (wanted[i] - w) / machine.k, -2.0 * machine.top, 2.0 * machine.top)
        w += dt * (machine.k * held + np.clip(machine.c * np.sign(w) - machine.c * np.sign(w), -1.0, 1.0))
    return {"i": wanted, "v": speed + machine.noise * rng.standard_normal(n)}


MISREADINGS: dict[str, tuple[str, ...]] = {  # what the sentence has to hold, of each
    "sign": ("current_A: {column: i, scale: -1}",),
    "ms": ("time_s: {column: t, scale: 0.001}",),
    "us": ("time_s: {column: t, scale: 1e-06}",),
    "min": ("time_s: {column: t, scale: 60}",),
    "unsigned current": ("current_A: {column: i, sign_of: dir}",),
    "unsigned speed": ("speed_rad_s: {column: v, sign_of: ",),
    "int16 speed": ("speed_rpm: {column: v, wrap: 65536}",),
    "int16 current": ("current_A: {column: i, scale: 0.001, wrap: 65536}",),
    "clock forward": ("rate_hz: ",),
    "clock back": ("rate_hz: ",),
    "clock 2 s": ("rate_hz: ",),
    "iso clock back": ("rate_hz: ",),
    "wrap rad": ("speed_rad_s: {derivative_of: th, wrap: 6.283185307179586}",),
    "wrap deg": ("speed_rad_s: {derivative_of: th, scale: 0.017453292519943295, wrap: 360}",),
    "set-point": ("current_A: {column: ",),
    "rpm as rad/s": ("speed_rpm: {column: v}",),
    "rad/s as rpm": ("speed_rad_s: {column: v}",),
    "deg/s as rpm": ("speed_rad_s: {column: v, scale: 0.0174533}",),
    "angle in degrees": ("angle_rad: {column: th, scale: 0.0174533}",),
    "mA": ("current_A: {column: i, scale: 0.001}",),
    "mA by name": ("current_A: {column: iq_mA, scale: 0.001}",),
    "reversed": ("reverse: true",),
    "reversed, no time": ("reverse: true",),
    "swapped": ("speed_rad_s: {column: v}", "current_A: {column: i}"),
}

HEALTHY = [
    ("wheel", "steps"),
    ("wheel", "sine"),
    ("wheel", "forward"),
    ("wheel", "coast"),
    ("wheel", "weak"),
    ("wheel", "brake"),
    ("wheel fast rows", "steps"),
    ("small motor", "steps"),
    ("small motor", "sine"),
    ("small motor", "forward"),
    ("small motor", "weak"),
    ("carriage", "steps"),
    ("carriage", "sine"),
    ("carriage", "forward"),
    ("big flywheel", "steps"),
    ("big flywheel", "coast"),
    ("big flywheel", "brake"),
    ("cubesat wheel", "steps"),
    ("cubesat wheel", "forward"),
    ("cubesat wheel", "weak"),
]


def healthy(path: Path, name: str, kind: str, seed: int) -> tuple[Path, Path | None]:
    """A log that is read as it should be, the angle within a turn beside it."""
    m = motion(MACHINES[name], kind, seed)
    columns: dict[str, Float64Array | list[str]] = {"t": m.t, "v": m.reading, "i": m.drive}
    text = PLAIN
    if kind == "coast":
        text = text.replace("{column: i}", "{constant: 0.0}")
    if kind == "sine":
        columns["th"] = m.angle % (2.0 * np.pi)
        text += "angle_rad: {column: th}\n"
    if kind == "steps":  # turns counted without end, in the unit that the map gives
        columns["th"] = np.degrees(m.angle)
        text += "angle_rad: {column: th, scale: 0.017453292519943295}\n"
    return write(path, columns, text)
