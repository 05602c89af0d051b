"""A person's word to a daemon that holds zero: resume. Sent by a signal, confirmed by what the daemon publishes.

Which signal, the run of each wheel publishes: on a line of several nobody but the wheel that was named may hear it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from rw_ekf.clock import SystemClock
from rw_ekf.live.published_state import Published, published_place, read_published
from rw_ekf.live.running_daemon import holders_of, tell
from rw_ekf.live.stop_signal import LINE_RESUMES, RESUME
from rw_ekf.records import RunState

if TYPE_CHECKING:
    from rw_ekf.settings.schema import Configuration

_WITHIN_S = 5.0  # the state file is replaced once a second
_LOOK_EVERY_S = 0.05


@dataclass(frozen=True)
class Resumed:
    """What came of the word."""

    pid: int
    left_safe: bool
    state: str | None  # None: it publishes nothing that we can read
    text: str

    def document(self) -> dict[str, Any]:
        """For `--json`."""
        return {
            "schema": "rw_ekf.resume/1",
            "pid": self.pid,
            "left_safe": self.left_safe,
            "state": self.state,
            "text": self.text,
        }


def resume_daemon(configuration: Configuration, *, of_line: bool) -> Resumed | None:
    """Tell the daemon of a configuration's port to let this wheel leave SAFE, and wait; None where none is running.

    of_line: it has other wheels, so that nothing is sent where it is not known which word is for this one. Raises
    DriverError where the daemon is another user's.
    """
    clock = SystemClock()
    holders = holders_of(configuration.wheel.port, clock)
    if not holders:
        return None
    facts = holders[0]
    path = published_place(configuration, [facts.uid])
    before = read_published(path)
    if not _is_of(before, facts.pid) and of_line:
        text = f"process {facts.pid} publishes nothing of {configuration.wheel.name} here, and was told nothing: "
        return Resumed(facts.pid, False, None, f"{text}another wheel of the line might have heard it")
    if not _is_of(before, facts.pid):
        reported = tell(facts, RESUME)
        text = f"process {facts.pid} was told to resume, but publishes nothing here: see its own log"
        return Resumed(facts.pid, False, None, text) if reported else None
    assert before is not None
    if before.run_state != RunState.SAFE:
        state = before.run_state
        return Resumed(facts.pid, True, state, f"process {facts.pid} is {state}, not SAFE: nothing to resume")
    number = before.document.get("resume_signal", RESUME)
    if number != RESUME and number not in LINE_RESUMES:  # a file says it: no signal that ends a process
        text = f"process {facts.pid} has no word for this wheel alone: end it, and begin anew"
        return Resumed(facts.pid, False, RunState.SAFE.value, text)
    if not tell(facts, number):
        return None
    end_s = clock.monotonic() + _WITHIN_S
    now = before
    while clock.monotonic() < end_s and now.run_state == RunState.SAFE:
        clock.sleep(_LOOK_EVERY_S)
        now = read_published(path) or now
    if now.run_state == RunState.SAFE:
        text = f"process {facts.pid} stays in SAFE: {now.document.get('reason')}"
        return Resumed(facts.pid, False, RunState.SAFE.value, text)
    return Resumed(facts.pid, True, now.run_state, f"process {facts.pid} has left SAFE and is {now.run_state}")


def _is_of(published: Published | None, pid: int) -> bool:
    return published is not None and published.alive and published.pid == pid
