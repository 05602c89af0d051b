"""The command line: verbs, their help, and how errors reach a person."""

from __future__ import annotations

import argparse
import gc
import importlib
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import NoReturn

from rw_ekf.console import (
    STATUS,
    abandon_output,
    nothing_printed,
    open_streams,
    printable_streams,
    settle_errors,
)
from rw_ekf.errors import ConfigError, RwEkfError, UsageError
from rw_ekf.one_thread import ask_for_one_thread
from rw_ekf.version import __version__

# Objects made between two looks for cycles. With the usual 700 they cost a short verb a fifteenth of its time, most of
# it while modules are imported, and a diagnosis a twentieth; neither leaves cycles to speak of.
_COLLECT_AFTER = 100_000

VERBS = {
    "run": "run",
    "simulate": "simulate",
    "excite": "excite",
    "replay": "replay",
    "fit": "fit",
    "diagnose": "diagnose",
    "compare": "compare",
    "commission": "commission",
    "init": "init",
    "check-config": "check_config",
    "columns": "columns",
    "export": "export",
    "export-model": "export_model",
    "compile": "compile",
    "stop": "stop",
    "status": "status",
    "view": "view",
    "watch": "watch",
    "install-service": "install_service",
    "bench": "bench",
    "flyby": "flyby",
    "spikes": "spikes",
    "fleet": "fleet",
}


class _Parser(argparse.ArgumentParser):
    """Its mistakes end like any other bad input, behind the usage."""

    def error(self, message: str) -> NoReturn:
        self.print_usage(sys.stderr)
        raise UsageError(message)


def build_parser() -> argparse.ArgumentParser:
    """Return the parser with every verb; nothing heavy is imported."""
    parser = _Parser(
        prog="rw-ekf",
        description="Online estimator for reaction wheels: speed, motor gain and bearing friction.",
        epilog="`rw-ekf help VERB` shows a verb's options and an example, `rw-ekf help --man` a manual page, "
        "`rw-ekf help --completion bash` (zsh, tcsh) a script for the shell. Start with `rw-ekf simulate` or docs/.",
    )
    _add_verbose(parser)
    parser.add_argument("-V", "--version", action="version", version=f"rw-ekf {__version__}")
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
        _add_verbose(sub)
        sub.set_defaults(execute=module.execute)
    return parser


def _add_verbose(parser: argparse.ArgumentParser) -> None:
    """Add -v, before a verb and behind it."""
    what = "say what is done, on standard error"
    parser.add_argument("-v", "--verbose", action="store_true", default=argparse.SUPPRESS, help=what)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one verb; returns the exit status: 0 done, 1 failed in the work, 2 wrong usage or bad input."""
    ask_for_one_thread()
    gc.set_threshold(_COLLECT_AFTER, *gc.get_threshold()[1:])
    open_streams()
    try:
        with printable_streams():
            return _main(arguments)
    finally:
        settle_errors()


def _main(arguments: Sequence[str] | None) -> int:
    words = list(sys.argv[1:] if arguments is None else arguments)
    if words[:1] == ["help"] and words[1:2] in (["--man"], ["--completion"]):
        return _described(words[1:])
    as_json = any(word.startswith("--j") and "--json".startswith(word) for word in words)
    try:
        args = _parsed(words)
        STATUS.tells = "verbose" in args
        began_s = time.monotonic()
        STATUS.tell(f"{args.verb} of rw-ekf {__version__}, by Python {sys.version.split()[0]}, in {Path.cwd()}")
        status = args.execute(args)
        sys.stdout.flush()
        STATUS.tell(f"{args.verb} took {time.monotonic() - began_s:.2f} s")
        return int(status)
    except ConfigError as error:
        return _fail(error.kind, error.findings, error.exit_status, as_json=as_json)
    except RwEkfError as error:
        return _fail(error.kind, [str(error)], error.exit_status, as_json=as_json)
    except BrokenPipeError:
        abandon_output()  # its reader has gone (`| head`); leave without Python's complaint at exit
        return 1
    except OSError as error:
        stated = f"{error.filename or 'standard output'}: {error.strerror or error}"
        return _fail("system", [stated], 1, as_json=as_json)
    except KeyboardInterrupt:
        return _fail("interrupted", ["interrupted"], 130, as_json=as_json)
    except MemoryError:
        return _fail("memory", ["not enough memory for this; take a shorter log"], 1, as_json=as_json)


def _described(words: list[str]) -> int:
    """The manual page, or a shell's completion, on standard output."""
    from rw_ekf.man_page import completion, man_page

    try:
        parser = build_parser()
        text = man_page(parser, __version__) if words[0] == "--man" else completion(parser, *words[1:2] or [""])
        sys.stdout.write(text)
        sys.stdout.flush()
    except UsageError as error:
        return _fail(error.kind, [str(error)], error.exit_status, as_json=False)
    except BrokenPipeError:
        abandon_output()
        return 1
    return 0


def _parsed(words: list[str]) -> argparse.Namespace:
    """The arguments of a verb. Raises UsageError, SystemExit behind a help."""
    if words[:1] == ["help"]:
        words = [*words[1:2], "--help"]
    parser = build_parser()
    if words and words[0] not in VERBS and not words[0].startswith("-"):
        from rw_ekf.checking.wording import suggestion

        parser.error(f"there is no verb {words[0]!r}: {suggestion(words[0], VERBS)}")
    return parser.parse_args(words)


def _fail(kind: str, messages: Sequence[str], status: int, *, as_json: bool) -> int:
    """Say what is wrong, and as a document too where one was requested and none is there yet."""
    for text in messages:
        sys.stderr.write(f"rw-ekf: {'' if kind == 'interrupted' else 'error: '}{text}\n")
    try:
        if as_json and nothing_printed():
            from rw_ekf.json_output import print_json

            error = {"kind": kind, "messages": list(messages)}
            print_json({"schema": "rw_ekf.error/1", "error": error, "exit_status": status})
        sys.stdout.flush()
    except OSError:
        abandon_output()  # it is standard output that cannot be written
    return status


if __name__ == "__main__":
    sys.exit(main())
