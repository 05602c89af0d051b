"""A compensation on a wheel: added to the request while all is well, gone in the turn in which it is not."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rw_ekf.control.compensation.known import WheelKnown
from rw_ekf.control.compensation.on_wheel import Terms, WheelCompensator
from rw_ekf.control.compensation.schemes import SCHEMES, SchemeEntry, WheelSheet
from rw_ekf.control.compensation.trust import ParameterTrust
from rw_ekf.model.friction import GAUSS, Stribeck
from rw_ekf.model.state import PARAMETER_NAMES, FrictionParameters
from rw_ekf.records import FilterHealth, RunState, Tick
from tests.control.compensation.turns import ALL, DIVERGED, NONE, state_of, turn

SHEET = WheelSheet(FrictionParameters(15.0, 0.003, 0.58, 0.60), Stribeck(0.42, GAUSS))
LIMIT_A, FADE_S = 0.06, 2.0
Notes = list[dict[str, Any]]


def compensator(
    entry: SchemeEntry = SCHEMES["dmc"],
    request_rad_s2: float = 0.3,
    notes: Notes | None = None,
    forbidden: Callable[[], str | None] = lambda: None,
) -> WheelCompensator:
    used = PARAMETER_NAMES if entry.parameters_from == "estimator" else ()
    trust = ParameterTrust(used, SHEET.stribeck, start_trusted=False)
    stated = notes if notes is not None else []
    terms = Terms(LIMIT_A, FADE_S, forbidden, lambda event, **context: stated.append(context))
    return WheelCompensator(entry, SHEET, lambda tick: request_rad_s2, trust, terms)


def wanted(made: WheelCompensator, tick: Tick) -> float:
    """The current of a turn, told at its end as the loop does."""
    current_A = made(tick)
    made.compensating(tick.state)
    return current_A


def settled(made: WheelCompensator) -> float:
    """The current once it is faded in; the next turn is at 5.0 s."""
    return [wanted(made, turn(0.1 * i)) for i in range(50)][-1]


def test_faded_in_it_is_the_scheme_s_own_current() -> None:
    """After fade_s the current is (a + f) / k of the filter, as [CK13 (14)] has it."""
    assert settled(compensator()) == pytest.approx((0.3 + 0.58 + 0.003 * 10.0) / 15.2)


def test_it_fades_in_without_a_jump() -> None:
    """The first turn has the request's current alone, and no turn adds more than a twentieth of the limit."""
    made = compensator()
    currents = [wanted(made, turn(0.1 * i)) for i in range(40)]
    assert currents[0] == 0.3 / 15.0
    assert max(b - a for a, b in itertools.pairwise(currents)) <= LIMIT_A * 0.1 / FADE_S + 1e-12


@pytest.mark.parametrize("state", [state for state in RunState if state is not RunState.TRACKING])
def test_off_at_once_in_every_other_state_and_faded_in_again(state: RunState) -> None:
    """The very turn that says DEGRADED, LOST, SAFE or CONNECTING asks for the request's current alone."""
    made = compensator()
    settled(made)
    assert wanted(made, turn(5.0, state)) == 0.3 / 15.0
    assert not made.compensating(state_of(state)).on
    assert wanted(made, turn(5.1)) - 0.3 / 15.0 <= LIMIT_A * 0.1 / FADE_S + 1e-12
    later = [wanted(made, turn(5.2 + 0.1 * i)) for i in range(30)]
    assert later[-1] == pytest.approx((0.3 + 0.58 + 0.03) / 15.2)


def test_off_at_once_where_the_filter_is_not_well() -> None:
    """Trouble of the filter ends it in the turn in which it is noticed, whatever the state is called."""
    made = compensator()
    settled(made)
    assert wanted(made, turn(5.0, health=DIVERGED)) == 0.3 / 15.0


def test_a_turn_that_asks_for_no_current_ends_it_too() -> None:
    """Where the line is silent the controller is not asked: the state of the turn ends it all the same."""
    made = compensator()
    settled(made)
    now = made.compensating(state_of(RunState.DEGRADED))
    assert not now.on
    assert now.current_A == 0.0
    assert "why it is DEGRADED" in now.reason


def test_nothing_before_the_sign_is_confirmed() -> None:
    """With the wrong sign a compensation would drive the wheel by itself: it waits for the confirmation."""
    why: list[str | None] = ["the sign is not confirmed"]
    made = compensator(forbidden=lambda: why[0])
    assert settled(made) == 0.3 / 15.0
    why[0] = None
    assert [wanted(made, turn(5.0 + 0.1 * i)) for i in range(50)][-1] > 0.05


def test_each_change_is_said_once() -> None:
    """Off, the filter's parameters, the last trusted ones, trouble, on again: a line each, none repeated."""
    notes: Notes = []
    made = compensator(notes=notes)
    shown = [(RunState.CONNECTING, ALL), (RunState.TRACKING, NONE), (RunState.TRACKING, ALL), (RunState.TRACKING, NONE)]
    shown += [(RunState.DEGRADED, ALL), (RunState.TRACKING, ALL)]
    for i, (state, valid) in enumerate(shown):
        for j in range(10):
            wanted(made, turn(i + 0.1 * j, state, valid=valid))
    reported = [(note["on"], note["parameters"]) for note in notes]
    assert reported == [
        (False, "nothing"),  # CONNECTING
        (False, "nothing"),  # nothing that can be trusted is known
        (True, "filter"),
        (True, "last_trusted"),
        (False, "last_trusted"),  # DEGRADED
        (True, "filter"),
    ]


class Wild:
    """A scheme that gives whatever it is told, or fails."""

    def __init__(self, gives: float | None) -> None:
        self.gives = gives

    def current_A(self, tick: Tick, request_rad_s2: float, known: WheelKnown) -> float:
        """A number, or no number."""
        return 1.0 / 0.0 if self.gives is None else self.gives


@given(st.one_of(st.none(), st.floats()), st.floats(-100.0, 100.0), st.floats(-400.0, 400.0))
def test_no_scheme_gets_beyond_the_limit(gives: float | None, request_rad_s2: float, speed: float) -> None:
    """Whatever a scheme says, or if it fails: within limit_A of the request's own current."""
    made = compensator(SchemeEntry("wild", "", lambda sheet: Wild(gives)), request_rad_s2)
    for i in range(40):
        current_A = wanted(made, turn(0.1 * i, speed=speed))
        assert abs(current_A - request_rad_s2 / 15.0) <= LIMIT_A * (1.0 + 1e-9)


@given(
    st.lists(
        st.tuples(st.sampled_from(list(RunState)), st.booleans(), st.sampled_from([None, DIVERGED]), st.booleans()),
        max_size=60,
    )
)
def test_off_means_the_request_alone(turns: list[tuple[RunState, bool, FilterHealth | None, bool]]) -> None:
    """In any order of states, flags, troubles and segments: what is called off adds nothing, to the last digit."""
    made = compensator()
    for i, (state, valid, health, new_segment) in enumerate(turns):
        tick = turn(0.1 * i, state, valid=ALL if valid else NONE, health=health, segment=i if new_segment else 0)
        current_A = made(tick)
        now = made.compensating(tick.state)
        assert now.on or current_A == 0.3 / 15.0
        assert not now.on or (state is RunState.TRACKING and health is None)


def test_a_scheme_begins_anew_after_it_was_off() -> None:
    """What it remembers is of the time before: another object, made when the compensation comes back."""
    made_of: list[Wild] = []

    def make(sheet: WheelSheet) -> Wild:
        made_of.append(Wild(0.05))
        return made_of[-1]

    made = compensator(SchemeEntry("counted", "", make))
    for i in range(10):
        wanted(made, turn(0.1 * i))
    wanted(made, turn(1.0, RunState.DEGRADED))
    wanted(made, turn(1.1))
    assert len(made_of) == 2
