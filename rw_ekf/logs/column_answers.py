"""What was answered on the command line: `--set current=3`, `--set current.unit=mA`, `--set rate_hz=100`."""

from __future__ import annotations

import math

from rw_ekf.errors import LogError
from rw_ekf.logs.column_records import Guess
from rw_ekf.logs.log_columns import READABLE_COLUMNS
from rw_ekf.logs.raw_table import RawTable

_SHORT = {
    "time": "time_s",
    "speed": "speed_rad_s",
    "current": "current_A",
    "angle": "angle_rad",
    "temperature": "temperature_degC",
}


class Answers:
    """What was given with `--set`: `current=3`, `current.unit=mA`, `speed.scale=-1`."""

    def __init__(self, given: dict[str, str], table: RawTable) -> None:
        self._table = table
        self.columns: dict[str, int | None] = {}
        self.more: dict[str, dict[str, object]] = {}
        self.only: tuple[str | int, str] | None = None  # a column, and which of its values
        self.rate: tuple[float, str] | None = None  # of the rows [Hz], where there is no column of time
        for key, value in given.items():
            if key == "rate_hz":
                self.rate = _rate(value), f"--set rate_hz={value}"
                continue
            name, _, part = key.partition(".")
            name = _SHORT.get(name, name)
            if key == "only":
                column, _, wanted = value.rpartition(":")
                self.only = table.names[self._number(column, key)] or self._number(column, key), wanted
                continue
            if name not in READABLE_COLUMNS:
                raise LogError(f"--set {key}={value}: {name} is none of a log's columns: {', '.join(READABLE_COLUMNS)}")
            if part:
                self.more.setdefault(name, {})[part] = _value(value)
            else:
                column, _, unit = value.partition(":")
                self.columns[name] = None if column == "none" else self._number(column, key)
                if unit:
                    self.more.setdefault(name, {})["unit"] = unit
        self._refuse_one_for_two()

    def _refuse_one_for_two(self) -> None:
        """Raise LogError where one column was given for two of what a log cannot do without."""
        given: dict[int, str] = {}
        for name, number in self.columns.items():
            of = next((of for of in ("time", "speed", "current") if name.startswith(of)), None)
            if of is not None and number is not None and given.setdefault(number, of) != of:
                column = self._table.names[number] or number
                raise LogError(f"--set {of}={column}: that column is the {given[number]} already: it cannot be both")

    def _number(self, text: str, key: str) -> int:
        if text in self._table.names:
            return self._table.names.index(text)
        if text.isdigit() and int(text) < len(self._table.names):
            return int(text)
        raise LogError(
            f"--set {key}={text}: {self._table.path} has no such column; by name: {self._table.described_columns()}; "
            f"by number: 0 to {len(self._table.names) - 1}"
        )

    def of(self, *names: str) -> tuple[str, int | None] | None:
        """Which column was given for one of these."""
        return next(((name, self.columns[name]) for name in names if name in self.columns), None)

    def has(self, name: str) -> bool:
        """Whether a column was given for what a line is called, in whichever unit."""
        return self.of(*(("speed_rad_s", "speed_rpm") if name.startswith("speed_") else (name,))) is not None

    def unit(self, *names: str) -> str:
        """Which unit was given for one of these."""
        return next((str(self.more[name]["unit"]) for name in names if "unit" in self.more.get(name, {})), "")

    def with_more(self, name: str, entry: dict[str, object]) -> dict[str, object]:
        """An entry with what else was given for it."""
        return {**entry, **self.more.get(name, {})}

    def add_certain(self, guess: Guess) -> None:
        """Give what was set for columns about which there was no question."""
        known = {line.name for line in guess.lines} | {question.name for question in guess.questions}
        for name, column in self.columns.items():
            taken = any(other == name or (name.startswith("speed_") and other.startswith("speed_")) for other in known)
            if not taken and column is not None and name != "speed_rpm":
                key = self._table.names[column] or column
                guess.take(name, self.with_more(name, {"column": key}), "as it was set")


def _rate(text: str) -> float:
    rate = _value(text)
    if not (isinstance(rate, float) and 0.0 < rate < math.inf):
        raise LogError(f"--set rate_hz={text}: how many rows are a second? A number above zero.")
    return rate


def _value(text: str) -> object:
    try:
        return float(text)
    except ValueError:
        return text
