"""The daemon's loop over a simulated wheel: a spike in mid-run is logged, published and reported."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import pytest

from rw_ekf.commands.run_report import warnings_of
from rw_ekf.drivers.sim.simulated_wheel import SimulatedWheel
from rw_ekf.live.stop_signal import StopSignal
from rw_ekf.logs.metadata import read_metadata
from rw_ekf.spikes.run_events import read_run
from tests.live.bench import served_wheel
from tests.live.daemon import run
from tests.live.virtual import published
from tests.live.virtual import run as run_virtually

# The wheel is known well, so that the estimator has settled before the spike: a test cannot wait for minutes.
PRIOR = {
    "motor_gain": {"value": 15.205, "std": 0.01},
    "viscous": {"value": 0.00322, "std": 0.0001},
    "coulomb": {"value": 0.5863, "std": 0.002},
    "static": {"value": 0.6037, "std": 0.01},
}
AMPLITUDE_RAD_S2 = 1.5
SPIKE_S = 5.0


def spike(wheel: SimulatedWheel, stop: StopSignal) -> None:
    """From now on the wheel drags, less and less."""
    plant = wheel.truth
    plant.parameters = plant.parameters._replace(
        spike_rad_s2=AMPLITUDE_RAD_S2, spike_onset_s=plant.time_s, spike_decay_s=5.0
    )


def test_a_spike_in_a_run_is_logged_published_and_reported(tmp_path: Path) -> None:
    """Said as `drag_spike` with amplitude and hour, it is in the state file while it lasts, ends, and is reported."""
    published_alarms: list[list[dict[str, Any]]] = []

    def look(wheel: SimulatedWheel, stop: StopSignal) -> None:
        published_alarms.append(published(tmp_path, wheel.truth.time_s - 1.5)["alarms"])

    ran, _ = run_virtually(
        tmp_path, 30.0, (SPIKE_S - 1.0, look), (SPIKE_S, spike), (SPIKE_S + 4.0, look), speed_rad_s=30.0,
        filter={"prior": PRIOR}, command={"profile": "sine", "amplitude_A": 0.0, "bias_A": 0.15},
        loop={"rate_hz": 10.0},
    )  # fmt: skip
    assert published_alarms[0] == []
    (entry,) = published_alarms[1]
    assert entry["name"] == "drag_spike"
    alarms = [(event, fields) for event, fields in ran.notes.stated if event.startswith("drag_spike")]
    assert [event for event, _ in alarms] == ["drag_spike", "drag_spike_over"]
    first, last = alarms[0][1], alarms[1][1]
    began_s = ran.log.time_s[0]
    assert SPIKE_S - 0.3 < first["since_s"] - began_s < SPIKE_S + 1.0
    assert first["amplitude_rad_s2"] == pytest.approx(
        AMPLITUDE_RAD_S2, rel=0.35
    )  # it has half decayed when it is sized
    assert first["amplitude_mNm"] == pytest.approx(1.5 * first["amplitude_rad_s2"])
    assert last["ended_s"] - last["since_s"] < 24.0
    metadata = read_metadata(ran.outcome.files.log)
    assert metadata is not None
    assert first["since_utc"][:13] >= metadata.first_sample_utc[:13]
    assert any("drag spike" in text for text in ran.outcome.alarms)
    assert any("drag spike" in text for text in warnings_of(ran.outcome))
    kept = read_run(ran.outcome.files.log)
    assert kept is not None
    (found,) = kept.spikes
    assert found.amplitude_mNm == pytest.approx(first["amplitude_mNm"])
    assert found.percent_of_coulomb == pytest.approx(100.0 * first["amplitude_rad_s2"] / 0.5863, rel=0.02)
    assert found.speed_rpm == pytest.approx(30.0 * 60.0 / (2.0 * math.pi), rel=0.3)
    assert found.end == last["end"]
    assert 25.0 < kept.watched_s <= 30.0


def test_a_watch_that_is_switched_off_says_nothing(tmp_path: Path) -> None:
    """`watch.enabled: false`: the run works, and its state file has no alarms."""
    with served_wheel(tmp_path) as bench:
        ran = run(bench, 0.6, watch={"enabled": False})
        state = json.loads(ran.outcome.files.state.read_text(encoding="utf-8"))
    assert "alarms" not in state
    assert ran.outcome.alarms == ()
