"""The command line described for others: as a manual page, and to a shell that completes it."""

from __future__ import annotations

import argparse

from rw_ekf.errors import UsageError

SHELLS = ("bash", "zsh", "tcsh")


def verbs_of(parser: argparse.ArgumentParser) -> dict[str, argparse.ArgumentParser]:
    """The verbs' own parsers, by name."""
    actions = [action for action in parser._actions if isinstance(action, argparse._SubParsersAction)]
    return dict(actions[0].choices)


def man_page(parser: argparse.ArgumentParser, version: str) -> str:
    """A page for `man`, from the help that the verbs have; roff."""
    lines = [f'.TH RW-EKF 1 "" "rw-ekf {version}" "User Commands"', ".SH NAME"]
    lines += [f"{parser.prog} \\- {_plain(parser.description or '')}", ".SH SYNOPSIS", f"{parser.prog} VERB [OPTIONS]"]
    lines.append(".SH COMMANDS")
    for name, verb in verbs_of(parser).items():
        lines += [f".SS {name}", ".nf", *map(_plain, verb.format_help().splitlines()), ".fi"]
    return "\n".join(lines) + "\n"


def completion(parser: argparse.ArgumentParser, shell: str) -> str:
    """A script that lets a shell complete verbs and options. Raises UsageError without shtab, or for another shell."""
    if shell not in SHELLS:
        raise UsageError(f"there is no completion for {shell!r}: say one of {', '.join(SHELLS)}")
    try:
        import shtab
    except ImportError:
        raise UsageError("completion needs shtab: pip install 'rw-ekf[completion]'") from None
    script: str = shtab.complete(parser, shell=shell)
    return script


def _plain(line: str) -> str:
    """A line as it stands, which roff would read as something else."""
    text = line.replace("\\", "\\e").replace("-", "\\-")
    return "\\&" + text if text[:1] in (".", "'") else text
