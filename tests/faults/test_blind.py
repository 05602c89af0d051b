"""A wheel that is not heard, not seen as it is, or not the one it was a moment ago: driven no further than is known."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from rw_ekf.commands.run_report import exit_status
from tests.faults.rig import EACH_FAMILY, FAMILY, LineWheel
from tests.live.bench import CONFIRMED_BY_TELEMETRY, FAMILIES

pytestmark = pytest.mark.usefixtures("family")

SINE = {"profile": "sine", "amplitude_A": 0.3, "period_s": 8.0, "bias_A": 0.0, "confirm_sign": False}


def wheel(directory: Path, faults: str, resumes_at_s: float | None = None) -> LineWheel:
    """A wheel that turns, with its faults."""
    return LineWheel(directory, speed_rad_s=20.0, faults=faults, resumes_at_s=resumes_at_s)


@pytest.mark.parametrize(
    ("for_s", "states"),
    [
        (0.3, ["TRACKING", "DEGRADED", "TRACKING"]),
        (1.0, ["TRACKING", "DEGRADED", "LOST", "CONNECTING", "TRACKING"]),
        (10.0, ["TRACKING", "DEGRADED", "LOST", "SAFE"]),
    ],
)
@EACH_FAMILY
def test_silence_from_a_blink_to_a_latch(tmp_path: Path, for_s: float, states: list[str]) -> None:
    """Row 15: DEGRADED, LOST with zero, SAFE by its length; back by itself, but for the last: zero to the end."""
    made = wheel(tmp_path, f"silence@10s:{for_s}s")
    ran = made.run(40.0, command=SINE)
    assert ran.notes.states == states
    assert exit_status(ran.outcome) == (5 if states[-1] == "SAFE" else 0)
    late = ran.log.current_A[ran.log.time_s > ran.log.time_s[0] + 10.0 + for_s + 1.0]
    assert np.any(late != 0.0) == (states[-1] != "SAFE")
    assert ran.outcome.statistics.rejected == 0


@EACH_FAMILY
def test_a_latch_opens_at_a_word(tmp_path: Path) -> None:
    """Row 15: after ten seconds of silence and a word from a person the profile goes on, and the filter is right."""
    ran = wheel(tmp_path, "silence@10s:10s", resumes_at_s=30.0).run(60.0, command=SINE)
    assert ran.notes.states[-3:] == ["SAFE", "CONNECTING", "TRACKING"]
    assert exit_status(ran.outcome) == 0
    assert ran.outcome.statistics.rejected <= 1


@EACH_FAMILY
def test_telemetry_that_stands_still_on_a_ramp(tmp_path: Path) -> None:
    """Row 16: values stand, the clock runs: STUCK within seconds, zero, SAFE; alive again it goes on at a word."""
    which = ":speed" if FAMILY.get() in CONFIRMED_BY_TELEMETRY else ""  # no command is taken where the current stands
    made = wheel(tmp_path, f"freeze{which}@20s:10s", resumes_at_s=45.0)
    ran = made.run(60.0, command=SINE)
    assert ran.notes.events.count("telemetry_stuck") == ran.notes.events.count("telemetry_alive") == 1
    assert "SAFE" in ran.notes.states
    assert ran.notes.states[-1] == "TRACKING"
    time_s = ran.log.time_s - ran.log.time_s[0]
    assert np.all(ran.log.current_A[(time_s > 23.5) & (time_s < 44.0)] == 0.0)
    assert max(map(abs, made.speeds_rad_s)) < 60.0


@pytest.mark.slow
@pytest.mark.parametrize(
    ("family", "current_A", "window_s"),
    [(FAMILIES[0], 0.041, 600.0), *((FAMILIES[i], 0.0, 200.0) for i in (0, 1, 2, 4))],
    indirect=["family"],
)
def test_steady_telemetry_is_not_stuck(tmp_path: Path, current_A: float, window_s: float) -> None:
    """Row 16: 15 min at a steady speed, or 5 at rest, without noise: readings repeat, and nobody is alarmed.

    At rest each family, whose readings come in other ways, has a third of the watch's window and of the time.
    """
    still = {"profile": "sine", "amplitude_A": 0.0, "bias_A": current_A}
    wheel_at_rest = LineWheel(tmp_path, speed_rad_s=0.0, noise_rpm=0.0)
    ran = wheel_at_rest.run(1.5 * window_s, command=still, watch={"window_s": window_s})
    assert ran.notes.states == ["TRACKING"]
    assert ran.outcome.findings == ()


@EACH_FAMILY
def test_a_brown_out_is_a_new_beginning_of_the_same_wheel(tmp_path: Path) -> None:
    """Row 17: uptime from zero, no current: set up again from zero, parameters kept, speed seeded anew, then on."""
    made = wheel(tmp_path, "reset@20s")
    ran = made.run(60.0, command=SINE)
    assert ran.notes.events.count("wheel_restarted") == 1
    assert ran.notes.states[-1] == "TRACKING"
    assert ran.log.segment.max() == 1
    first = int(np.argmax(ran.log.segment > 0))
    assert np.any(ran.log.current_A[first + 5 :] != 0.0)
    assert ran.outcome.statistics.rejected <= 1
    truth = made.parameters
    for name in ("motor_gain", "coulomb"):
        error = getattr(ran.outcome.belief.parameters, name) - getattr(truth, name)
        assert abs(error) < 4.0 * getattr(ran.outcome.belief.parameter_std, name)


@pytest.mark.parametrize("family", CONFIRMED_BY_TELEMETRY, indirect=True)
def test_telemetry_that_stands_still_bears_no_command_out(tmp_path: Path) -> None:
    """Row 16: where telemetry confirms, a frozen one takes no command: said once, zero written; then on as before."""
    made = wheel(tmp_path, "freeze@20s:3s")
    ran = made.run(60.0, command=SINE)
    assert ran.notes.events.count("commands_not_taken") == 1
    assert ran.notes.states[-1] == "TRACKING"
    assert ran.outcome.zero_confirmed
    assert max(map(abs, made.speeds_rad_s)) < 60.0
    assert np.any(ran.log.current_A[ran.log.time_s > ran.log.time_s[-1] - 5.0] != 0.0)


@pytest.mark.parametrize("family", CONFIRMED_BY_TELEMETRY, indirect=True)
def test_telemetry_that_stands_still_for_long_is_safe_though_nothing_refuses(tmp_path: Path) -> None:
    """Row 16: a frozen one that takes no command for longer than limits.safe_after_s: a person says when to go on."""
    ran = wheel(tmp_path, "freeze@20s:10s").run(40.0, command=SINE)
    assert ran.notes.states[-1] == "SAFE"
    assert ran.outcome.zero_confirmed
