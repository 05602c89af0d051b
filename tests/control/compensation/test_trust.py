"""Whose parameters a compensation gets: the filter's, the last trusted, or none."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from rw_ekf.control.compensation.trust import ParameterTrust, Source, is_trusted_start
from rw_ekf.filter.belief import DEFAULT_PRIOR, Belief
from rw_ekf.model.friction import GAUSS, Stribeck
from rw_ekf.model.state import CK13_STATISTICAL, PARAMETER_NAMES
from rw_ekf.records import FilterHealth, ParameterFlags, RunState
from tests.control.compensation.turns import ALL, DIVERGED, NONE, turn

STRIBECK = Stribeck(0.42, GAUSS)
TURNS = st.lists(
    st.tuples(
        st.sampled_from(list(RunState)),
        st.builds(ParameterFlags, st.booleans(), st.booleans(), st.booleans(), st.booleans()),
        st.sampled_from([None, DIVERGED]),
    ),
    max_size=50,
)


def trust(used: tuple[str, ...] = PARAMETER_NAMES, *, start_trusted: bool = False) -> ParameterTrust:
    return ParameterTrust(used, STRIBECK, start_trusted=start_trusted)


@given(TURNS, st.booleans())
def test_the_filter_is_the_source_exactly_while_it_can_be_trusted(
    turns: list[tuple[RunState, ParameterFlags, FilterHealth | None]], start_trusted: bool
) -> None:
    """Every flag, TRACKING, no trouble: the filter's own set; else one that was so once; none where none ever was."""
    made, seen = trust(start_trusted=start_trusted), 1 if start_trusted else 0
    for i, (state, valid, health) in enumerate(turns):
        source, known = made.step(turn(0.1 * i, state, coulomb=0.5 + 0.001 * i, valid=valid, health=health), 0.1)
        good = state is RunState.TRACKING and health is None and all(valid)
        seen += good
        assert source is (Source.FILTER if good else Source.LAST_TRUSTED if seen else Source.NOTHING)
        assert (known is None) == (source is Source.NOTHING)
        if good:
            assert known is not None
            assert known.estimate is not None
            assert known.parameters.coulomb == 0.5 + 0.001 * i


def test_a_flag_that_the_scheme_does_not_use_does_not_matter() -> None:
    """A scheme that uses the motor gain alone takes the filter while that is valid."""
    gain_alone = NONE._replace(motor_gain=True)
    assert trust(("motor_gain",)).step(turn(0.0, valid=gain_alone), 0.0).source is Source.FILTER
    assert trust().step(turn(0.0, valid=gain_alone), 0.0).source is Source.NOTHING
    assert trust(()).step(turn(0.0, valid=NONE), 0.0).source is Source.NOT_NEEDED


def test_what_is_fallen_back_on_is_from_before_the_trouble() -> None:
    """A filter that wanders off for half a minute before it is called diverged has not taken the kept set with it."""
    made = trust()
    for i in range(3000):  # five minutes in which all is well, then half a minute on the way out
        made.step(turn(0.1 * i, coulomb=0.58 if i < 2700 else 0.58 + 0.01 * (i - 2700)), 0.1)
    source, known = made.step(turn(300.0, coulomb=9.0, speed=-3.0, health=DIVERGED), 0.1)
    assert source is Source.LAST_TRUSTED
    assert known is not None
    assert known.parameters.coulomb == 0.58
    assert known.speed_rad_s == -3.0  # the speed is the present one
    assert known.estimate is None


def test_the_start_of_the_run_counts_where_it_was_trusted() -> None:
    """What the run starts from is kept from its first turn, whatever the filter says of it."""
    made = trust(start_trusted=True)
    made.step(turn(0.0, RunState.CONNECTING, coulomb=0.61, valid=NONE), 0.0)
    source, known = made.step(turn(0.1, coulomb=0.2, valid=NONE), 0.1)
    assert source is Source.LAST_TRUSTED
    assert known is not None
    assert known.parameters.coulomb == 0.61
    assert made.step(turn(0.2, coulomb=0.59, valid=ALL), 0.1).source is Source.FILTER


def test_a_built_in_prior_is_no_trusted_start_and_a_fitted_model_is() -> None:
    """Half of its value is the most that a sigma may be, for each of the four."""
    assert not is_trusted_start(DEFAULT_PRIOR)
    values = np.array(CK13_STATISTICAL)
    assert is_trusted_start(Belief.of_known(values, np.diag((0.4 * values) ** 2)))
    assert not is_trusted_start(Belief.of_known(values, np.diag((np.array([0.1, 0.1, 0.1, 0.6]) * values) ** 2)))
