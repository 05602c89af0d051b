"""The column map of a guess: what a reader goes on with, or why it does not."""

from __future__ import annotations

from dataclasses import replace

from rw_ekf.checking.yaml_loader import parse_yaml
from rw_ekf.errors import LogError
from rw_ekf.logs.column_guess import guess_columns
from rw_ekf.logs.column_map import ColumnMap
from rw_ekf.logs.column_records import Guess
from rw_ekf.logs.map_text import map_text, said_in_a_line
from rw_ekf.logs.raw_table import RawTable


class UncertainColumnsError(LogError):
    """What the columns of a table are cannot be told."""


def map_of_guess(guess: Guess, log: str, given: ColumnMap) -> ColumnMap:
    """The map that the text of a guess is read as; how the file is laid out stays as it was given."""
    from rw_ekf.logs.column_map_file import column_map_from

    found = column_map_from(parse_yaml(map_text(guess, log) + "{}\n" * (not guess.mapping()), f"columns of {log}"))
    return replace(found, csv=given.csv, decimate=given.decimate, reverse=given.reverse, variable=given.variable,
                   layout=given.layout, dbc=given.dbc)  # fmt: skip


def guessed_map(table: RawTable, given: ColumnMap) -> ColumnMap:
    """The map of a table that lacks a log's own columns, with a warning that says what it takes for what.

    Raises UncertainColumnsError, with the questions, where the file leaves something open.
    """
    guess = guess_columns(table)
    if not guess.is_certain:
        raise UncertainColumnsError("; ".join(question.text for question in guess.questions))
    table.warnings.append(
        f"{table.path}: read as {said_in_a_line(guess)}; `rw-ekf columns` writes that down, with reasons"
    )
    return map_of_guess(guess, table.path, given)
