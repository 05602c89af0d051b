"""A record as if it were a wheel: yields its samples at once, takes no commands."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from rw_ekf.errors import EndOfRecord
from rw_ekf.records import IssuedCommand, LinkCounters, WheelIdentity, WheelSample


class ReplayWheel:
    """A WheelDriver over (sample, command in force after it) pairs, as loaded from a log.

    `command_current` ignores what is requested and returns what was logged with the sample read last: the same loop
    that flew runs over the record, and the model is driven by what truly went to the wheel.
    """

    def __init__(
        self, rows: Iterable[tuple[WheelSample, IssuedCommand]], name: str, identity: WheelIdentity | None = None
    ) -> None:
        self.source = f"replay+{name}"
        self.link = LinkCounters()
        self.identity = identity
        self._rows: Iterator[tuple[WheelSample, IssuedCommand]] = iter(rows)
        self._command = IssuedCommand(0.0)

    def read(self, timeout_s: float) -> WheelSample | None:
        """The next sample of the record, at once. Raises EndOfRecord behind the last one."""
        row = next(self._rows, None)
        if row is None:
            raise EndOfRecord(self.source)
        sample, self._command = row
        return sample

    def command_current(self, current_A: float) -> IssuedCommand:
        """The command logged with the sample read last; `current_A` goes nowhere."""
        return self._command

    def stop_current(self, by: str | None = None) -> IssuedCommand:
        """The command logged with the sample read last."""
        return self.command_current(0.0)

    def close(self) -> None:
        """Let go of the record."""
        self._rows = iter(())
