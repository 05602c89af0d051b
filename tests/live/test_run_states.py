"""The state of a run: which leads to which, hysteresis, and a latch that only a person opens."""

from __future__ import annotations

import itertools
import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rw_ekf.clock import VirtualClock
from rw_ekf.commands.run_report import exit_status
from rw_ekf.drivers.sim.simulated_wheel import SimulatedWheel
from rw_ekf.live.run_states import RunStates, Turn
from rw_ekf.live.stop_signal import StopSignal
from rw_ekf.records import LinkState, RunState
from tests.live.daemon import Notes, Ran, resume
from tests.live.virtual import run, setting

GOOD = Turn(LinkState.ANSWERED, used=True)
REFUSED = Turn(LinkState.ANSWERED, used=False)
MISSED = Turn(LinkState.MISSED, used=False)
SILENT = Turn(LinkState.SILENT, used=False)
DOWN = Turn(LinkState.DOWN, used=False)
HOT = Turn(LinkState.ANSWERED, used=True, danger="61.0 degC")
FAULT = Turn(LinkState.ANSWERED, used=True, trouble="fault")


def states_after(*turns: Turn, latches: bool = True) -> list[str]:
    """State after each turn."""
    machine = RunStates(VirtualClock(), Notes().info, latches=latches)
    return [machine.step(turn).state.value for turn in turns]


@pytest.mark.parametrize(
    ("turns", "last"),
    [
        ([GOOD] * 2, "CONNECTING"),
        ([GOOD] * 3, "TRACKING"),
        ([GOOD, GOOD, MISSED, GOOD, GOOD], "CONNECTING"),
        ([GOOD] * 3 + [MISSED], "TRACKING"),
        ([GOOD] * 3 + [MISSED] * 2, "DEGRADED"),
        ([GOOD] * 3 + [REFUSED] * 2, "DEGRADED"),
        ([GOOD] * 3 + [MISSED, GOOD, GOOD] * 40, "TRACKING"),
        ([GOOD] * 3 + [MISSED, GOOD] * 40, "DEGRADED"),  # half of the latest
        ([GOOD] * 3 + [FAULT], "DEGRADED"),
        ([GOOD] * 3 + [FAULT] + [GOOD] * 5, "TRACKING"),
        ([GOOD] * 3 + [MISSED] * 2 + [GOOD] * 4, "DEGRADED"),
        ([GOOD] * 3 + [MISSED] * 2 + [GOOD] * 5, "TRACKING"),
        ([GOOD] * 3 + [DOWN], "LOST"),
        ([GOOD] * 3 + [SILENT], "LOST"),
        ([GOOD] * 3 + [SILENT, MISSED], "LOST"),
        ([GOOD] * 3 + [SILENT, GOOD], "CONNECTING"),
        ([GOOD] * 3 + [SILENT] + [GOOD] * 3, "TRACKING"),
        ([HOT], "SAFE"),
        ([HOT] + [GOOD] * 100, "SAFE"),
        ([HOT, DOWN] + [GOOD] * 100, "SAFE"),
    ],
)
def test_which_turns_lead_where(turns: list[Turn], last: str) -> None:
    """The table of docs/contract.md, turn by turn."""
    assert states_after(*turns)[-1] == last


def test_a_run_that_never_writes_has_no_safe() -> None:
    """There is nothing to hold back: what would be a danger is trouble, and ends with its cause."""
    assert states_after(*[GOOD] * 3, HOT, *[GOOD] * 5, latches=False)[-6:] == ["DEGRADED"] * 5 + ["TRACKING"]


@given(st.lists(st.sampled_from([GOOD, REFUSED, MISSED, SILENT, DOWN, FAULT]), max_size=60))
def test_only_a_person_leads_out_of_safe(turns: list[Turn]) -> None:
    """Whatever the line does: SAFE stays until the word, and the word leads to CONNECTING or on from there."""
    machine = RunStates(VirtualClock(), Notes().info)
    machine.step(HOT)
    for turn in turns:
        assert machine.step(turn).state is RunState.SAFE
    machine.resume()
    assert machine.step(GOOD).state is RunState.CONNECTING
    for turn in turns:
        assert machine.step(turn).state is not RunState.SAFE


def test_a_word_while_the_danger_lasts_is_refused_and_forgotten() -> None:
    """It is said why; and when the danger is over, the run does not resume by itself."""
    notes = Notes()
    machine = RunStates(VirtualClock(), notes.info)
    machine.step(HOT)
    machine.resume()
    assert machine.step(HOT).state is RunState.SAFE
    assert ("not_resumed", {"reason": "61.0 degC"}) in notes.stated
    assert machine.step(GOOD).state is RunState.SAFE


def test_what_is_forbidden_for_good_no_word_undoes() -> None:
    """A wrong sign stays wrong until the map is mended."""
    machine = RunStates(VirtualClock(), Notes().info)
    machine.latch("wrong sign", for_good=True)
    machine.resume()
    assert machine.step(GOOD) == machine.now
    assert machine.is_safe


def say(word: str) -> Callable[[SimulatedWheel, StopSignal], object]:
    """An event: a person's word."""
    assert word == "resume"
    return lambda wheel, stop: resume()


def events_of(ran: Ran) -> list[dict[str, object]]:
    """What the run's events file has."""
    return [json.loads(line) for line in ran.outcome.files.events.read_text(encoding="utf-8").splitlines()]


@pytest.mark.parametrize("broken", ["silent", "unplugged"])
@pytest.mark.parametrize(("for_s", "longest"), [(0.3, "TRACKING"), (1.2, "DEGRADED"), (3.0, "LOST"), (20.0, "SAFE")])
def test_the_longer_the_silence_the_further_the_state(tmp_path: Path, broken: str, for_s: float, longest: str) -> None:
    """A blink, some turns, beyond silence_s, beyond safe_after_s; a line that is down is lost at once."""
    ran, _ = run(tmp_path, 90.0, (30.2, setting(**{broken: True})), (30.2 + for_s, setting(**{broken: False})))
    order = ["CONNECTING", "TRACKING", "DEGRADED", "LOST", "SAFE"]
    worst = max(ran.notes.states, key=order.index)
    if broken == "unplugged" and for_s >= 1.0:
        longest = max(longest, "LOST", key=order.index)
    assert worst == longest
    last = ran.outcome.state.state.value
    assert last == ("SAFE" if longest == "SAFE" else "TRACKING")
    assert exit_status(ran.outcome) == (5 if longest == "SAFE" else 0)
    after = ran.log.current_A[ran.log.time_s > 30.2 + for_s + 3.0]
    assert np.any(after != 0.0) == (longest != "SAFE")


def test_every_change_of_state_is_in_the_events_file_with_its_reason(tmp_path: Path) -> None:
    """The file tells the same story as the run did, from the opening of the line to the end."""
    silence = (30.0, setting(silent=True)), (50.0, setting(silent=False)), (60.0, say("resume"))
    ran, _ = run(tmp_path, 90.0, *silence)
    reported = [event for event in events_of(ran) if event["event"] == "state"]
    assert [event["state"] for event in reported] == ["CONNECTING", *ran.notes.states]
    assert all(before["state"] == after["was"] for before, after in itertools.pairwise(reported))
    assert all(event["reason"] and str(event["utc"]).endswith("Z") for event in reported)
    assert events_of(ran)[-1]["event"] == "ended"
    assert ran.notes.states[-3:] == ["SAFE", "CONNECTING", "TRACKING"]
    assert np.all(ran.log.current_A[(ran.log.time_s > 51.0) & (ran.log.time_s < 59.0)] == 0.0)
    assert np.any(ran.log.current_A[ran.log.time_s > 62.0] != 0.0)


def test_a_line_that_is_lost_to_the_end_is_not_a_safety_stop(tmp_path: Path) -> None:
    """SAFE came of the lost line itself: the exit status is that of a lost line."""
    ran, _ = run(tmp_path, 60.0, (30.0, setting(unplugged=True)))
    assert ran.outcome.state.state is RunState.SAFE
    assert exit_status(ran.outcome) == 1


def test_the_state_file_tells_of_a_line_that_is_down(tmp_path: Path) -> None:
    """While nothing comes, what is published is LOST and DOWN, with the last estimate; the log has no row of it."""
    ran, _ = run(tmp_path, 32.0, (30.0, setting(unplugged=True)))
    document = json.loads(ran.outcome.files.state.read_text(encoding="utf-8"))
    assert document["run_state"] == "LOST"
    assert document["link"]["state"] == "down"
    assert document["ended_utc"] is not None
    assert document["time_s"] == ran.log.time_s[-1]
    assert document["current_command_A"] is None
