"""The daemon on a line that fails: what is missing is missing, zero is written in silence, and the run goes on.

Over the real driver on a virtual clock, so that a reply is late only where a fault makes it so.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from rw_ekf.drivers.line.registers import telling_register
from rw_ekf.units import RAD_S_PER_RPM
from tests.live.bench import CONFIRMED_BY_TELEMETRY, FAMILIES, Bench, virtual_wheel
from tests.live.daemon import Event, Ran, resume, run


@pytest.fixture(params=FAMILIES)
def bench(tmp_path: Path, request: pytest.FixtureRequest) -> Bench:
    """A wheel of each family."""
    return virtual_wheel(tmp_path, protocol=request.param)


def fault(bench: Bench, from_s: float, to_s: float, text: str) -> tuple[Event, Event]:
    """Two events: the faults come, and go."""
    return (from_s, lambda: bench.fault(text)), (to_s, lambda: bench.fault(""))


def error_rpm(ran: Ran) -> float:
    """How far the filter's last speed is from the last reading, of 1 rpm, that the wheel sent [rpm].

    Not from the wheel's speed by now: it coasts at zero current until somebody looks, however long that takes.
    """
    speeds = ran.log.speed_rad_s
    return abs(float(ran.outcome.belief.mean[0]) - float(speeds[np.isfinite(speeds)][-1])) / RAD_S_PER_RPM


def test_dropped_replies_are_missing_samples_and_the_run_recovers(bench: Bench) -> None:
    """Replies lost for less than the silence: rows without a speed on the same grid of time, no zero, then all well."""
    ran = run(bench, 2.0, *fault(bench, 0.7, 1.3, "silence"), limits={"silence_s": 1.0})
    assert 4 <= ran.outcome.statistics.missing <= 8
    assert ran.outcome.statistics.samples == pytest.approx(21, abs=2)
    assert ran.outcome.link.timeouts >= 4
    assert ran.outcome.zero_confirmed
    assert not ran.outcome.lost
    log = ran.log
    assert int(np.isnan(log.speed_rad_s).sum()) == ran.outcome.statistics.missing
    assert float(np.median(np.diff(log.time_s))) == pytest.approx(0.1, abs=0.03)
    assert log.segment.max() <= 1  # a fault that falls between a read and its write leaves the current unknown
    assert ran.outcome.statistics.rejected <= 2
    assert "silence" not in ran.notes.events
    gap = np.flatnonzero(np.isnan(log.speed_rad_s))
    assert np.unique(log.current_A[gap[0] - 1 : gap[-1] + 1]).size == 1  # held, as the wheel held it


def test_in_silence_zero_is_written_again_and_again_and_then_the_run_goes_on(bench: Bench) -> None:
    """Beyond silence_s the wheel is sent zero at every tick though it never answers; then the profile resumes."""
    ran = run(bench, 2.6, *fault(bench, 0.6, 1.6, "silence"))
    writes = bench.recorder.writes_A()
    run_of_zeros = longest_run_of_zeros(writes)
    assert run_of_zeros >= 4
    after = writes[len(writes) - writes[::-1].index(0.0, 1) :] if 0.0 in writes[:-1] else writes
    assert any(abs(value) > 0.01 for value in after[:-1])
    assert ran.notes.events.count("silence") == 1
    assert ran.notes.events.count("telemetry_back") == 1
    assert not ran.outcome.lost
    assert bench.registers.command_A == 0.0
    assert error_rpm(ran) < 5.0


def test_a_zero_confirmed_in_silence_is_in_the_log_from_when_it_acted(bench: Bench) -> None:
    """Only the readings are lost: the zero is confirmed, logged as a row without a speed, and nothing is re-seeded."""
    ran = run(bench, 2.4, *fault(bench, 0.7, 1.5, f"silence/{bench.registers.wire_map.speed_register.name}"))
    log = ran.log
    assert ran.outcome.statistics.rejected == 0
    if bench.protocol in CONFIRMED_BY_TELEMETRY:
        pytest.skip("telemetry is what confirms here: no zero is confirmed without it")
    assert log.segment.max() == 0
    gap = np.flatnonzero(np.isnan(log.speed_rad_s))
    assert log.current_A[gap[-1]] == 0.0
    assert np.any(log.current_A[: gap[0]] != 0.0)
    assert np.any(log.current_A[gap[-1] + 1 :] != 0.0)


def test_a_write_that_is_taken_but_never_confirmed_does_not_mislead_the_filter(bench: Bench) -> None:
    """The wheel obeys and its confirmations are lost: what is in force is read back, and the log has it, unbroken."""
    steps = {"profile": "steps", "amplitude_A": 0.3, "period_s": 1.0, "bias_A": 0.0}
    ran = run(bench, 2.4, *fault(bench, 0.9, 1.4, "silence/current_command"), command=steps)
    assert ran.outcome.statistics.rejected == 0
    if telling_register(bench.registers.wire_map) is None:
        pytest.skip("this wheel tells no command that could be read back: each such write begins a segment")
    assert ran.log.segment.max() == 0
    reported_A = ran.log.channels["current_A"]
    assert np.allclose(reported_A[1:], ran.log.current_A[:-1], atol=1e-7)
    assert ran.outcome.zero_confirmed


def test_a_wheel_that_restarts_begins_a_new_segment_with_the_parameters_kept(bench: Bench) -> None:
    """The log's segment changes, time restarts in it with the uptime, the speed is re-seeded, k goes on."""
    ran = run(bench, 2.2, (1.1, bench.registers.restart))
    log = ran.log
    first = int(np.argmax(log.segment > 0))
    if bench.registers.wire_map.speed_register.field("uptime"):
        assert log.time_s[first] < 1.0 < log.time_s[first - 1]
    assert ran.outcome.statistics.reseeded >= 1
    assert ran.outcome.statistics.rejected == 0
    estimates = np.genfromtxt(ran.outcome.files.estimates, delimiter=",", names=True, dtype=None, encoding="utf-8")
    gains, stds = estimates["motor_gain"], estimates["std_motor_gain"]
    assert gains[first] == pytest.approx(gains[first - 1], rel=1e-9)
    assert stds[first] == pytest.approx(stds[first - 1], rel=1e-3)
    assert ran.outcome.zero_confirmed


def test_a_hot_wheel_is_given_no_current_until_it_has_cooled(bench: Bench) -> None:
    """Above limits.temperature_degC only zero is written; and below it again, until a person says resume."""
    ran = run(bench, 3.4, *fault(bench, 0.7, 1.4, "heat:80"), (2.2, resume))
    assert longest_run_of_zeros(bench.recorder.writes_A()) >= 5
    log = ran.log
    hot = log.channels["temperature_degC"] > 60.0
    assert hot.sum() >= 5
    assert np.all(log.current_A[hot] == 0.0)
    after = np.flatnonzero(hot)[-1] + 1
    assert np.all(log.current_A[after : after + 4] == 0.0)
    assert np.any(log.current_A[after:] != 0.0)
    assert ran.notes.states[1:] == ["SAFE", "CONNECTING", "TRACKING"]
    assert ("command_changed", "over_temperature") in [(e, c.get("reason")) for e, c in ran.notes.stated]


def longest_run_of_zeros(currents: list[float]) -> int:
    """Length of the longest row of zeros."""
    longest = present = 0
    for current in currents:
        present = present + 1 if current == 0.0 else 0
        longest = max(longest, present)
    return longest
