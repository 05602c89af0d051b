"""`rw-ekf export-model`: the estimator of a model as C99, for a flight computer."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from rw_ekf.commands.inputs import add_config_option, read_configuration, read_wheel_model

HELP = "the estimator of a model as C99"
EXAMPLE = """example:
  rw-ekf export-model --c flight model.yaml && make -C flight test
  rw-ekf export-model --c flight --float model.yaml"""
_RATE_HZ = 10.0
_FASTEST_HZ = 1.0e5


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("model", metavar="MODEL", help="model YAML, as `fit --out`, `diagnose` or a run writes it")
    parser.add_argument("--c", metavar="DIR", required=True, help="folder to write to; files of an export are replaced")
    parser.add_argument("--float", dest="single", action="store_true", help="single precision")
    parser.add_argument("--rate-hz", type=float, metavar="R", help=f"of readings; default {_RATE_HZ:g}, or --config's")
    add_config_option(parser, "noises, gate and gap as the daemon has them; without it the model's own")


def execute(args: argparse.Namespace) -> int:
    """Run the verb; raises RwEkfError."""
    from rw_ekf.errors import BadInputError
    from rw_ekf.filter.constants import DEFAULT_ACCELERATION_NOISE, DEFAULT_SPEED_NOISE_RAD_S
    from rw_ekf.flight.c_export import export_c
    from rw_ekf.json_output import print_json
    from rw_ekf.starting_point import setup_of_configuration, setup_of_model

    if args.rate_hz is not None and not 0.0 < args.rate_hz <= _FASTEST_HZ:
        raise BadInputError(f"--rate-hz {args.rate_hz:g}: give readings per second, above 0, up to {_FASTEST_HZ:g}")
    configuration = read_configuration(args)
    model = read_wheel_model(args.model, configuration)
    assert model is not None
    if configuration is not None:
        period_s = 1.0 / (args.rate_hz or configuration.loop.rate_hz)
        setup = setup_of_configuration(configuration, model, period_s)
    else:
        period_s = 1.0 / (args.rate_hz or _RATE_HZ)
        setup = setup_of_model(model, DEFAULT_SPEED_NOISE_RAD_S, DEFAULT_ACCELERATION_NOISE, period_s)
    for remark in model.remarks:
        sys.stderr.write(f"warning: {remark}\n")
    found = export_c(setup, Path(args.model).name, Path(args.c), period_s, single=args.single)
    if args.json:
        print_json(found)
        return 0
    sys.stdout.write(
        f"{args.c}: {', '.join(found['files'])}\n"
        f"  {len(found['states'])} states, {found['precision']}; {found['estimator_bytes']} bytes of memory, "
        f"{found['constant_bytes']} of constants, at most {found['statements_at_most']:,} statements a reading\n"
        f"  make -C {args.c} test\n"
    )
    return 0
