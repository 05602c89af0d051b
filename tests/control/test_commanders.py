"""What is asked for after each sample, and a run beside another controller, which never writes."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from rw_ekf.control.commanders import ProfileController, commander_of, logged_profile
from rw_ekf.control.profiles.make_profile import make_profile
from rw_ekf.errors import ConfigError
from rw_ekf.live.loop import with_following_command
from rw_ekf.records import LinkState, Reading, WheelSample
from rw_ekf.settings.schema import CommandSection
from tests.live.bench import CURRENT_COMMAND, Bench, served_wheel, wait_for
from tests.live.daemon import run
from tests.ticks import tick_of


@pytest.fixture
def bench(tmp_path: Path) -> Iterator[Bench]:
    """A wheel on a pty."""
    with served_wheel(tmp_path) as made:
        yield made


def test_a_profile_is_asked_at_the_time_since_the_first_sample() -> None:
    """Wheel time may begin anywhere: the profile begins at its own zero."""
    controller = ProfileController(make_profile("sine", amplitude_A=0.1, period_s=4.0))
    wanted = [controller(tick_of(WheelSample(1000.0 + time_s, 1.0))) for time_s in (0.0, 1.0, 3.0)]
    assert wanted == pytest.approx([0.0, 0.1, -0.1], abs=1e-12)


def test_a_profile_goes_on_through_a_restart_of_the_wheel() -> None:
    """A new segment, whose time begins again, pauses the profile for one sample and does not throw it back."""
    controller = ProfileController(make_profile("sine", amplitude_A=0.1, period_s=4.0))
    for sample in (WheelSample(50.0, 1.0), WheelSample(50.5, 1.0), WheelSample(0.1, 1.0, segment=1)):
        controller(tick_of(sample))
    assert controller(tick_of(WheelSample(0.6, 1.0, segment=1))) == pytest.approx(0.1, abs=1e-12)


def test_a_logged_current_is_repeated_over_its_own_time(tmp_path: Path) -> None:
    """Each value of the log holds from its time to the next, over segments too; at its end the current is zero."""
    log = tmp_path / "log.csv"
    log.write_text(
        "time_s,speed_rpm,current_command_A,segment\n5,0,0.1,0\n6,0,0.2,0\n7,0,0.3,0\n0,0,0.4,1\n1,0,0.5,1\n",
        encoding="utf-8",
    )
    profile = logged_profile(str(log))
    assert [profile.current_A(t) for t in (0.0, 0.99, 1.0, 2.5, 9.0)] == [0.1, 0.1, 0.2, 0.4, 0.0]
    assert commander_of(CommandSection(profile="log", log=str(log))).lasts_s() == profile.duration_s == 3.0


def pairs(readings: list[Reading]) -> list[tuple[float | None, float | None]]:
    """Time of each reading and the current that was found to follow it; None where it has none."""
    return [
        (None if reading.sample is None else reading.sample.time_s, None if command is None else command.current_A)
        for reading, command in with_following_command(iter(readings))
    ]


def test_beside_another_controller_an_interval_has_the_command_reported_at_its_end() -> None:
    """What a reading reports as in force was set after the reading before it; the last reading is dropped."""
    readings = [Reading(WheelSample(float(i), 1.0, current_command_A=0.1 * i)) for i in range(4)]
    paired = pairs(readings)
    assert paired == [(0.0, 0.1), (1.0, 0.2), (2.0, pytest.approx(0.3))]


def test_beside_another_controller_a_missed_tick_waits_for_the_next_report() -> None:
    """A sample that nothing is known of takes the command that is reported after it, and nobody invents a zero."""
    readings = [
        Reading(WheelSample(0.0, 1.0, current_command_A=0.1)),
        Reading(WheelSample(1.0, None)),
        Reading(WheelSample(2.0, 1.0, current_command_A=0.3)),
        Reading(WheelSample(3.0, 1.0, current_A=0.4)),
    ]
    paired = pairs(readings)
    assert paired == [(0.0, 0.3), (1.0, 0.3), (2.0, 0.4)]


def test_profile_none_never_writes_and_logs_what_the_other_controller_did(bench: Bench) -> None:
    """No frame with a writing id reaches the wheel, not even at the end; the log has the other's currents in place."""
    over = threading.Event()

    def controller() -> None:
        step = 0
        wait_for(lambda: bool(bench.recorder.requests))
        while not over.wait(0.37):
            step += 1
            bench.registers._command_current(0.05 * (-1) ** step)

    other = threading.Thread(target=controller, daemon=True)
    other.start()
    try:
        ran = run(bench, 2.5, command={"profile": "none"})
    finally:
        over.set()
        other.join(5.0)
    assert all(register >= 128 for register in bench.recorder.ids())
    assert bench.recorder.writes_A() == []
    assert ran.outcome.zero_confirmed  # nothing to confirm
    assert bench.registers.command_A != 0.0
    log = ran.log
    assert set(np.round(log.current_A, 6)) <= {-0.05, 0.0, 0.05}
    reported = log.channels["current_A"][1:]
    heard = np.isfinite(reported)  # a reply may be late on a busy machine, and its row has none
    assert heard.sum() > 15
    assert np.array_equal(np.round(reported[heard], 6), np.round(log.current_A[:-1][heard], 6))
    assert ran.outcome.statistics.rejected <= 2


def test_profile_none_in_silence_still_writes_nothing(bench: Bench) -> None:
    """A silent wheel beside another controller is not given a zero either."""

    def fall_silent() -> None:
        bench.fault("silence")

    ran = run(bench, 1.6, (0.5, fall_silent), command={"profile": "none"})
    assert ran.outcome.lost
    assert CURRENT_COMMAND not in bench.recorder.ids()


def test_profile_none_needs_a_current_in_telemetry(bench: Bench) -> None:
    """A wire map without current_command and current cannot serve a run that never writes: refused with both names."""
    import yaml

    from rw_ekf.settings.resources import protocol_path

    content = yaml.safe_load(protocol_path("sunspace-wheel").read_text(encoding="utf-8"))
    content["registers"] = [r for r in content["registers"] if r["name"] in {"current_command", "speed"}]
    (bench.directory / "map.yaml").write_text(yaml.safe_dump(content), encoding="utf-8")
    with pytest.raises(ConfigError, match="no current_command or current in its telemetry"):
        run(bench, 1.0, wheel={"protocol": str(bench.directory / "map.yaml")}, command={"profile": "none"})
    assert bench.recorder.requests == []  # before the port is opened


def test_beside_another_controller_a_turn_without_a_sample_is_told_at_once() -> None:
    """A line that is down is not kept waiting for a report that may never come."""
    readings = [Reading(WheelSample(0.0, 1.0, current_command_A=0.1)), Reading(None, LinkState.DOWN)]
    assert pairs(readings) == [(None, None)]
