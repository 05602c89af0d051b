"""Coast-downs, in which time and speed are one: what is named, what is named with it, and what settles it."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rw_ekf.arrays import Float64Array
from rw_ekf.diagnosis.log_diagnosis import diagnose_log
from tests.diagnosis.coast_downs import Drag, between, coast_down, cubic, event

STEADY = {"quadratic_drag", "cubic_drag"}


@pytest.mark.slow
@pytest.mark.parametrize("drag", [cubic, between])
def test_a_single_coast_down_shows_a_law_of_speed_before_one_of_time(drag: Drag) -> None:
    """A steady drag is named, the drift that fits alike beside it, with the record that would separate the two."""
    verdict = diagnose_log(coast_down(drag, 5)).document()["verdict"]
    assert set(verdict["effects"]) <= STEADY, verdict["statement"]
    assert verdict["effects"]
    assert any("coulomb_drift" in group for group in verdict["indistinguishable"])
    assert "a second coast-down from another speed" in verdict["statement"]


@pytest.mark.slow
def test_two_coast_downs_from_different_speeds_settle_it() -> None:
    """Both logs in one diagnosis: the cube of the speed, nothing beside it, each log with a start of its own."""
    logs = [coast_down(cubic, 6), coast_down(cubic, 7, start=310.0, samples=3000)]
    document = diagnose_log(logs).document()
    assert document["verdict"]["effects"] == ["cubic_drag"], document["verdict"]["statement"]
    assert document["verdict"]["indistinguishable"] == []
    assert document["after"]["free_run_rms_rpm"] < 0.13
    assert document["log"] == "coast-down-520, coast-down-310"
    assert [part["samples"] for part in document["logs"]] == [5000, 3000]


@pytest.mark.slow
@pytest.mark.parametrize("steady", [cubic, lambda w, t: 0.61 + 0.0021 * w])
def test_an_event_in_a_coast_down_has_its_onset_size_and_decay(steady: Drag) -> None:
    """Drag that jumps by a tenth of Coulomb friction amid a coast-down: found to a second and 5 %, the law too."""

    def drag(w: float, t: float) -> float:
        return steady(w, t) + event(t, 90.0, 0.06, 80.0)

    document = diagnose_log(coast_down(drag, 8)).document()
    expected = {"drag_spike"} | ({"cubic_drag"} if steady is cubic else set())
    assert set(document["verdict"]["effects"]) == expected, document["verdict"]["statement"]
    found = next(c for c in document["candidates"] if c["effect"] == "drag_spike")["parameters"]
    assert found["onset_s"]["value"] == pytest.approx(90.0, abs=1.0)
    assert found["amplitude_rad_s2"]["value"] == pytest.approx(0.06, rel=0.05)
    assert found["decay_s"]["value"] == pytest.approx(80.0, rel=0.05)


def _saturating(w: float, t: float) -> float:
    return 0.45 + 0.0011 * w + 0.25 * math.tanh(w / 60.0)


def _logarithm(w: float, t: float) -> float:
    return 0.5 + 0.001 * w + 0.12 * math.log1p(max(w, 0.0) / 20.0)


def _power(w: float, t: float) -> float:
    return 0.5 + 0.0012 * w + 0.6 * math.pow(max(w, 0.0) / 300.0, 1.8)


@pytest.mark.slow
def test_what_begins_and_ends_amid_a_drag_that_has_no_name_has_its_times_and_its_size() -> None:
    """A tenth more drag for a minute: no square of minus 490 % and cube of 230 % mend a law found without the spell."""
    log = coast_down(
        lambda w, t: _logarithm(w, t) + (0.07 if 108.0 < t < 165.0 else 0.0), 41, start=380.0, samples=5600
    )
    document = diagnose_log(log).document()
    assert set(document["verdict"]["effects"]) == {"spell", "learned_law"}, document["verdict"]["statement"]
    found = next(c for c in document["candidates"] if c["effect"] == "spell")["parameters"]
    assert (found["begins_at"]["value"], found["ends_at"]["value"]) == pytest.approx((108.0, 165.0), abs=1.0)
    assert (found["what"]["value"], found["size"]["value"]) == ("drag", pytest.approx(0.07, rel=0.03))


@pytest.mark.slow
@pytest.mark.parametrize("drag", [_saturating, _power])
def test_a_drag_that_has_no_name_is_a_law_of_the_speed_and_its_curve_is_known(drag: Drag) -> None:
    """No drift, no Stribeck speed of a thousand rpm, no square less a cube: what goes with time and speed is drag."""
    moving = int(np.argmax(coast_down(drag, 31, start=380.0, samples=9000).speed_rad_s < 1.0))
    document = diagnose_log(coast_down(drag, 31, start=380.0, samples=moving)).document()
    named = set(document["verdict"]["effects"])  # the power is a square, and what it is less
    assert {"learned_law"} <= named <= {"learned_law", "quadratic_drag"}, document["verdict"]["statement"]
    assert "a second coast-down from another speed" in document["verdict"]["statement"].lower()
    found = next(c for c in document["candidates"] if c["effect"] == "learned_law")["parameters"]
    assert (found["quantity"]["value"], found["kind"]["value"]) == ("speed_size", "drag")
    assert document["after"]["free_run_rms_rpm"] < 0.15
    knots, curve, std = (np.array(found[name]["value"]) for name in ("knots", "values", "std"))
    true = np.array([drag(float(w), 0.0) for w in knots])
    if "quadratic_drag" in named:
        square = next(c for c in document["candidates"] if c["effect"] == "quadratic_drag")["parameters"]
        curve = curve + square["coefficient_1_rad"]["value"] * knots**2
    seen = (knots > 20.0) & (knots < 360.0)
    followed = np.column_stack((np.ones(seen.sum()), knots[seen]))  # by Coulomb and viscous friction

    def bent(values: Float64Array) -> Float64Array:
        return np.asarray(values - followed @ np.linalg.lstsq(followed, values, rcond=None)[0])

    assert np.ptp(bent(curve[seen] - true[seen])) < 0.05 * np.ptp(bent(true[seen]))
    assert np.median(std[seen]) < 0.1 * np.ptp(curve[seen])


@pytest.mark.slow
def test_a_change_that_was_under_way_when_the_record_began_is_told_from_where_it_began() -> None:
    """Drag that grows by a tenth until 25 s, from 15 s before the first row: its times, and its size, are found."""
    log = coast_down(
        lambda w, t: 0.5 + 0.001 * w + 0.05 * min(max((t + 15.0) / 40.0, 0.0), 1.0), 43, start=380.0, samples=5600
    )
    document = diagnose_log(log).document()
    assert document["verdict"]["effects"] == ["change"], document["verdict"]["statement"]
    found = next(c for c in document["candidates"] if c["effect"] == "change")["parameters"]
    assert (found["begins_at"]["value"], found["takes_s"]["value"]) == pytest.approx((-15.0, 40.0), abs=1.0)
    assert (found["what"]["value"], found["size"]["value"]) == ("drag", pytest.approx(0.05, rel=0.1))
