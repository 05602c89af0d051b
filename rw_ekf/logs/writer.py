"""Writers for a run: one line per sample and per estimate, on its way to the disk at once.

A line is handed to the operating system as it is written, so that whatever ends the run leaves a log that reads. A line
that does not fit on the disk leaves nothing of itself behind, so that what came before reads, and what may come after.
Numbers are written with repr: the shortest text that reads back as the very same float.
"""

from __future__ import annotations

import errno
import math
import os
from collections.abc import Iterable
from pathlib import Path
from types import TracebackType
from typing import Self
from zlib import crc32

from rw_ekf.logs.atomic import begun_file
from rw_ekf.logs.checksums import Block, note_block
from rw_ekf.logs.log_columns import LOG_COLUMNS
from rw_ekf.plain_file import write_whole
from rw_ekf.records import Estimate, IssuedCommand, Outcome, WheelSample

STATE_KEYS = ("speed_rad_s", "motor_gain", "viscous", "coulomb", "static")
_SHORT = 0.99
INNOVATION_COLUMNS = ("innovation_rad_s", "innovation_std_rad_s", "nis", "accepted", "reason")


def cell(value: float | str | None) -> str:
    """Text of one CSV field; None and NaN are empty. Infinity too: a log that holds it could not be read again."""
    if value is None:
        return ""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, float):
        return repr(float(value)).removesuffix(".0") if math.isfinite(value) else ""
    text = str(value)
    return '"' + text.replace('"', '""') + '"' if any(mark in text for mark in ',"\r\n') else text


class RowWriter:
    """A CSV file that grows by whole lines. Never overwrites: a log that exists is someone's data.

    What is written is summed, and the sum noted beside the file whenever it is synced (`rw_ekf.logs.checksums`).
    """

    def __init__(self, path: str | Path, columns: Iterable[str]) -> None:
        """Make the file with its header. Raises BadInputError if it exists, or cannot be made."""
        self.path = Path(path)
        self.columns = tuple(columns)
        self.length = 0  # of the whole lines so far [bytes]
        self.rows = -1  # so far, beside the header
        self.removed = False  # the file has no name any more: nobody would ever read what is added
        self.cut = False  # another program has shortened the file, as logrotate does with copytruncate
        self._noted = Block(0, 0, 0, 0)  # what no checksum has been noted of yet
        self._descriptor: int | None = None
        with begun_file(path) as self._descriptor:
            self.write_row(self.columns)

    def write_row(self, values: Iterable[float | str | None]) -> None:
        """Write one line; values in the order of `columns`.

        Raises OSError if the line cannot be written whole, or if the file has been removed or cut; the next may be
        tried.
        """
        if self._descriptor is None:
            raise OSError(errno.EBADF, "it is closed", str(self.path))
        now = os.fstat(self._descriptor)
        self.removed = now.st_nlink == 0  # the system would keep taking lines
        if self.removed:
            raise OSError(errno.ENOENT, "it has been removed", str(self.path))
        self.cut = self.cut or now.st_size < self.length
        if self.cut:  # a line more would stand without its header
            stated = (
                "another program has cut it (logrotate's copytruncate?): its rows stand in that program's copy alone"
            )
            raise OSError(errno.EIO, stated, str(self.path))
        line = (",".join(map(cell, values)) + "\n").encode()
        write_whole(self._descriptor, line, self.length)
        self.length += len(line)
        self.rows += 1
        unnoted = self._noted
        self._noted = Block(unnoted.begin, self.length, unnoted.lines + line.count(b"\n"), crc32(line, unnoted.crc))

    def sync(self) -> None:
        """Force what was written onto the disk, and note its checksum. Raises OSError."""
        if self._descriptor is None:
            return
        os.fsync(self._descriptor)
        if self.rows > 0 and self._noted.lines > 0 and not (self.removed or self.cut):
            note_block(self.path, self._noted)
            self._noted = Block(self.length, self.length, 0, 0)

    def close(self) -> None:
        """Close the file. Safe to call twice."""
        descriptor, self._descriptor = self._descriptor, None
        if descriptor is not None:
            os.close(descriptor)

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
        self.write_row(sample_values(sample, command))


def sample_values(sample: WheelSample, command: IssuedCommand | None) -> tuple[float | None, ...]:
    """A row of the log, in the order of LOG_COLUMNS."""
    return (
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


class EstimateWriter(RowWriter):
    """What the filter gave after each sample: the test of the sample, and now and then state and standard deviations.

    Between them the state's fields are empty: a replay gives it at every sample. The newest row waits for the next one,
    so that the last row of a file is a full one, as the first is. compensated: there is a column for what a
    compensation of friction added to the current.
    """

    def __init__(
        self,
        path: str | Path,
        state_keys: tuple[str, ...] = STATE_KEYS,
        state_every_s: float = 0.0,
        *,
        compensated: bool = False,
    ) -> None:
        super().__init__(path, (*estimate_columns(state_keys), *(("compensation_A",) if compensated else ())))
        self.state_keys = state_keys
        self._compensated = compensated
        self._every_s = state_every_s * _SHORT  # rows never come quite on time
        self._full_at_s = -math.inf
        self._newest: tuple[Estimate, float | None] | None = None
        self._no_state = (None,) * (2 * len(state_keys))

    def write(self, estimate: Estimate, added_A: float | None = None) -> None:
        """Write the row before this one. Raises ValueError if the number of states is not that of the columns."""
        if len(estimate.values) != len(self.state_keys) or len(estimate.stds) != len(self.state_keys):
            raise ValueError(f"{len(estimate.values)} states for {len(self.state_keys)} columns")
        before, self._newest = self._newest, (estimate, added_A)
        if before is not None:
            began_anew = estimate.outcome in (Outcome.FIRST, Outcome.RESEEDED)
            full = began_anew or not 0.0 <= before[0].time_s - self._full_at_s < self._every_s
            self._write(*before, full=full)

    def finish(self) -> None:
        """Write the row that waits, as a full one. Raises OSError."""
        before, self._newest = self._newest, None
        if before is not None:
            self._write(*before, full=True)

    def _write(self, estimate: Estimate, added_A: float | None, *, full: bool) -> None:
        test = estimate.innovation
        full = full or estimate.outcome in (Outcome.FIRST, Outcome.RESEEDED)
        if full:
            self._full_at_s = estimate.time_s
        states = (*estimate.values, *estimate.stds) if full else self._no_state
        self.write_row(
            (
                estimate.time_s,
                *states,
                None if test is None else test.innovation_rad_s,
                None if test is None or not full else test.std_rad_s,
                None if test is None else test.nis,
                estimate.outcome in (Outcome.UPDATED, Outcome.FIRST),
                estimate.outcome.value if test is None else test.reason,
                *((added_A,) if self._compensated else ()),
            )
        )


def estimate_columns(state_keys: tuple[str, ...] = STATE_KEYS) -> tuple[str, ...]:
    """Columns of an estimates file, in order."""
    return ("time_s", *state_keys, *(f"std_{key}" for key in state_keys), *INNOVATION_COLUMNS)
