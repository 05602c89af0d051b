"""Nothing is driven blind: telemetry that stands still, a wrong sign, a clock that jumps, another wheel, a fault."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from rw_ekf.settings.resources import protocol_path
from rw_ekf.units import RAD_S_PER_RPM
from tests.live.bench import CURRENT_COMMAND, ROOT, Bench, document_of, program, served_wheel, virtual_wheel, wait_for
from tests.live.daemon import Ran, resume, run
from tests.live.test_line_faults import fault

STEADY = {"profile": "steps", "amplitude_A": 0.25, "period_s": 60.0, "bias_A": 0.0}


@pytest.fixture
def bench(tmp_path: Path) -> Iterator[Bench]:
    """A wheel on a pty."""
    with served_wheel(tmp_path, initial_speed_rad_s=2.0) as made:
        yield made


@pytest.fixture
def timed(tmp_path: Path) -> Bench:
    """A wheel on a virtual clock, for what says how many turns something takes."""
    return virtual_wheel(tmp_path, initial_speed_rad_s=2.0)


def times_of(ran: Ran, event: str) -> int:
    return ran.notes.events.count(event)


def reported(ran: Ran, words: str) -> bool:
    return any(words in text for text in ran.outcome.findings)


def test_one_reply_repeated_is_silence(timed: Bench) -> None:
    """Its time stands still: zero within the silence, said, the log without those speeds, the run ends in time."""
    ran = run(timed, 3.0, *fault(timed, 1.0, 60.0, "repeat/cycle"), command=STEADY, limits={"speed_rpm": 100.0})
    assert timed.registers.command_A == 0.0
    assert timed.registers.plant.speed_rad_s < 2.0 + 15.205 * 0.25 * 2.0
    assert times_of(ran, "silence") == 1
    assert reported(ran, "repeated one reply")
    assert ran.outcome.lost
    assert np.isfinite(ran.log.speed_rad_s).sum() <= 13
    assert ran.outcome.timing.ticks <= 33


def test_a_frozen_speed_is_not_driven_by(timed: Bench) -> None:
    """The clock runs on: STUCK is said, zero is written, and stays until the speed moves and a person says resume."""
    ran = run(
        timed,
        7.0,
        *fault(timed, 1.2, 3.0, "freeze/cycle:speed"),
        (5.0, resume),
        command={"profile": "sine", "amplitude_A": 0.3, "period_s": 8.0},
    )
    assert times_of(ran, "telemetry_stuck") == 1
    assert times_of(ran, "telemetry_alive") == 1
    assert reported(ran, "the speed reading is stuck")
    log = ran.log
    blind = np.isnan(log.speed_rad_s)
    assert 5 <= int(blind.sum()) <= 35
    runs = np.split(np.flatnonzero(blind), np.flatnonzero(np.diff(np.flatnonzero(blind)) > 1) + 1)
    frozen = max(runs, key=len)
    after = frozen[-1] + 1
    assert np.all(log.current_A[frozen[6:]] == 0.0)
    assert np.all(log.current_A[after : after + 5] == 0.0)
    assert np.any(log.current_A[after:] != 0.0)
    assert ran.notes.states == ["TRACKING", "DEGRADED", "SAFE", "CONNECTING", "TRACKING"]
    assert ran.outcome.statistics.rejected <= 4  # repeats that the gate refused before they were several steps off
    assert timed.registers.command_A == 0.0


def states_of(bench: Bench) -> list[str]:
    """States that the run has been in so far."""
    texts = (path.read_text(encoding="utf-8") for path in bench.runs.glob("*.events.jsonl"))
    events = [json.loads(line) for text in texts for line in text.splitlines()]
    return [event["state"] for event in events if event["event"] == "state"]


def wrong_map(directory: Path, field: str, scale: float, protocol: str = "sunspace-wheel") -> str:
    """A copy of the wire map in which one scale, of all registers that have the field, is multiplied."""
    content = yaml.safe_load(protocol_path(protocol).read_text(encoding="utf-8"))
    if "dbc" in content:
        return wrong_database(directory, field, scale, content)
    names = (
        (field, "current") if (field, protocol) == ("current_command", "vesc-wheel") else (field,)
    )  # by it one is taken
    for register in content["registers"]:
        for entry in register.get("fields", ()):
            if entry["name"] in names:
                entry["scale"] = scale * entry.get("scale", 1.0)
    path = directory / "wrong-map.yaml"
    path.write_text(yaml.safe_dump(content, sort_keys=False), encoding="utf-8")
    return str(path)


def wrong_database(directory: Path, field: str, scale: float, content: dict[str, Any]) -> str:
    """The same of a map of CAN messages, whose scales stand in its DBC."""
    lines = (ROOT / "config" / content["dbc"]).read_text(encoding="utf-8").splitlines(keepends=True)
    begins = {"speed": (" SG_ Speed ",), "current_command": (" SG_ CurrentCommand ", " SG_ Current : 0|")}[field]
    for i, line in enumerate(lines):
        if line.startswith(begins):
            before, now = re.split(r"(?<=\()[^,]+(?=,)", line, maxsplit=1)
            lines[i] = f"{before}{scale * float(line[len(before) : -len(now)]):g}{now}"
    (directory / content["dbc"]).write_text("".join(lines), encoding="utf-8")
    path = directory / "wrong-map.yaml"
    path.write_text(yaml.safe_dump(content, sort_keys=False), encoding="utf-8")
    return str(path)


@pytest.mark.parametrize("field", ["speed", "current_command"])
def test_a_wrong_sign_in_the_wire_map_is_not_driven_on(bench: Bench, field: str) -> None:
    """Either sign: SAFE to the end, exit status 5, both lines of the map are named, and the limit was never far."""
    path = wrong_map(bench.directory, field, -1.0)
    config = bench.config(
        wheel={"port": bench.port, "protocol": path},
        limits={"current_A": 0.3, "speed_rpm": 60.0},
        command={"profile": "sine", "amplitude_A": 0.2, "period_s": 6.0, "bias_A": 0.0},
    )
    with program("run", "--config", str(config), "--json") as daemon:
        wait_for(lambda: "SAFE" in states_of(bench), 60.0)
        written = len(bench.recorder.writes_A())
        wait_for(lambda: len(bench.recorder.writes_A()) > written + 25, 60.0)
        daemon.terminate()
        out, _ = daemon.communicate(timeout=60.0)
    assert daemon.returncode == 5
    document = document_of(out)
    (entry,) = document["logs"]
    assert document["state"]["state"] == "SAFE"
    (stated,) = [text for text in entry["warnings"] if text.startswith("a positive current turns the wheel backward")]
    lines = Path(path).read_text(encoding="utf-8").splitlines()
    named = [lines[int(part.split(" ")[0]) - 1] for part in stated.split(f"{path}:")[1:]]
    assert len(named) == 2
    assert all("scale: " in line for line in named)
    assert abs(bench.registers.plant.speed_rad_s) < 100.0 * RAD_S_PER_RPM
    assert bench.registers.command_A == 0.0
    assert all(value == 0.0 for value in bench.recorder.writes_A()[-20:])


def test_a_scale_ten_times_off_is_a_finding(timed: Bench) -> None:
    """The run goes to its end, and says that the gain is ten times what is expected and where to look."""
    ran = run(
        timed,
        6.0,
        wheel={"port": timed.port, "protocol": wrong_map(timed.directory, "speed", 10.0)},
        limits={"speed_rpm": 4200.0},
        command={"profile": "sine", "amplitude_A": 0.2, "period_s": 3.0, "bias_A": 0.0},
    )
    assert reported(ran, "times what the built-in prior says")
    assert reported(ran, "wrong-map.yaml:")
    assert ran.outcome.halted is None


@pytest.mark.parametrize("jump_s", [3600.0, -50.0])
def test_a_clock_that_jumps_begins_a_segment_and_nothing_else(timed: Bench, jump_s: float) -> None:
    """The duration is the host's, delays are as before, no reading is rejected, and the jump is said."""

    def jump() -> None:
        timed.registers._uptime_zero_s -= jump_s

    ran = run(timed, 2.5, (1.0, jump))
    assert ran.outcome.timing.ticks <= 28
    assert 1.5 < ran.outcome.statistics.duration_s < 2.8
    assert times_of(ran, "clock_jumped") == 1
    assert reported(ran, "clock jumped")
    assert list(np.unique(ran.log.segment)) == [0, 1]
    assert ran.log.command_delay_s.max() < 0.1
    assert ran.outcome.statistics.rejected == 0


def test_a_zero_that_is_confirmed_late_makes_no_healthy_reading_wrong(timed: Bench) -> None:
    """Zeros taken at once and confirmed a second later: the interval is unknown, a new segment, nothing rejected."""
    taken = {"profile": "steps", "amplitude_A": 0.4, "period_s": 60.0, "bias_A": 0.0}
    deaf = [(at_s, partial(timed.fault, text)) for at_s, text in ((1.0, "silence"), (2.2, "silence/cycle"), (2.6, ""))]
    ran = run(timed, 3.8, *deaf, command=taken)
    assert ran.outcome.statistics.rejected == 0
    assert ran.log.segment.max() == 1
    last = np.flatnonzero(np.isnan(ran.log.speed_rad_s))[-1]
    assert ran.log.segment[last] == 0
    assert ran.log.segment[last + 1] == 1


@pytest.mark.parametrize(("bit", "event"), [(1, "wheel_fault"), (4, "wheel_over_temperature")])
def test_a_flag_of_the_status_register_is_said_and_holds_zero(timed: Bench, bit: int, event: str) -> None:
    """Zero while the flag is up, an event and a finding; then the profile goes on, after heat when a person says so."""
    ran = run(timed, 4.4, *fault(timed, 0.8, 2.2, f"flag:{bit}"), (3.2, resume))
    assert times_of(ran, event) == 1
    assert times_of(ran, f"{event}_over") == 1
    assert reported(ran, "status register")
    up = ran.log.channels["status"] == bit
    assert up.any()
    assert np.all(ran.log.current_A[up] == 0.0)
    assert np.any(ran.log.current_A[np.flatnonzero(up)[-1] + 1 :] != 0.0)
    latched = ["SAFE", "CONNECTING"] if bit == 4 else ["DEGRADED"]
    assert ran.notes.states == ["TRACKING", *latched, "TRACKING"]


def test_a_wheel_that_restarts_is_set_up_anew(timed: Bench) -> None:
    """The restart is said, and the first write after it is zero: the way up begins there."""
    at: list[int] = []

    def restart() -> None:
        at.append(len(timed.recorder.writes_A()))
        timed.registers.restart()

    ran = run(timed, 2.2, (1.1, restart), command=STEADY)
    assert times_of(ran, "wheel_restarted") == 1
    assert 0.0 in timed.recorder.writes_A()[at[0] : at[0] + 2]
    assert any(abs(value) > 0.01 for value in timed.recorder.writes_A()[at[0] + 2 : -1])


def test_another_wheel_after_a_replug_is_not_driven(bench: Bench) -> None:
    """Its serial number is another: zero, the run ends with a sentence, and not one current reached that wheel."""
    before: list[int] = []

    def swap() -> None:
        before.append(len(bench.recorder.requests))
        bench.registers._serial_number = 77
        bench.plug()

    ran = run(bench, 6.0, (0.8, bench.unplug), (1.3, swap))
    assert ran.outcome.halted is not None
    assert "77" in ran.outcome.halted
    assert reported(ran, "another wheel answers")
    published = json.loads(ran.outcome.files.state.read_text(encoding="utf-8"))
    assert published["ended_utc"] is not None
    assert published["reason"] == ran.outcome.halted
    assert ran.outcome.statistics.duration_s < 2.0
    since = bench.recorder.requests[before[0] :]
    assert all(frame.data == b"\0\0" for _, frame in since if frame.id == CURRENT_COMMAND)


def test_the_same_wheel_after_a_replug_is_driven_on(bench: Bench) -> None:
    """Who answers is asked again, and it is the one that was there before."""
    ran = run(bench, 3.2, (0.8, bench.unplug), (1.3, bench.plug))
    assert ran.outcome.halted is None
    assert not reported(ran, "another wheel")
    assert np.any(ran.log.current_A[-5:] != 0.0)
