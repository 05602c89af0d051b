"""Writers for a run: one line per sample and per estimate, on its way to the disk at once.

A line is handed to the operating system as it is written, so that whatever ends the run leaves a log that reads.
Numbers are written with repr: the shortest text that reads back as the very same float.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from pathlib import Path
from types import TracebackType
from typing import Self

from rw_ekf.errors import BadInputError
from rw_ekf.logs.wheel_log import LOG_COLUMNS
from rw_ekf.records import IssuedCommand, Outcome, StepResult, WheelSample

STATE_KEYS = ("speed_rad_s", "motor_gain", "viscous", "coulomb", "static")
INNOVATION_COLUMNS = ("innovation_rad_s", "innovation_std_rad_s", "nis", "accepted", "reason")


def cell(value: float | str | None) -> str:
    """Text of one CSV field; None and NaN are empty. Infinity too: a log that holds it could not be read again."""
    if value is None:
        return ""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, float):
        return repr(float(value)) if math.isfinite(value) else ""
    text = str(value)
    return '"' + text.replace('"', '""') + '"' if any(mark in text for mark in ',"\r\n') else text


class RowWriter:
    """A CSV file that grows by whole lines. Never overwrites: a log that exists is someone's data."""

    def __init__(self, path: str | Path, columns: Iterable[str]) -> None:
        self.path = Path(path)
        self.columns = tuple(columns)
        try:
            self._stream = self.path.open("x", encoding="utf-8", newline="")
        except FileExistsError:
            raise BadInputError(f"{path}: exists already and is not overwritten: choose another name") from None
        except (OSError, ValueError) as error:
            reason = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
            raise BadInputError(f"{path}: cannot be written ({reason})") from None
        self.write_row(self.columns)

    def write_row(self, values: Iterable[float | str | None]) -> None:
        """Write one line; values in the order of `columns`."""
        self._stream.write(",".join(map(cell, values)) + "\n")
        self._stream.flush()

    def close(self) -> None:
        """Close the file. Safe to call twice."""
        self._stream.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self.close()


class SampleWriter(RowWriter):
    """The log of a run, columns of docs/logs.md in a fixed order."""

    def __init__(self, path: str | Path) -> None:
        super().__init__(path, LOG_COLUMNS)

    def write(self, sample: WheelSample, command: IssuedCommand | None) -> None:
        """Write one sample and the command that followed it; None: nothing was written, telemetry's stands."""
        self.write_row(
            (
                sample.time_s,
                sample.speed_rad_s,
                sample.current_command_A if command is None else command.current_A,
                sample.current_A,
                0.0 if command is None else command.delay_s,
                sample.segment,
                sample.temperature_degC,
                sample.pressure_Pa,
                sample.bus_voltage_V,
                sample.angle_rad,
                sample.status,
            )
        )


class EstimateWriter(RowWriter):
    """What the filter said after each sample: state, standard deviations, and the test of the sample."""

    def __init__(self, path: str | Path, state_keys: tuple[str, ...] = STATE_KEYS) -> None:
        super().__init__(path, estimate_columns(state_keys))
        self.state_keys = state_keys

    def write(self, result: StepResult) -> None:
        """Write one result. Raises ValueError if it has another number of states than the writer has columns."""
        if len(result.mean) != len(self.state_keys) or len(result.std) != len(self.state_keys):
            raise ValueError(f"{len(result.mean)} states for {len(self.state_keys)} columns")
        test = result.innovation
        self.write_row(
            (
                result.time_s,
                *result.mean,
                *result.std,
                None if test is None else test.innovation_rad_s,
                None if test is None else test.std_rad_s,
                None if test is None else test.nis,
                result.outcome in (Outcome.UPDATED, Outcome.FIRST),
                result.outcome.value if test is None else test.reason,
            )
        )


def estimate_columns(state_keys: tuple[str, ...] = STATE_KEYS) -> tuple[str, ...]:
    """Columns of an estimates file, in order."""
    return ("time_s", *state_keys, *(f"std_{key}" for key in state_keys), *INNOVATION_COLUMNS)
