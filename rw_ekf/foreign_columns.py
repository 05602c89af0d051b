"""The columns of a foreign log, guessed: the map, the open questions, and whether the log moves as a machine does."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path
from typing import Any

from rw_ekf.checking.paths import path_of
from rw_ekf.errors import BadInputError, RwEkfError
from rw_ekf.identify.misread import motion_of, unexplained, warnings_of
from rw_ekf.logs.atomic import write_text
from rw_ekf.logs.column_guess import guess_columns
from rw_ekf.logs.column_map import ColumnMap
from rw_ekf.logs.column_records import Guess, Line
from rw_ekf.logs.map_text import comment, map_of_guess, map_text
from rw_ekf.logs.reader import log_of_table, map_of, read_table, table_in_memory
from rw_ekf.logs.wheel_log import WheelLog
from rw_ekf.result_display import Shown

COLUMNS_SCHEMA = "rw_ekf.columns/1"


@dataclass(eq=False, frozen=True, repr=False)
class GuessedColumns(Shown):
    """A column map for a log, as far as it can be guessed."""

    log: str
    guess: Guess
    doubts: tuple[str, ...] = ()  # what its motion says against it
    warnings: tuple[str, ...] = ()

    @property
    def column_map(self) -> ColumnMap:
        """The map, to read the log with. Raises BadInputError while a question is open."""
        if not self.guess.is_certain:
            raise BadInputError(f"{self.log}: not certain: {'; '.join(item.text for item in self.guess.questions)}")
        return map_of_guess(self.guess, self.log)

    @property
    def is_certain(self) -> bool:
        """Whether nothing that a log needs is left open, and its motion does not speak against the map."""
        return self.guess.is_certain and not self.doubts

    def document(self) -> dict[str, Any]:
        """The JSON document of `rw-ekf columns`."""
        return {
            "schema": COLUMNS_SCHEMA,
            "log": self.log,
            "certain": self.is_certain,
            "map": self.guess.mapping(),
            "columns": [_stated(line) for line in self.guess.lines],
            "questions": [
                {
                    "name": item.name,
                    "text": item.text,
                    "answers": [_stated(answer) for answer in item.answers],
                }
                for item in self.guess.questions
            ],
            "doubts": list(self.doubts),
            "notes": [*self.guess.warnings, *self.guess.notes],
            "warnings": list(self.warnings),
            "out": None,
        }

    def text(self) -> str:
        """The map as YAML; open questions, and what the motion speaks against, are comments."""
        doubts = "".join(f"{comment(f'DOUBTED: {doubt}')}\n" for doubt in self.doubts)
        return map_text(self.guess, self.log) + doubts

    def save(self, path: str | Path) -> None:
        """Write the map. Raises BadInputError."""
        write_text(path, self.text())

    def __repr__(self) -> str:
        return f"GuessedColumns({self.log!r}, {'certain' if self.is_certain else 'with questions'})"


def doubted(log: WheelLog) -> WheelLog:
    """A log whose columns were guessed, with what its motion speaks against among its warnings."""
    motion = motion_of(log)
    return replace(log, warnings=(*log.warnings, *warnings_of(motion.misread), *unexplained(motion)))


def _stated(line: Line) -> dict[str, object]:
    return {"name": line.name, "from": line.entry, "why": line.why}


def guessed_columns(source: Any, answers: Mapping[str, str], given: ColumnMap | str | Path | None) -> GuessedColumns:
    """Guess the map of a log, by its path, or of a table in memory.

    given: how it is laid out, in a map without columns. Raises LogError, ConfigError.
    """
    layout = map_of(given)
    of_file = isinstance(source, str | PathLike)
    table = read_table(path_of(source, "a log"), layout) if of_file else table_in_memory(source)
    path = source if of_file else table.path
    guess = guess_columns(table, dict(answers), layout)
    warnings = tuple(table.warnings)
    if not guess.is_certain:
        return GuessedColumns(str(path), guess, (), warnings)
    try:
        log = log_of_table(table, map_of_guess(guess, str(path)))
        motion = motion_of(log)
        doubts, wanted = motion.misread or unexplained(motion), motion.wanted
    except RwEkfError as error:
        doubts, wanted = (str(error),), ()
    if guess.says_units:  # then a machine may be of any size
        guess.notes.extend(wanted)
        wanted = ()
    return GuessedColumns(str(path), guess, (*doubts, *wanted), warnings)
