"""What is said of commands that are not what was asked for."""

from __future__ import annotations

from typing import Any

from rw_ekf.live.command_acceptance import ChangedCommands
from rw_ekf.records import IssuedCommand


def test_a_reason_that_comes_and_goes_is_said_once_and_counted() -> None:
    """Over the limit in every second turn of an hour, unconfirmed in some: an event each, and one of how often."""
    stated: list[tuple[str, Any, Any]] = []
    changed = ChangedCommands(lambda event, **of: stated.append((event, of["reason"], of.get("times"))))
    for turn in range(36000):
        reason = "over_speed" if turn % 2 == 0 else "timeout" if turn % 7 == 0 else None
        changed.take(IssuedCommand(0.0, reason=reason), 0.1 * turn)
    assert stated == [("command_changed", "over_speed", None), ("command_changed", "timeout", None)]
    changed.take(IssuedCommand(0.1), 3650.0)
    assert stated[2:] == [("command_changed_over", "over_speed", 18000), ("command_changed_over", "timeout", 2571)]
    changed.take(IssuedCommand(0.0, reason="over_speed"), 3651.0)
    assert stated[4:] == [("command_changed", "over_speed", None)]
