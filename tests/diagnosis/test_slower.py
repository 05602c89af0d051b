"""A fast record at a lower rate: which rows stay, that no current is lost, and that the wheel is the same."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rw_ekf.control.profiles import make_profile, sample_profile
from rw_ekf.course.course import Course
from rw_ekf.course.free_run import free_run
from rw_ekf.diagnosis.log_diagnosis import diagnose_log
from rw_ekf.diagnosis.prepare.preparation import prepare
from rw_ekf.diagnosis.prepare.slower import one_of_each, slower
from rw_ekf.diagnosis.prepare.source import source_of
from rw_ekf.drivers.sim.plant_batch import PlantRun, simulate_run
from rw_ekf.drivers.sim.plant_effect_text import parse_effects
from rw_ekf.drivers.sim.plant_parameters import PlantNoise
from rw_ekf.likelihood.one_step import state_vector
from rw_ekf.units import RAD_S_PER_RPM
from tests.diagnosis.simulated import TRUTH, log_of, simulated


def fast(effects: tuple[str, ...], rate_hz: float = 50.0) -> PlantRun:
    times, currents = sample_profile(make_profile("identification", seed=3), rate_hz)
    return simulate_run(parse_effects(list(effects)), currents, times, PlantNoise(RAD_S_PER_RPM), seed=3)


@given(
    st.lists(st.tuples(st.integers(1, 40), st.lists(st.booleans(), min_size=40, max_size=40)), min_size=1, max_size=5),
    st.integers(2, 9),
)
def test_each_group_keeps_its_first_reading_and_each_segment_its_ends(
    segments: list[tuple[int, list[bool]]], every: int
) -> None:
    """Of every so many rows one that was read, if any was; no more but the segment's first row and last."""
    segment = np.repeat(np.arange(len(segments)), [length for length, _ in segments])
    read = np.concatenate([there[:length] for length, there in segments])
    rows = one_of_each(np.where(read, 1.0, np.nan), segment, every)
    for number, (length, _) in enumerate(segments):
        own, kept = read[segment == number], rows[segment == number]
        assert kept[0]
        assert kept[-1]
        for begin in range(0, length, every):
            group = slice(begin, begin + every)
            inner = kept[group].copy()
            wanted = np.flatnonzero(own[group])[:1]
            assert np.all(inner[wanted])
            ends = {0 - begin, length - 1 - begin}
            assert set(np.flatnonzero(inner)) - ends <= set(wanted.tolist())


def test_no_current_is_lost_between_the_rows_that_stay() -> None:
    """A free run over every third row is where the whole one is, commands that come late among them."""
    run = simulated(seed=2, samples=900)
    delay = np.full(run.time_s.size, 0.03)
    course = Course.of(run.time_s, run.measured_speed_rad_s, run.current_command_A, delay)
    rows = one_of_each(course.speed_rad_s, course.segment, 3)
    state = state_vector(TRUTH.coefficients, TRUTH.effects)[None, :]

    def path(over: Course) -> np.ndarray:
        ends = np.array([0]), np.array([over.samples - 1])
        return free_run(over, TRUTH.effects, TRUTH.stribeck, state, *ends, keep_path=True).path_rad_s

    np.testing.assert_allclose(path(course.at(rows)), path(course)[rows], rtol=1.0e-9, atol=1.0e-9)


def test_a_record_at_ten_hertz_stays_as_it_is() -> None:
    """What most wheels' telemetry is like is searched as it was read, however long."""
    prepared = prepare(source_of([log_of(simulated(seed=2, samples=3000))]), None, None, "blocks")
    assert slower(prepared) is prepared


@pytest.mark.slow
def test_an_effect_is_found_at_the_lower_rate_and_told_from_all_readings() -> None:
    """A wheel logged at 50 Hz: the base model is the same wheel's, the effect is named, its size is the whole's."""
    log = log_of(fast(("quadratic_drag:coefficient_1_rad=4e-6",)))
    prepared = prepare(source_of([log]), None, None, "blocks")
    thin = slower(prepared)
    assert thin.record.course.samples < 8100 < prepared.record.course.samples
    apart = thin.base.model.vector - prepared.base.model.vector
    assert np.all(np.abs(apart) < 3.0 * thin.base.std)
    diagnosis = diagnose_log(log)
    document = diagnosis.document()
    assert document["verdict"]["effects"] == ["quadratic_drag"]
    (added,) = (one for one in document["candidates"] if one["decision"] == "added")
    size = added["parameters"]["coefficient_1_rad"]
    assert abs(size["value"] - 4.0e-6) < 4.0 * size["std"]
    assert diagnosis.after is not None
    assert np.isfinite(diagnosis.after.free_run_rad_s).sum() > 0.95 * len(log)
