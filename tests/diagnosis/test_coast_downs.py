"""Coast-downs, in which time and speed are one: what is named, what is named with it, and what settles it."""

from __future__ import annotations

import pytest

from rw_ekf.diagnosis.diagnose import diagnose_log
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
