"""What confirms an event that happened once: every other five seconds of it and all else."""

from __future__ import annotations

import pytest

from rw_ekf.diagnosis.judge.event import agrees_with_itself, percent_gained
from rw_ekf.diagnosis.prepare.preparation import prepare
from rw_ekf.diagnosis.prepare.source import source_of
from rw_ekf.effects.catalogue import CATALOGUE
from rw_ekf.model.effect import Term
from tests.diagnosis.simulated import log_of, simulated

SPIKE = CATALOGUE["drag_spike"]


@pytest.mark.parametrize(
    ("effect", "agrees"),
    [
        ("drag_spike:amplitude_rad_s2=0.03,onset_s=150,decay_s=60", True),
        ("external_torque:amplitude_rad_s2=0.05,frequency_Hz=0.1,phase_rad=1.57", False),
    ],
)
def test_seconds_of_an_event_agree_where_there_is_one_and_not_where_a_torque_swings(effect: str, agrees: bool) -> None:
    """A weak spike is confirmed by its own seconds; a torque that changes its sign every five is none."""
    run = simulated([effect], seed=5, samples=3000)
    prepared = prepare(source_of([log_of(run)]), None, None, "blocks")
    fit = prepared.base.refitted(prepared.base.model.with_terms(Term.of(SPIKE, (150.0, 60.0, 0.0), 0.02)))
    settled = fit.refitted(fit.model.settled(SPIKE.id))
    assert settled.likelihood.value > prepared.base.likelihood.value + 2.0  # the record as a whole has some use for it
    assert agrees_with_itself(settled, SPIKE.id) is agrees
    if agrees:
        gained = percent_gained(settled, SPIKE.id)
        assert gained is not None
        assert -5.0 < gained < 50.0
