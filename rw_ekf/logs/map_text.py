"""A guess as a column map: its text, with questions as comments, and what a reader continues with."""

from __future__ import annotations

from dataclasses import replace

from rw_ekf.checking.yaml_loader import parse_yaml
from rw_ekf.errors import LogError
from rw_ekf.logs.column_guess import guess_columns
from rw_ekf.logs.column_map import ColumnMap, as_written
from rw_ekf.logs.column_records import OF_THE_TABLE, Guess, Line
from rw_ekf.logs.raw_table import RawTable


def map_text(guess: Guess, log: str) -> str:
    """The map as YAML. A question stands where its line would, each answer as a comment to be made a line.

    One about lines that stand already is a key that no reader takes: a map used as it is must not answer by itself.
    """
    out = [comment(f"Columns of {log}, as its names, units and numbers say.")]
    out += map(comment, (*guess.warnings, *guess.notes))
    out += [f"{key}: {as_written(value)}" for key, value in guess.options.items()]
    for line in guess.lines:
        out.append(_entry(line) + (f"    {comment(line.why)}" if line.why else ""))
    for question in guess.questions:
        then = " Make one of these a line of this map:" if question.answers else ""
        out.append(comment(f"ASKED: {question.text}{then}"))
        out += [comment(_entry(answer)) for answer in question.answers]
    standing = {*OF_THE_TABLE, *(line.name for line in guess.lines)}
    if open_still := " ".join(question.text for question in guess.questions if question.name in standing):
        out.append(f"asked: {as_written(open_still)}")
    return "\n".join(out) + "\n"


def comment(text: str) -> str:
    """A text as one comment of YAML, whatever ends of lines a name has: a sheet's header goes over several."""
    return f"# {' '.join(text.split())}"


def in_one_line(guess: Guess) -> str:
    """What was taken for what, for one line of output."""
    taken = ", ".join(f"{line.name} = {_short(line)}" for line in guess.lines)
    rest = "".join(f", {key} {value}" for key, value in guess.options.items())
    return taken + rest


def _short(line: Line) -> str:
    entry = line.entry
    if "constant" in entry:
        return f"{entry['constant']:g} throughout"
    column = entry.get("column", entry.get("derivative_of"))
    shown = f"'{column}'" if isinstance(column, str) else f"column {column}"
    more = [
        str(value) if key == "unit" else f"{key} {value}"
        for key, value in entry.items()
        if key not in {"column", "derivative_of"}
    ]
    return ("rate of " if "derivative_of" in entry else "") + shown + (f" ({', '.join(more)})" if more else "")


def _entry(line: Line) -> str:
    return f"{line.name}: {{{', '.join(f'{key}: {as_written(value)}' for key, value in line.entry.items())}}}"


class UncertainColumnsError(LogError):
    """The columns of a table cannot be identified; `known`: those that can, under other names than a log's."""

    known = ""


def map_of_guess(guess: Guess, log: str) -> ColumnMap:
    """The map that the text of a guess is read as."""
    from rw_ekf.logs.column_map_file import column_map_from

    return column_map_from(parse_yaml(map_text(guess, log) + "{}\n" * (not guess.mapping()), f"columns of {log}"))


def guessed_map(table: RawTable, given: ColumnMap) -> ColumnMap:
    """The map of a table that lacks a log's own columns, with a warning that says what it takes for what.

    Raises UncertainColumnsError, with the questions, where the file leaves something open.
    """
    guess = guess_columns(table, None, given)
    if not guess.is_certain:
        error = UncertainColumnsError("; ".join(question.text for question in guess.questions))
        error.known = in_one_line(guess) if {line.name for line in guess.lines} - {*table.names} else ""
        raise error
    table.warnings.append(
        f"{table.path}: read as {in_one_line(guess)}; `rw-ekf columns` writes that down, with reasons"
    )
    table.warnings += [f"{table.path}: {text}" for text in guess.warnings]
    return replace(map_of_guess(guess, table.path), guessed=True)
