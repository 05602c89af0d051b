"""Whatever a loop hands over, a compensation answers with a finite current."""

from __future__ import annotations

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rw_ekf.control.compensation.known import WheelKnown
from rw_ekf.control.compensation.schemes import SCHEMES, WheelSheet
from rw_ekf.model.state import FrictionParameters
from rw_ekf.records import WheelSample
from tests.control.compensation.bare_wheel import COULOMB, GAIN, STRIBECK
from tests.ticks import tick_of

WHEEL = FrictionParameters(GAIN, 0.003, COULOMB, 0.62)
SPEED = st.floats(-1000.0, 1000.0) | st.just(0.0)
TURN = st.tuples(
    st.floats(-0.5, 5.0),  # since the turn before [s]: clocks stand, step back, and jump
    st.none() | SPEED,  # reading
    SPEED,  # believed
    st.floats(-0.6, 0.6) | st.none(),  # current in force, as telemetry has it
    st.floats(-20.0, 20.0),  # request
    st.integers(0, 20).map(lambda n: n == 0),  # a new segment
)


@pytest.mark.parametrize("name", [name for name, entry in SCHEMES.items() if entry.parameters_from != "diagnosed"])
@settings(max_examples=40, deadline=None)
@given(turns=st.lists(TURN, min_size=1, max_size=60))
def test_every_current_is_finite(
    name: str, turns: list[tuple[float, float | None, float, float | None, float, bool]]
) -> None:
    """Missing readings, gaps, clocks that step back and new segments included."""
    scheme = SCHEMES[name].make(WheelSheet(WHEEL, STRIBECK))
    time_s, segment = 0.0, 0
    for dt_s, reading, believed, driving_A, request, restarts in turns:
        time_s, segment = time_s + dt_s, segment + restarts
        sample = WheelSample(time_s, reading, current_command_A=driving_A, segment=segment)
        known = WheelKnown.of_parameters(believed, WHEEL, STRIBECK)
        assert math.isfinite(scheme.current_A(tick_of(sample), request, known))
