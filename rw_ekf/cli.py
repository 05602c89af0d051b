"""The command line: verbs, their help, and how errors reach a person."""

from __future__ import annotations

import argparse
import importlib
import sys
from collections.abc import Sequence

from rw_ekf import __version__
from rw_ekf.console import abandon_output, open_streams, printable_streams, settle_errors
from rw_ekf.errors import ConfigError, RwEkfError
from rw_ekf.one_thread import ask_for_one_thread

VERBS = {
    "run": "run",
    "simulate": "simulate",
    "excite": "excite",
    "replay": "replay",
    "fit": "fit",
    "diagnose": "diagnose",
    "check-config": "check_config",
    "columns": "columns",
    "export": "export",
    "stop": "stop",
    "status": "status",
    "install-service": "install_service",
    "bench": "bench",
    "flyby": "flyby",
    "spikes": "spikes",
}


def build_parser() -> argparse.ArgumentParser:
    """Return the parser with every verb; nothing heavy is imported."""
    parser = argparse.ArgumentParser(
        prog="rw-ekf",
        description="Online estimator for reaction wheels: speed, motor gain and bearing friction.",
        epilog="Each verb has its own --help with an example. Start with `rw-ekf simulate` or docs/.",
    )
    parser.add_argument("--version", action="version", version=f"rw-ekf {__version__}")
    verbs = parser.add_subparsers(dest="verb", metavar="VERB", required=True)
    for verb, module_name in VERBS.items():
        module = importlib.import_module(f"rw_ekf.commands.{module_name}")
        sub = verbs.add_parser(
            verb,
            help=module.HELP,
            description=module.HELP[0].upper() + module.HELP[1:] + ".",
            epilog=module.EXAMPLE,
            formatter_class=argparse.RawDescriptionHelpFormatter,
        )
        module.add_arguments(sub)
        sub.add_argument("--json", action="store_true", help="one JSON document on standard output, nothing else there")
        sub.set_defaults(execute=module.execute)
    return parser


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one verb; returns the exit status: 0 done, 1 failed in the work, 2 wrong usage or bad input."""
    ask_for_one_thread()
    open_streams()
    try:
        with printable_streams():
            return _main(arguments)
    finally:
        settle_errors()


def _main(arguments: Sequence[str] | None) -> int:
    try:
        args = build_parser().parse_args(arguments)
        status = args.execute(args)
        sys.stdout.flush()
        return int(status)
    except ConfigError as error:
        return _fail(error, error.findings)
    except RwEkfError as error:
        return _fail(error, [str(error)])
    except BrokenPipeError:
        abandon_output()  # its reader has gone (`| head`); leave without Python's complaint at exit
        return 1
    except OSError as error:
        abandon_output()
        return _fail(RwEkfError(), [f"{error.filename or 'standard output'}: {error.strerror or error}"])
    except KeyboardInterrupt:
        sys.stderr.write("rw-ekf: interrupted\n")
        return 130
    except MemoryError:
        sys.stderr.write("rw-ekf: error: not enough memory for this; take a shorter log\n")
        return 1


def _fail(error: RwEkfError, findings: Sequence[str]) -> int:
    for text in findings:
        sys.stderr.write(f"rw-ekf: error: {text}\n")
    return error.exit_status


if __name__ == "__main__":
    sys.exit(main())
