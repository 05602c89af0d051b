"""A run beside a lab's own controller: what it commands is known from telemetry, a tick later."""

from __future__ import annotations

from collections.abc import Iterator

from rw_ekf.live.loop import Issue
from rw_ekf.records import IssuedCommand, Reading, Tick


def with_following_command(readings: Iterator[Reading]) -> Iterator[tuple[Reading, IssuedCommand | None]]:
    """Pair each reading with the command that telemetry reports at the next one, a tick later.

    Beside another controller the command of an interval is known only at its end: what a reading reports as in force
    was set after the reading before. Readings wait over ticks without a reply, except for those without a sample, which
    are told at once. The last is dropped: nothing is known of what followed.
    """
    waiting: list[Reading] = []
    for reading in readings:
        sample = reading.sample
        if sample is None:
            yield reading, None
            continue
        current = sample.current_command_A if sample.current_command_A is not None else sample.current_A
        if current is not None:
            for before in waiting:
                yield before, IssuedCommand(current)
            waiting.clear()
        waiting.append(reading)


def following(readings: Iterator[Reading]) -> tuple[Iterator[Reading], Issue]:
    """Readings a tick late, and what says for each the command that telemetry reported after it."""
    latest: list[IssuedCommand | None] = []

    def walk() -> Iterator[Reading]:
        for reading, command in with_following_command(readings):
            latest[:] = [command]
            yield reading

    def issue(tick: Tick) -> IssuedCommand | None:
        return latest[0]

    return walk(), issue
