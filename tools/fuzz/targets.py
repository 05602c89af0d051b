"""What may be fuzzed: each target takes any bytes and raises only where the program would be at fault."""

from __future__ import annotations

import contextlib
import random
import tempfile
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import NamedTuple

from rw_ekf.checking.yaml_loader import parse_yaml
from rw_ekf.drivers.line.framing import encode
from rw_ekf.drivers.line.registers import decode_register, encode_saturated
from rw_ekf.drivers.line.wire_map import WireMap, wire_map_from_mapping
from rw_ekf.drivers.protocols import protocol_of
from rw_ekf.drivers.sim.plant_runner import PlantRunner
from rw_ekf.drivers.sim.register_server import RegisterServer
from rw_ekf.errors import BadInputError, ConfigError, LogError
from rw_ekf.learning.learned_file import read_learned
from rw_ekf.logs.reader import read_log
from rw_ekf.settings.load import configuration_from
from rw_ekf.wheel.model_file import read_model
from tools.fuzz.deframer import Count, check

_CONFIG = Path(__file__).parents[2] / "config"


@cache
def usual_map() -> WireMap:
    """The project's wire map."""
    document = parse_yaml((_CONFIG / "sunspace-wheel.yaml").read_text(encoding="utf-8"), "map")
    return wire_map_from_mapping(document.data, document.where)


def frames(content: bytes) -> None:
    """The deframer: no exception, a bounded rest, the same wherever it is cut."""
    check(content, [], random.Random(len(content)), Count())


def registers(content: bytes) -> None:
    """The codec of the registers, both ends: whatever a good frame carries is answered or not, and read or refused."""
    server = RegisterServer(usual_map(), PlantRunner(seed=1))
    for at in range(0, len(content), 12):
        piece = content[at : at + 12]
        server.handle(encode(piece[0], piece[-1], piece[1:-1]), server.plant.time_s + 0.01)
        server.handle(piece, server.plant.time_s + 0.01)
    for register in usual_map().registers:
        try:
            values = decode_register(register, content)
        except ValueError:  # of another length
            continue
        encode_saturated(register, values)


def yaml_text(content: bytes) -> None:
    """The YAML loader, a configuration and a wire map of the same text: ConfigError, or something usable."""
    text = content.decode("utf-8", "replace")
    with contextlib.suppress(ConfigError):
        document = parse_yaml(text, "fuzz.yaml")
        with contextlib.suppress(ConfigError):
            configuration_from(document)
        protocol_of(document.data, document.where)


def log(content: bytes) -> None:
    """The log reader: LogError, or a log whose numbers are finite where they must be."""
    with tempfile.NamedTemporaryFile(suffix=".csv") as file:
        file.write(content)
        file.flush()
        with contextlib.suppress(LogError):
            read = read_log(file.name)
            assert len(read) > 0


def model(content: bytes) -> None:
    """Model and learned files: BadInputError, or a model that can be written again."""
    with tempfile.NamedTemporaryFile(suffix=".yaml") as file:
        file.write(content)
        file.flush()
        with contextlib.suppress(BadInputError):
            assert read_model(Path(file.name)).to_text()
        with contextlib.suppress(BadInputError):
            read_learned(Path(file.name))


_LOG = "time_s,speed_rpm,current_command_A,command_delay_s,segment\n0.0,10.5,0.1,0.01,0\n0.1,11.0,0.1,,0\n"
_MODEL = """\
schema: rw_ekf.model/1
source: {method: fit}
stribeck: {speed_rad_s: 0.41887902, law: gauss}
inertia_kg_m2: 0.0015
parameters:
  motor_gain: {value: 15.2, std: 1.5, unit: rad/s^2/A}
  viscous: {value: 0.0032, std: 0.001, unit: 1/s}
  coulomb: {value: 0.586, std: 0.06, unit: rad/s^2}
  static: {value: 0.604, std: 0.1, unit: rad/s^2}
covariance: [[2.25, 0.0, 0.0, 0.0], [0.0, 1.0e-06, 0.0, 0.0], [0.0, 0.0, 0.0036, 0.0], [0.0, 0.0, 0.0, 0.01]]
noise: {speed_rad_s: 0.1, acceleration_rad_s_per_sqrt_s: 0.003}
effects: []
"""
_FRAMES = (encode(5, 137), encode(7, 3, b"\xe8\x03") + encode(8, 130) + b"\x1f\x7f", encode(1, 10, b"\x1f"))


class Target(NamedTuple):
    """What is fuzzed, and what its inputs look like."""

    run: Callable[[bytes], None]
    seeds: tuple[bytes, ...]


TARGETS: dict[str, Target] = {
    "frames": Target(frames, _FRAMES),
    "registers": Target(registers, _FRAMES),
    "yaml": Target(yaml_text, tuple(path.read_bytes() for path in sorted(_CONFIG.glob("*.yaml")))),
    "log": Target(log, (_LOG.encode(),)),
    "model": Target(model, (_MODEL.encode(),)),
}
