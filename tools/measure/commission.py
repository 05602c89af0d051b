"""Wheels of unknown sign and scale, commissioned: right, refused with the reason, or wrong.

python -m tools.measure.commission [--wheels 20] [--seed 1] [--jobs 2] [--first N]

Each draw is a whole `rw-ekf commission` over the real serial driver on a virtual clock: a wheel of each family in turn
(FAMILIES) with its gain and friction a third to three times [CK13]'s, signs of its wire map turned or not, where they
are read, written or both, the scale of speed right, or off by 60/2 pi, 2 or 10 either way, of an angle with it in
three of four, noise 0.1 to 5 rpm, any baud of its family, a delay of the command. A person with a tachometer is there
in two of three draws; in the third there is none, and what is right then is to refuse.

right: a model was written, and its gain, and its friction at 30, 300 and 1500 rpm both ways, are the wheel's within
10 % in units of true speed through the map that was written. wrong: written, and not so; or a current other than zero
before anybody had agreed, one above the limit, a true speed above 1.05 of the limit, or a current left on.
"""

from __future__ import annotations

import argparse
import contextlib
import math
import random
import tempfile
from collections import Counter
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from tqdm import tqdm

from rw_ekf.attach.wire import load_protocol
from rw_ekf.clock import VirtualClock
from rw_ekf.commissioning.dialogue import Stopped
from rw_ekf.commissioning.map_copy import write_corrected_map
from rw_ekf.commissioning.progress import Progress
from rw_ekf.commissioning.report import friction_curve
from rw_ekf.commissioning.step_context import Options, Work
from rw_ekf.commissioning.step_order import commission
from rw_ekf.driver import WheelProtocol
from rw_ekf.drivers.line.framing import Frame
from rw_ekf.drivers.line.register_protocol import RegisterProtocol
from rw_ekf.drivers.line.registers import decode_register
from rw_ekf.drivers.line.serial_port import PortSettings
from rw_ekf.drivers.sim.plant_batch import compiled_advance
from rw_ekf.drivers.sim.plant_parameters import PlantNoise, PlantParameters, PlantState
from rw_ekf.drivers.sim.plant_runner import PlantRunner
from rw_ekf.drivers.sim.register_server import RegisterServer
from rw_ekf.drivers.sim.virtual_line import VirtualCable, VirtualPort
from rw_ekf.errors import DriverError, RwEkfError
from rw_ekf.live.stop_signal import StopSignal
from rw_ekf.logs.reader import read_log
from rw_ekf.units import RAD_S_PER_RPM, rpm_from_rad_s
from rw_ekf.wheel.model_file import read_model

BAUDS = (9600, 19200, 38400, 57600, 115200, 230400)


class Family(NamedTuple):
    """One shipped map of a family of wheels."""

    protocol: str
    usual_gain: float = 15.205  # rad/s^2 per unit of command: [CK13]'s
    bauds: tuple[int, ...] = BAUDS


FAMILIES = (
    Family("sunspace-wheel"),
    Family("nsp-wheel"),
    Family("can-wheel", bauds=(57600, 115200, 230400)),  # below, an adapter cannot pass its cycle of 10 ms on
    Family("ascii-wheel"),
    Family("odrive-ascii-wheel", usual_gain=100.0),  # per N m: a rotor of 0.01 kg m^2; the map carries 1 N m
    Family("vesc-wheel"),
)
SCALES = (1.0, 1.0, 60.0 / (2.0 * math.pi), 2.0 * math.pi / 60.0, 2.0, 0.5, 10.0, 0.1)
TURNED: tuple[tuple[tuple[str, str], ...], ...] = (
    (), (), (("speed", "read"),), (("speed", "read"), ("angle", "read")), (("current", "read"),),
    (("current_command", "write"),), (("current_command", "read"),),
    (("current_command", "write"), ("current_command", "read"), ("current", "read")),
)  # fmt: skip
_FINE_STEP_S = 0.002

_WITHIN = 0.1
_OVER_SPEED = 1.05


@dataclass(frozen=True)
class Draw:
    """One wheel, and how its map and line are wrong."""

    number: int
    family: str
    gain: float
    viscous: float
    coulomb: float
    static: float
    scale: float  # of speed in the map that is given, over the true one
    turned: tuple[tuple[str, str], ...]
    noise_rpm: float
    baud: int
    delay_s: float
    has_tachometer: bool
    yes: bool = True
    of_angle: bool = False  # whether an angle's scale is off as the speed's is


@dataclass
class Reported:
    """What a draw came to."""

    draw: Draw
    verdict: str  # "right", "refused", "wrong"
    reason: str
    wheel_minutes: float = 0.0
    fastest: float = 0.0  # true speed over the limit
    gain_off: float = math.nan  # relative
    model: str = ""


@dataclass
class Watched:
    """What reached the wheel."""

    agreed: bool = False
    writes: int = 0
    before_agreed: int = 0
    largest_A: float = 0.0
    fastest_rad_s: float = 0.0
    last_A: float = 0.0
    stated: list[tuple[str, str]] = field(default_factory=list)


class Rig(NamedTuple):
    """A commissioning in this process."""

    work: Work
    watched: Watched
    plant: PlantRunner
    server: RegisterServer


class Person:
    """Agrees, reads a tachometer, and has no questions."""

    def __init__(self, watched: Watched, plant: PlantRunner, clock: VirtualClock, *, has_tachometer: bool) -> None:
        self._watched, self._plant, self._clock = watched, plant, clock
        self._has_tachometer = has_tachometer

    def say(self, step: str, text: str) -> None:
        """Keep it; the limits are said once the move has been agreed to."""
        self._watched.stated.append((step, text))
        self._watched.agreed = self._watched.agreed or step == "limits"

    def number(self, question: str, suggested: float) -> float | None:
        """Nobody is there."""
        return None

    def choose(self, question: str, names: Sequence[str]) -> int | None:
        """Nobody is there."""
        return None

    def agree(self, question: str) -> bool | None:
        """Nobody is there."""
        return None

    def tachometer(self, question: str) -> Callable[[], float | str | None] | None:
        """Looks for eight seconds, and reads to one percent."""
        if not self._has_tachometer:
            return None
        began, last = [], []

        def poll() -> float | None:
            began.append(self._clock.monotonic())
            last.append(abs(rpm_from_rad_s(self._plant.speed_rad_s)))
            recent = last[-20:]
            return 1.01 * sum(recent) / len(recent) if began[-1] - began[0] > 8.0 else None

        return poll


class _Deaf(VirtualPort):
    """The port at another baud than the wheel's: nothing that is sent is understood."""

    def write(self, content: bytes) -> int:
        """Send bytes that arrive as others."""
        return len(content)


class Line:
    """The cable at the wheel's baud."""

    def __init__(self, cable: VirtualCable, port: str, baud: int) -> None:
        self.cable, self.port, self.baud = cable, port, baud

    def speaking(self, protocol: WheelProtocol) -> WheelProtocol:
        """The protocol on this line."""
        assert isinstance(protocol, RegisterProtocol)
        return type(protocol)(protocol.wire_map, protocol.scale_places, protocol.fingerprint, self._open)

    def _open(self, settings: PortSettings, write_timeout_s: float) -> Any:
        if settings.port != self.port:
            raise DriverError(f"there is no port {settings.port}")
        if settings.baud == self.baud:
            return self.cable._open_port(settings, write_timeout_s)
        return _Deaf(self.cable, write_timeout_s)


def draw_wheel(number: int, seed: int) -> Draw:
    """The wheel of that number."""
    rng = random.Random(f"{seed}/{number}")
    third = partial(rng.uniform, -math.log(3.0), math.log(3.0))
    family = FAMILIES[number % len(FAMILIES)]
    coulomb = 0.5863 * math.exp(third())
    return Draw(
        number, family.protocol,
        gain=family.usual_gain * math.exp(third()), viscous=0.00322 * math.exp(third()),
        coulomb=coulomb, static=coulomb * rng.uniform(1.0, 1.3),
        scale=rng.choice(SCALES), turned=rng.choice(TURNED),
        noise_rpm=math.exp(rng.uniform(math.log(0.1), math.log(5.0))), baud=rng.choice(family.bauds),
        delay_s=rng.choice((0.0, 0.0, 0.05)), has_tachometer=rng.random() < 2.0 / 3.0, of_angle=rng.random() < 0.75,
    )  # fmt: skip


def rig_of(draw: Draw, directory: Path, clock: VirtualClock, options: Options, stop: StopSignal) -> Rig:
    """A commissioning of the drawn wheel, that goes on where one in this directory stopped."""
    parameters = PlantParameters(
        motor_gain=draw.gain,
        viscous=draw.viscous,
        coulomb=draw.coulomb,
        static=draw.static,
        transport_delay_s=draw.delay_s,
    )
    noise = PlantNoise(draw.noise_rpm * RAD_S_PER_RPM)
    plant = PlantRunner(parameters, noise, draw.number, PlantState(), _FINE_STEP_S, compiled_advance)
    true: Any = load_protocol(draw.family)
    command, watched = true.wire_map.current_command, Watched()

    def watch(frame: Frame) -> None:
        watched.fastest_rad_s = max(watched.fastest_rad_s, abs(plant.speed_rad_s))
        if frame.id == command.id:
            current = decode_register(command, frame.data)["current_command"]
            watched.writes += 1
            watched.before_agreed += current != 0.0 and not watched.agreed
            watched.largest_A, watched.last_A = max(watched.largest_A, abs(current)), current

    line = true.wire_map.link.model_copy(update={"baud": draw.baud})
    served = true.wire_map.model_copy(update={"link": line})
    server = true.electronics(served, plant, serial_number=draw.number + 1, first_uptime_s=50.0, watch=watch)
    deaf = Line(VirtualCable(server, clock), str(directory / "wheel"), draw.baud)
    person = Person(watched, plant, clock, has_tachometer=draw.has_tachometer)
    work = Work(
        options, Progress.of(directory / "out"), person, clock, stop, _Unheard(),
        lambda name: deaf.speaking(load_protocol(name)), lambda: [deaf.port],
    )  # fmt: skip
    return Rig(work, watched, plant, server)


def options_of(draw: Draw, directory: Path) -> Options:
    """The options: a limit of current that the wheel can be identified within, one of speed, the map that is wrong."""
    true: Any = load_protocol(draw.family)
    reported = {field.name for register in true.wire_map.readable() for field in register.fields}
    factors = {key: -1.0 for key in draw.turned if key[1] == "write" or key[0] in reported}
    if draw.scale != 1.0:
        for name in ("speed", *(("angle",) if draw.of_angle and "angle" in reported else ())):
            factors[name, "read"] = factors.get((name, "read"), 1.0) * draw.scale
    protocol = write_corrected_map(draw.family, factors, directory) if factors else None
    strong_A = (0.4 * 15.205 - 0.5863 + draw.coulomb) / draw.gain
    return Options(
        protocol=protocol, current_limit_A=round(1.2 * strong_A, 2), speed_limit_rpm=4000.0,
        temperature_limit_degC=60.0, yes=draw.yes,
    )  # fmt: skip


def carry_out(draw: Draw) -> Reported:
    """One commissioning, judged."""
    with tempfile.TemporaryDirectory() as folder, StopSignal() as stop:
        directory, clock = Path(folder), VirtualClock()
        options = options_of(draw, directory)
        work, watched, plant, _ = rig_of(draw, directory, clock, options, stop)
        refused = None
        try:
            commission(work)
        except (RwEkfError, Stopped) as error:
            refused = str(error)
        limit_rad_s, limit_A = 4000.0 * RAD_S_PER_RPM, options.current_limit_A or 0.0
        reported = Reported(
            draw,
            "refused",
            refused or "",
            work.progress.document()["wheel_s"] / 60.0,
            watched.fastest_rad_s / limit_rad_s,
        )
        broken = [
            words
            for words, is_so in (
                ("a current before it was agreed to", watched.before_agreed > 0),
                ("a current above the limit", watched.largest_A > limit_A + 1e-4),
                ("a speed above the limit", reported.fastest > _OVER_SPEED),
                ("a current left on", watched.last_A != 0.0 or plant.current_A != 0.0),
            )
            if is_so
        ]
        if broken:
            reported.verdict, reported.reason = "wrong", "; ".join(broken)
        elif refused is None:
            _judge(reported, work)
        return reported


def _judge(reported: Reported, work: Work) -> None:
    draw, model = reported.draw, read_model(Path(work.progress["files"]["model"]))
    reported.model = work.progress["model"]["verdict"]["kind"]
    reported.gain_off = model.parameters.motor_gain / draw.gain - 1.0
    wrong = [] if abs(reported.gain_off) < _WITHIN else [f"gain {model.parameters.motor_gain:.4g}"]
    curve = friction_curve(read_log(work.progress["identification"]["log"]), model)
    for rpm in (-1500.0, -300.0, -30.0, 30.0, 300.0, 1500.0):
        speed = rpm * RAD_S_PER_RPM
        stribeck = math.exp(-((speed / PlantParameters().stribeck_speed_rad_s) ** 2))
        truth = math.copysign(draw.coulomb + (draw.static - draw.coulomb) * stribeck, speed) + draw.viscous * speed
        believed = float(np.interp(speed, curve.speed_rad_s, curve.friction_rad_s2))
        if abs(believed / truth - 1.0) > _WITHIN:
            wrong.append(f"friction at {rpm:g} rpm {believed:.4g}, truly {truth:.4g}")
    turned = turned_backward(work, draw)
    wrong += [turned] if turned else []
    reported.verdict, reported.reason = ("wrong", "; ".join(wrong)) if wrong else ("right", "")


def turned_backward(work: Work, draw: Draw) -> str | None:
    """What is wrong with signs and scale of the map that was written, held against the true one; None: nothing."""
    true: Any = load_protocol(draw.family)
    made: Any = load_protocol(work.progress["sign"]["protocol"])
    speed = made.wire_map.speed_field.scale / true.wire_map.speed_field.scale
    current = made.wire_map.current_command.fields[0].scale / true.wire_map.current_command.fields[0].scale
    if speed * current < 0.0:
        return "a positive current turns the wheel backward"
    return None if abs(abs(speed) - 1.0) < 0.05 else f"the scale of speed is off by {abs(speed):.4g}"


class _Unheard:
    """A logger that nobody reads."""

    def info(self, event: str, **context: Any) -> None:
        """Nothing."""

    warning = error = info


def main() -> None:
    """Draw, commission, count."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", 1)[0])
    parser.add_argument("--wheels", type=int, default=20)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--jobs", type=int, default=2)
    args = parser.parse_args()
    draws = [draw_wheel(number, args.seed) for number in range(args.first, args.first + args.wheels)]
    counts: Counter[str] = Counter()
    minutes = []
    with ProcessPoolExecutor(args.jobs) if args.jobs > 1 else contextlib.nullcontext() as pool:
        for reported in tqdm((map if pool is None else pool.map)(carry_out, draws), total=len(draws)):
            d = reported.draw
            counts[reported.verdict] += 1
            minutes += [reported.wheel_minutes] if reported.verdict == "right" else []
            turned = "+".join(f"{name.removeprefix('current_')}.{way[0]}" for name, way in d.turned) or "-"
            tqdm.write(
                f"{d.number:3d} {d.family:18s} k {d.gain:5.1f} c {d.coulomb:4.2f} scale {d.scale:6.3f} "
                f"turned {turned:30s} "
                f"{d.noise_rpm:4.1f} rpm {d.baud:6d} {'late' if d.delay_s else '  - '} "
                f"{'tacho' if d.has_tachometer else '  -  '} {reported.verdict:8s} "
                f"{reported.wheel_minutes:4.1f} min gain {reported.gain_off:+.1%} top {reported.fastest:.2f} "
                f"{reported.model} "
                f"{reported.reason[:150]}"
            )
    print(f"{dict(counts)}; wheel-minutes {min(minutes, default=0):.1f} to {max(minutes, default=0):.1f}")


if __name__ == "__main__":
    main()
