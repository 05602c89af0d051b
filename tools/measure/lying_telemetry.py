"""One field of telemetry lies, with a good checksum: what is written all the same, and how fast the wheel truly gets.

python -m tools.measure.lying_telemetry [--draws 1000] [--seed 1] [--family nsp-wheel]

Each draw is a run of the real daemon over the real serial driver on a virtual clock: a wheel near the prior, a
profile, a limit, and a liar: one field that the wheel tells, a kind of lie, from the start or from some time on.
Counted are writes outside [zero, what was written last, what was asked for], and T / L, the largest true speed over
the limit.
"""

from __future__ import annotations

import argparse
import math
import random
import struct
import tempfile
from collections import Counter, deque
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import yaml
from tqdm import tqdm

from rw_ekf.attach.wire import checked_protocol, load_protocol
from rw_ekf.clock import VirtualClock
from rw_ekf.drivers.line.framing import Frame
from rw_ekf.drivers.line.registers import decode_register
from rw_ekf.drivers.line.wire_layout import Field, Register
from rw_ekf.drivers.sim.fault_text import parse_faults
from rw_ekf.drivers.sim.faults import FaultInjector
from rw_ekf.drivers.sim.plant_batch import compiled_advance
from rw_ekf.drivers.sim.plant_parameters import PlantNoise, PlantParameters, PlantState
from rw_ekf.drivers.sim.plant_runner import PlantRunner
from rw_ekf.drivers.sim.register_server import OK, RegisterServer
from rw_ekf.drivers.sim.virtual_line import VirtualCable
from rw_ekf.learning.run_start import GivenModel
from rw_ekf.live import guard
from rw_ekf.live.daemon import Task, run_daemon
from rw_ekf.live.run_outcome import RunOutcome
from rw_ekf.live.stop_signal import StopSignal
from rw_ekf.records import RunState
from rw_ekf.settings.load import load_configuration
from rw_ekf.units import RAD_S_PER_RPM

FAMILIES = {  # each way of being told a current that ships, and a usual gain [rad/s^2 per A, or per N m]
    "sunspace-wheel": 15.205,
    "nsp-wheel": 15.205,
    "nsp-wheel-torque": 40000.0,
    "can-wheel": 15.205,
    "ascii-wheel": 15.205,
    "odrive-ascii-wheel": 100.0,
    "vesc-wheel": 15.205,
}
FIELDS = ("speed", "speed", "speed", "current", "current_command", "temperature", "pressure", "bus_voltage", "uptime")
HONEST = "nobody"
KINDS = ("constant", "hum", "bit", "scale", "shift", "wrap", "lag", "wild", "end", "flip", "drift")
_COUNT_A = 1.0e-4
_EPSILON_A = 1.0e-9

Lie = Callable[[float, float], float]  # (true value in SI, time [s]) -> what is told


@dataclass(frozen=True)
class Draw:
    """One run and its liar."""

    seed: int
    field: str
    kind: str
    size: float  # in 0 to 1: how large the lie is, by its kind
    begins_s: float
    limit_rpm: float
    profile: dict[str, Any]
    gain: float
    coulomb: float
    lasts_s: float = 45.0
    acts: bool = True  # False: writes are acknowledged and not acted on, from begins_s on
    family: str = "sunspace-wheel"
    answers: bool = True  # False: what does not act is not acknowledged either
    fault: str = ""  # of the simulated wheel, in place of a lie (docs/simulated-wheel.md#faults)

    @property
    def per_ampere(self) -> float:
        """Units of this family's command for an ampere of the usual wheel: 1, or N m."""
        return 15.205 / FAMILIES[self.family]


@dataclass(frozen=True)
class Reported:
    """What a draw came to."""

    draw: Draw
    writes: int
    outside: int
    speed_over_limit: float
    safe: bool
    confirmed: bool
    current_at_end_A: float
    reason: str  # of the state at the end

    @property
    def is_false_zero(self) -> bool:
        """Whether zero was called confirmed while a current flowed."""
        return self.confirmed and abs(self.current_at_end_A) > _EPSILON_A


def draw_of(seed: int, family: str = "sunspace-wheel") -> Draw:
    """The draw of a seed, of a wheel of that family; one that tells something else than FIELDS lies there too."""
    rng = random.Random(seed)
    profile: dict[str, Any] = rng.choice(
        (
            {"profile": "steps", "amplitude_A": rng.uniform(0.1, 0.3), "period_s": rng.uniform(20.0, 90.0)},
            {"profile": "sine", "amplitude_A": rng.uniform(0.1, 0.3), "period_s": rng.uniform(8.0, 60.0)},
            {"profile": "random-sines", "amplitude_A": rng.uniform(0.1, 0.3), "period_s": rng.uniform(10.0, 40.0)},
            {"profile": "steps", "amplitude_A": 0.0, "period_s": 60.0, "bias_A": rng.uniform(0.08, 0.3)},
        )
    )
    return Draw(
        seed=seed,
        field=rng.choice(fields_of(family)),
        kind=rng.choice(KINDS),
        size=rng.random(),
        begins_s=rng.choice((0.0, rng.uniform(5.0, 35.0))),
        limit_rpm=rng.choice((200.0, 300.0, 400.0, 800.0)),
        profile=profile,
        gain=15.205 * rng.uniform(0.8, 1.2),
        coulomb=0.58 * rng.uniform(0.6, 1.4),
        family=family,
    )


def fields_of(family: str) -> tuple[str, ...]:
    """What a wheel of a family can lie about, the speed three times as often as anything else."""
    reported = [field.name for field in _reported_fields(family)]
    known = [name for name in FIELDS if name in reported]
    return (*known, *(name for name in dict.fromkeys(reported) if name not in known))


def _reported_fields(family: str) -> list[Field]:
    protocol: Any = load_protocol(family)
    return [field for register in protocol.wire_map.readable() for field in register.fields]


def lie_of(draw: Draw, field: Field) -> Lie:
    """What the field tells."""
    rng, count, (low, high) = random.Random(draw.seed + 1), _count_of(field), field.si_range
    current = 0.3 * draw.per_ampere
    usual = {"speed": 40.0, "current": current, "current_command": current, "temperature": 40.0}.get(
        draw.field, min(0.3 * high, 1000.0)
    )
    held: list[float] = []
    past: deque[tuple[float, float]] = deque()
    sign = 1.0 if rng.random() < 0.5 else -1.0
    share = 0.01 + 0.19 * draw.size

    def lie(true: float, time_s: float) -> float:
        past.append((time_s, true))
        while len(past) > 2 and past[1][0] <= time_s - 10.0 * draw.size:
            past.popleft()
        if time_s < draw.begins_s:
            return true
        held.append(true) if not held else None
        if draw.kind == "constant":
            return held[0] if draw.begins_s > 0.0 else sign * usual * draw.size
        if draw.kind == "hum":
            return (held[0] if draw.begins_s > 0.0 else 0.0) + rng.gauss(0.0, 0.1 if draw.field == "speed" else count)
        if draw.kind == "bit":
            return _with_bit(field, true, draw.size, up=sign > 0)
        if draw.kind == "scale":
            return true * (0.1 + 0.9 * draw.size if sign > 0 else 1.0 + 9.0 * draw.size)
        if draw.kind == "shift":
            return true + sign * usual * draw.size
        if draw.kind == "wrap":
            span = usual * (0.5 + draw.size)
            return (true + span) % (2.0 * span) - span
        if draw.kind == "lag":
            return past[0][1]
        if draw.kind == "wild":
            return rng.uniform(max(low, -5.0 * usual), min(high, 5.0 * usual)) if rng.random() < share else true
        if draw.kind == "end":
            return low if sign < 0 else high
        if draw.kind == "drift":
            return true * math.exp(-(0.005 + 0.02 * draw.size) * sign * (time_s - draw.begins_s))
        return -true

    return lie


def _count_of(field: Field) -> float:
    """The least step of a field, where it has one [SI]."""
    return 1e-6 if field.is_float else field.si_per_count


def _with_bit(field: Field, true: float, place: float, *, up: bool) -> float:
    """The value with one bit of its number stuck; place: which one, in 0 to 1."""
    number = field.to_wire(true)
    if field.is_float:
        bits, bit = struct.unpack("<I", struct.pack("<f", number))[0], 1 << int(16 + 15 * place)
        (reported,) = struct.unpack("<f", struct.pack("<I", bits | bit if up else bits & ~bit))
        return field.to_si(reported)
    whole, bit = int(number), 1 << int(4 + 11 * place)
    return field.to_si(whole | bit if up else whole & ~bit)


class _Unheard:
    """A logger that nobody reads."""

    def info(self, event: str, **context: Any) -> None:
        """Say nothing."""

    warning = error = info


def _let_lie(server: RegisterServer, draw: Draw) -> None:
    """One field of what it tells lies from now on; or it acknowledges writes without acting on them."""
    began_s, tell, act, answer = server.plant.time_s, server._telemetry, server._command_current, server._answer
    field = next((f for f in _reported_fields(draw.family) if f.name == draw.field), None)
    lie = None if field is None else lie_of(draw, field)

    def lying(register: Register) -> dict[str, float]:
        values = tell(register)
        if lie is not None and register.field(draw.field):
            values[draw.field] = lie(values.get(draw.field, 0.0), server.plant.time_s - began_s)
        return values

    def deaf(current_A: float) -> int:
        is_so = server.plant.time_s - began_s >= draw.begins_s and current_A != server.command_A
        return OK if is_so else act(current_A)

    def mute(frame: Frame, register: Register | None) -> bytes | None:
        is_so = register is server.wire_map.current_command and server.plant.time_s - began_s >= draw.begins_s
        return None if is_so else answer(frame, register)

    if not draw.answers:
        server._answer = mute  # type: ignore[method-assign]
    elif draw.acts:
        server._telemetry = lying  # type: ignore[method-assign]
    else:
        server._command_current = deaf  # type: ignore[method-assign]


def run_draw(draw: Draw, directory: Path) -> Reported:
    """Run it."""
    configuration = load_configuration(_configuration(draw, directory))
    spoken: Any = checked_protocol(configuration)
    command = spoken.wire_map.current_command
    honest = draw.field == HONEST  # +-50 % in both; else +-20 % in gain and +-40 % in friction
    gain = 15.205 + (2.5 if honest else 1.0) * (draw.gain - 15.205)
    coulomb = 0.58 + (1.25 if honest else 1.0) * (draw.coulomb - 0.58)
    parameters = PlantParameters()._replace(motor_gain=gain / draw.per_ampere, coulomb=coulomb, static=1.05 * coulomb)
    noise, state = PlantNoise(RAD_S_PER_RPM), PlantState(speed_rad_s=0.0)
    plant = PlantRunner(parameters, noise, draw.seed, state, 0.02, compiled_advance)
    written: list[float] = []
    wanted: list[float] = [0.0]
    outside, fastest = 0, 0.0

    def watch(frame: Frame) -> None:
        nonlocal outside, fastest
        fastest = max(fastest, abs(plant.speed_rad_s))
        if frame.id == command.id:
            current = decode_register(command, frame.data)["current_command"]
            hull = (0.0, written[-1] if written else 0.0, wanted[-1])
            slack = _COUNT_A * max(draw.per_ampere, 1e-3) + _EPSILON_A
            outside += not min(hull) - slack <= current <= max(hull) + slack
            written.append(current)

    faults = FaultInjector(parse_faults([draw.fault]) if draw.fault else (), draw.seed)
    server = spoken.electronics(spoken.wire_map, plant, first_uptime_s=100.0, watch=watch, faults=faults)
    if not draw.fault:
        _let_lie(server, draw)
    clock = VirtualClock()
    protocol = VirtualCable(server, clock).carrying(spoken)
    allow: Any = guard.allowed_current

    def noted(requested_A: float, *others: Any) -> Any:
        wanted.append(requested_A if math.isfinite(requested_A) else 0.0)
        return allow(requested_A, *others)

    guard.allowed_current = noted  # type: ignore[assignment]
    try:
        with StopSignal() as stop:
            outcome = run_daemon(Task(configuration, protocol, GivenModel(), draw.lasts_s), _Unheard(), stop, clock)
    finally:
        guard.allowed_current = allow
    return _reported(draw, len(written), outside, fastest, outcome, plant.current_A)


def _reported(draw: Draw, writes: int, outside: int, fastest: float, outcome: RunOutcome, at_end_A: float) -> Reported:
    over = fastest / (draw.limit_rpm * RAD_S_PER_RPM)
    safe = outcome.state.state is RunState.SAFE or outcome.halted is not None
    return Reported(
        draw, writes, outside, over, safe, outcome.zero_confirmed, at_end_A, outcome.halted or outcome.state.reason
    )


def _configuration(draw: Draw, directory: Path) -> Path:
    """A torque of another size stands in place of a current in some families."""
    path, of = directory / "wheel.yaml", draw.per_ampere
    command = {key: value * of if key.endswith("_A") else value for key, value in draw.profile.items()}
    content: dict[str, Any] = {
        "wheel": {"port": str(directory / "wheel"), "protocol": draw.family},
        "limits": {"current_A": 0.3 * of, "speed_rpm": draw.limit_rpm, "silence_s": 0.5},
        "command": command,
        "output": {"directory": str(directory / "runs")},
    }
    if of != 1.0:
        usual = FAMILIES[draw.family]
        content["limits"]["slew_A_per_s"] = 5.0 * of
        content["filter"] = {"prior": {"motor_gain": {"value": usual, "std": 0.3 * usual}}}
    path.write_text(yaml.safe_dump(content), encoding="utf-8")
    return path


def sentence_about(seed: int, family: str = "sunspace-wheel", **changes: Any) -> Reported:
    """What the draw of a seed comes to. changes: of its fields."""
    with tempfile.TemporaryDirectory(prefix="rw-ekf-liar-") as name:
        return run_draw(replace(draw_of(seed, family), **changes), Path(name))


def main() -> int:
    """Run the draws and print what they came to."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--draws", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--family", choices=FAMILIES, default="sunspace-wheel")
    parser.add_argument("--jobs", type=int, help="processes (default: one for each processor)")
    parser.add_argument("--field", help="this field alone")
    parser.add_argument("--kind", help="this kind of lie alone")
    parser.add_argument("--deaf", action="store_true", help="writes acknowledged and not acted on, in place of a lie")
    parser.add_argument("--mute", action="store_true", help="writes neither answered nor acted on, in place of a lie")
    parser.add_argument("--fault", help="a fault of the simulated wheel in place of a lie, such as residue:0.3")
    parser.add_argument("--healthy", action="store_true", help="nobody lies; gain and friction +-50 %%")
    parser.add_argument("--lasts", type=float, help="so long each [s]")
    parser.add_argument("--worst", type=int, default=8, help="so many of the fastest are listed")
    args = parser.parse_args()
    changes: dict[str, Any] = {"family": args.family}
    changes |= {name: value for name, value in (("field", args.field), ("kind", args.kind)) if value is not None}
    changes |= {"acts": False} if args.deaf else {}
    changes |= {"acts": False, "answers": False} if args.mute else {}
    changes |= {"fault": args.fault} if args.fault else {}
    changes |= {"lasts_s": args.lasts} if args.lasts is not None else {}
    changes |= {"field": HONEST, "kind": "nothing"} if args.healthy else {}
    seeds = range(1000 * args.seed, 1000 * args.seed + args.draws)
    with ProcessPoolExecutor(args.jobs) as pool:
        reported = list(tqdm(pool.map(partial(sentence_about, **changes), seeds, chunksize=4), total=args.draws))
    print_table(reported, args.worst)
    return 0


def print_table(reported: list[Reported], worst: int) -> None:
    """A row for each field and kind, then the fastest."""
    writes, outside = sum(t.writes for t in reported), sum(t.outside for t in reported)
    print(f"{len(reported)} draws, {writes} writes: {outside} outside [0, last, asked]; ", end="")
    print(f"zero called confirmed while a current flowed: {sum(t.is_false_zero for t in reported)}")
    groups: dict[tuple[str, str], list[Reported]] = {}
    for one in reported:
        groups.setdefault((one.draw.field, one.draw.kind), []).append(one)
    print(f"{'field':16} {'lie':10} {'draws':>5} {'SAFE':>5} {'confirmed':>9} {'worst T / L':>11}")
    for (field, kind), ones in sorted(groups.items()):
        fastest = max(t.speed_over_limit for t in ones)
        safe, confirmed = sum(t.safe for t in ones), sum(t.confirmed for t in ones)
        print(f"{field:16} {kind:10} {len(ones):5} {safe:5} {confirmed:9} {fastest:11.2f}")
    reasons = Counter((t.draw.field, t.reason[:100]) for t in reported if t.safe)
    for (field, reason), times in sorted(reasons.items(), key=lambda item: (item[0][0], -item[1])):
        print(f"SAFE {times:4} {field:16} {reason}")
    for one in [t for t in reported if t.safe and t.draw.field == HONEST]:
        print(f"falsely SAFE  {one.draw}")
    for one in sorted(reported, key=lambda t: -t.speed_over_limit)[:worst]:
        print(f"T / L {one.speed_over_limit:.2f}  {'SAFE' if one.safe else '-'}  {one.draw}")


if __name__ == "__main__":
    raise SystemExit(main())
