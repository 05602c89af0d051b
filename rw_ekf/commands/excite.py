"""`rw-ekf excite`: drive a wheel through a published or identification profile, and log it."""

from __future__ import annotations

import argparse

from rw_ekf.commands.run import add_run_options, run_and_report

HELP = "drive a wheel through a profile of [CK13]/[F12], or one made for identification, and log it"
EXAMPLE = """example:
  rw-ekf excite identification --config my-wheel.yaml
  rw-ekf excite P2 --config my-wheel.yaml --seed 3
  rw-ekf excite --settle diagnosis/diagnosis.json --config my-wheel.yaml --dry-run"""
PROFILES = ("P1", "P2", "S1", "S2", "S3", "S4", "S5", "identification", "sine", "steps", "random-sines", "zero")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("profile", metavar="PROFILE", nargs="?", choices=PROFILES, help=", ".join(PROFILES))
    parser.add_argument(
        "--settle",
        metavar="DIAGNOSIS",
        help="in place of a profile: two minutes designed to tell apart what this diagnosis.json left open",
    )
    parser.add_argument("--dry-run", action="store_true", help="with --settle: show the design, move nothing")
    parser.add_argument(
        "--seed", type=int, help="seed of the random profiles, default: the configuration's; of the search, default: 1"
    )
    add_run_options(parser)


def execute(args: argparse.Namespace) -> int:
    """Run the verb; raises RwEkfError."""
    from rw_ekf.errors import BadInputError
    from rw_ekf.settings.load import load_configuration
    from rw_ekf.settings.schema import CompensationSection

    if (args.profile is None) == (args.settle is None):
        raise BadInputError("excite: name either a PROFILE or --settle diagnosis.json")
    if args.dry_run and args.settle is None:
        raise BadInputError("--dry-run: only with --settle diagnosis.json, whose design it shows")
    configuration = load_configuration(args.config, args.wheel)
    if args.seed is not None and args.seed < 0:
        raise BadInputError(f"--seed {args.seed}: a seed is not negative")
    if args.settle is not None:
        from rw_ekf.commands.settle import settle

        return settle(configuration, args)
    change = {"profile": args.profile, "log": None}
    if args.seed is not None:
        change["seed"] = args.seed
    command = configuration.command.model_copy(update=change)
    plain = CompensationSection()  # an excitation shows friction, which compensation would hide
    return run_and_report(configuration.model_copy(update={"command": command, "compensation": plain}), args)
