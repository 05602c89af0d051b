"""`rw-ekf simulate`: a simulated wheel behind a real tty."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rw_ekf.commands.answer import answer
from rw_ekf.commands.inputs import add_config_option

if TYPE_CHECKING:
    from rw_ekf.drivers.sim.plant_parameters import PlantNoise
    from rw_ekf.settings.schema import Configuration

HELP = "serve a simulated wheel on a pseudo-terminal; `simulate fleet`: write the logs of many"
EXAMPLE = """example:
  rw-ekf simulate --link /tmp/rw-ekf-wheel --effect offset_torque:torque_rad_s2=0.03 --seed 7
  rw-ekf simulate --link /tmp/rw-ekf-wheel --fault drop:0.1,freeze@30s:5s
  rw-ekf simulate --link /tmp/rw-ekf-wheel --effect-file my-effects.yaml --effect eddy:a=0.004,w0=40
  rw-ekf simulate --link /tmp/bus --config bus --fault echo,rw-y=dead@30s:20s
  rw-ekf simulate --effects
  rw-ekf simulate fleet --out logs --wheels 20 --days 60 --seed 1"""
MAX_SPEED_RPM = 1.0e5


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument(
        "what", nargs="?", choices=["wheel", "fleet"], default="wheel", help="a wheel (the default), or a fleet's logs"
    )
    parser.add_argument(
        "--link",
        metavar="PATH",
        help="where the wheel's tty is reachable (default: the configuration's port, without one /tmp/wheel0)",
    )
    add_config_option(parser, "its `simulation` and `wheel` describe the truth")
    parser.add_argument(
        "--effect",
        metavar="ID:name=value,...",
        action="append",
        nargs="+",
        default=[],
        help="a physical effect the wheel shall have; may be repeated",
    )
    parser.add_argument(
        "--effect-file",
        metavar="F",
        help="effects by formulas of your own (YAML), for --effect; see docs/own-effects.md",
    )
    listed = parser.add_mutually_exclusive_group()
    listed.add_argument("--effects", action="store_true", help="list all effects with their parameters")
    parser.add_argument(
        "--fault",
        metavar="KIND:amount@start:lasts:period,...",
        action="append",
        default=[],
        help="a fault of the line or the wheel, or NAME=KIND... of one of several wheels; may be repeated",
    )
    listed.add_argument("--faults", action="store_true", help="list all faults with their amounts")
    parser.add_argument("--seed", type=int, default=0, help="of the noise and the faults (default 0)")
    parser.add_argument("--speed-factor", metavar="X", type=float, default=1.0, help="wheel time runs X times as fast")
    parser.add_argument("--initial-speed-rpm", metavar="RPM", type=float, default=0.0, help="speed at the start")
    parser.add_argument("-o", "--out", metavar="DIR", help="fleet: where its logs are written")
    parser.add_argument("--wheels", metavar="N", type=int, default=20, help="fleet: how many wheels (default 20)")
    parser.add_argument("--days", metavar="N", type=int, default=30, help="fleet: a log a day, so many (default 30)")
    parser.add_argument("--workers", metavar="N", type=int, help="fleet: processes (default: the cores)")


def execute(args: argparse.Namespace) -> int:
    """Run the verb, a wheel until a signal; raises RwEkfError."""
    from rw_ekf.errors import UsageError

    if args.effects or args.faults:
        return _list(args)
    if args.what == "fleet":
        return _fleet(args)
    if args.out is not None:
        raise UsageError("--out is where `simulate fleet` writes: leave it out, or say fleet")
    return _wheel(args)


def _list(args: argparse.Namespace) -> int:
    """All effects, or faults, that there are."""
    from rw_ekf.drivers.sim.fault_text import describe_faults, fault_documents
    from rw_ekf.drivers.sim.plant_effect_text import describe_effects, effect_documents

    of_faults = {"schema": "rw_ekf.simulated_faults/1", "faults": fault_documents()}
    of_effects = {"schema": "rw_ekf.simulated_effects/1", "effects": effect_documents()}
    answer(
        args,
        lambda: of_effects if args.effects else of_faults,
        lambda: "\n".join(describe_effects() if args.effects else describe_faults()),
    )
    return 0


def _fleet(args: argparse.Namespace) -> int:
    from rw_ekf.errors import UsageError
    from rw_ekf.fleet.fleet_api import simulate

    if args.out is None:
        raise UsageError("--out DIR is missing: where the fleet's logs shall be written")
    if args.link is not None:
        raise UsageError("--link is of one wheel: a fleet is written into --out DIR")
    if args.workers is not None and args.workers < 1:
        raise UsageError(f"--workers {args.workers}: give 1 or more")
    document = simulate(args.out, wheels=args.wheels, days=args.days, seed=args.seed, workers=args.workers)
    text = f"{args.out}: {document['logs']} logs of {document['wheels']} wheels, their truth in truth.json"
    answer(args, lambda: document, lambda: text)
    return 0


def _wheel(args: argparse.Namespace) -> int:
    from rw_ekf.attach.simulated import plant_of, with_own_formulas
    from rw_ekf.attach.wire import load_protocol, spoken_by
    from rw_ekf.commands.inputs import read_own_formulas
    from rw_ekf.drivers.sim.fault_text import parse_faults
    from rw_ekf.errors import BadInputError
    from rw_ekf.units import rad_s_from_rpm

    if not 0.0 < args.speed_factor <= 1000.0:
        raise BadInputError(f"--speed-factor {args.speed_factor:g}: give a number above 0, up to 1000")
    if args.seed < 0:
        raise BadInputError(f"--seed {args.seed}: a seed is not negative")
    if not abs(args.initial_speed_rpm) <= MAX_SPEED_RPM:
        raise BadInputError(f"--initial-speed-rpm {args.initial_speed_rpm:g}: give at most {MAX_SPEED_RPM:g} rpm")
    configurations = _configurations(args)
    args.link = args.link or _port_of(configurations)
    if len(configurations) > 1:
        return _bus(args, configurations)
    faults = parse_faults(args.fault)
    configuration = configurations[0] if configurations else None
    wanted = [text for group in args.effect for text in group]
    effects, law, numbers = with_own_formulas(wanted, read_own_formulas(args.effect_file))
    plant = plant_of(configuration, effects)
    noise = _noise(configuration)
    protocol = load_protocol("sunspace-wheel") if configuration is None else spoken_by(configuration)

    def ready(device: str) -> None:
        document = {
            "schema": "rw_ekf.simulation/1",
            "link": args.link,
            "device": device,
            "seed": args.seed,
            "speed_factor": args.speed_factor,
            "truth": plant._asdict() | numbers,
            "noise": noise._asdict(),
            "faults": [fault.text for fault in faults],
        }
        answer(args, lambda: document, lambda: f"simulated wheel at {args.link} ({device}); Ctrl-C ends it")

    protocol.serve(
        plant,
        args.link,
        seed=args.seed,
        speed_factor=args.speed_factor,
        noise=noise,
        initial_speed_rad_s=rad_s_from_rpm(args.initial_speed_rpm),
        on_ready=ready,
        faults=faults,
        **law,
    )
    return 0


def _configurations(args: argparse.Namespace) -> tuple[Configuration, ...]:
    """Of the wheels that are to be served; none where none is named."""
    from rw_ekf.commands.inputs import refuse_wheel_of_nothing
    from rw_ekf.settings.load import load_configurations, one_of_wheels

    refuse_wheel_of_nothing(args)
    if args.config is None:
        return ()
    found = load_configurations(args.config)
    return found if args.wheel is None else (one_of_wheels(found, args.config, args.wheel),)


def _port_of(configurations: tuple[Configuration, ...]) -> str:
    """Where the daemon of a configuration, else of the shipped one, looks for its wheel.

    Raises UsageError where that is a device.
    """
    from rw_ekf.errors import UsageError
    from rw_ekf.settings.load import load_configurations

    port = (configurations or load_configurations("simulated"))[0].wheel.port
    if not Path(port).is_absolute() or Path(port).is_relative_to("/dev"):
        raise UsageError(f"--link PATH is missing: the configuration's port, {port}, is not a simulated wheel's")
    return port


def _noise(configuration: Configuration | None) -> PlantNoise:
    from rw_ekf.drivers.sim.plant_parameters import PlantNoise
    from rw_ekf.units import rad_s_from_rpm

    if configuration is None:
        return PlantNoise()
    truth = configuration.simulation
    return PlantNoise(rad_s_from_rpm(truth.speed_noise_rpm), rad_s_from_rpm(truth.acceleration_noise_rpm_per_sqrt_s))


def _bus(args: argparse.Namespace, configurations: tuple[Configuration, ...]) -> int:
    """All wheels of a configuration behind one tty, each with a noise of its own."""
    from rw_ekf.attach.simulated import plant_of, serve_bus, with_own_formulas
    from rw_ekf.attach.wire import beyond_line, spoken_by
    from rw_ekf.commands.inputs import read_own_formulas
    from rw_ekf.drivers.sim.fault_text import parse_bus_faults
    from rw_ekf.errors import ConfigError
    from rw_ekf.units import rad_s_from_rpm

    names = [configuration.wheel.name for configuration in configurations]
    of_line, of_wheel = parse_bus_faults(args.fault, names)
    protocols = [spoken_by(configuration) for configuration in configurations]
    wrong = [text for _, _, text in beyond_line(configurations, protocols)]
    if wrong:
        raise ConfigError(wrong)
    wanted = [text for group in args.effect for text in group]
    effects, law, numbers = with_own_formulas(wanted, read_own_formulas(args.effect_file))
    wheels = []
    for index, (configuration, protocol) in enumerate(zip(configurations, protocols, strict=True)):
        own: dict[str, Any] = {
            "seed": args.seed + index,
            "noise": _noise(configuration),
            "initial_speed_rad_s": rad_s_from_rpm(args.initial_speed_rpm),
            "faults": of_wheel[names[index]],
            **law,
        }
        wheels.append((protocol, plant_of(configuration, effects), own))

    def ready(device: str) -> None:
        reported = [
            {
                "wheel": name,
                "seed": own["seed"],
                "truth": plant._asdict() | numbers,
                "noise": own["noise"]._asdict(),
                "faults": [fault.text for fault in own["faults"]],
            }
            for name, (_, plant, own) in zip(names, wheels, strict=True)
        ]
        document = {
            "schema": "rw_ekf.bus_simulation/1",
            "link": args.link,
            "device": device,
            "speed_factor": args.speed_factor,
            "faults": [fault.text for fault in of_line],
            "wheels": reported,
        }
        text = f"simulated wheels {', '.join(names)} at {args.link} ({device}); Ctrl-C ends them"
        answer(args, lambda: document, lambda: text)

    baud = configurations[0].wheel.baud
    serve_bus(wheels, args.link, of_line, args.seed, baud, speed_factor=args.speed_factor, on_ready=ready)
    return 0
