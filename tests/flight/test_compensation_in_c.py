"""DMC and predictive crossing in the printed C: the same currents, bit by bit, as the schemes in Python."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from rw_ekf.control.compensation.dmc import DynamicModelCompensation
from rw_ekf.control.compensation.known import WheelKnown
from rw_ekf.control.compensation.predictive_crossing import PredictiveCrossing
from rw_ekf.control.compensation.scheme import Compensation
from rw_ekf.filter.estimator import Estimator
from rw_ekf.records import IssuedCommand, Tick, WheelSample
from rw_ekf.wheel.effect_table import NO_EFFECTS, EffectSet
from tests.filter.effect_replay import believed, in_use, rough_log
from tests.flight.c_library import compiled, in_c, needs_gcc, same_bits, setup_for
from tools.measure.runs import constants_for

_WANTED = {
    "dmc": "asked[i] = (double)rw_ekf_dmc_current(&held, i % 60 < 30 ? 0.2 : -0.2);",
    "crossing": (
        "static struct rw_crossing crossing; if (i == 0) { rw_ekf_crossing_start(&crossing); }"
        "asked[i] = (double)rw_ekf_crossing_current(&crossing, &held, i % 60 < 30 ? 0.2 : -0.2, 0.1);"
    ),
}
_DELAY_S = 0.03


@needs_gcc
@pytest.mark.parametrize(
    "effects", [NO_EFFECTS, in_use("quadratic_drag", "current_deadzone")], ids=["plain", "effects"]
)
@pytest.mark.parametrize("scheme", ["dmc", "crossing"])
def test_currents_are_those_of_the_scheme(scheme: str, effects: EffectSet, tmp_path: Path) -> None:
    """On a rough log, with gaps and a new segment, through zero and from rest, every current has the same bits."""
    log, temperature, angle = rough_log(5)
    log.delay_s[:] = _DELAY_S
    belief, drift = believed(effects), np.full(effects.size, 1.0e-9)
    library = compiled(tmp_path, setup_for(constants_for(), belief, effects, drift), wanted=_WANTED[scheme])
    found = in_c(library, log, len(belief.mean), temperature, angle)

    estimator = Estimator(constants_for(), belief.mean, belief.covariance, effects, drift)
    compensation: Compensation = DynamicModelCompensation() if scheme == "dmc" else PredictiveCrossing(10.0)
    expected = []
    for i in range(log.time_s.size):
        sample = WheelSample(
            float(log.time_s[i]),
            None if math.isnan(log.speed_rad_s[i]) else float(log.speed_rad_s[i]),
            temperature_degC=float(temperature[i]),
            angle_rad=float(angle[i]),
            segment=int(log.segment[i]),
        )
        estimate = estimator.step(sample)
        known = WheelKnown.of_estimate(estimate, constants_for().stribeck)
        request = 0.2 if i % 60 < 30 else -0.2
        expected.append(compensation.current_A(Tick(sample, estimate), request, known))
        estimator.command_issued(IssuedCommand(float(log.current_A[i]), _DELAY_S))
    assert len(set(expected)) > len(expected) // 2
    assert same_bits(found.wanted_A, np.array(expected))
