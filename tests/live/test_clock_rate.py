"""A wheel whose clock runs at another rate than the host's: what is not read is put where the wheel was."""

from __future__ import annotations

import time

import pytest

from rw_ekf.live import live
from rw_ekf.live.guard import SafetyLimits
from rw_ekf.live.live import LiveWheel
from rw_ekf.live.stop_signal import StopSignal
from rw_ekf.records import IssuedCommand, LinkCounters, WheelIdentity, WheelSample

RATE = 6.0


class FastWheel:
    """Six seconds of its own in each of ours; one reading is lost."""

    source = "test"
    link = LinkCounters()
    identity: WheelIdentity | None = None

    def __init__(self) -> None:
        self.began_s = time.monotonic()
        self.reads = 0

    def read(self, timeout_s: float) -> WheelSample | None:
        self.reads += 1
        return None if self.reads == 20 else WheelSample(RATE * (time.monotonic() - self.began_s), 1.0)

    def command_current(self, current_A: float) -> IssuedCommand:
        raise AssertionError("this run never writes")

    def close(self) -> None:
        pass


def test_a_lost_reading_has_the_wheel_s_time(monkeypatch: pytest.MonkeyPatch) -> None:
    """The row without a speed stands one sample period of the wheel after the one before, not a sixth of it."""
    monkeypatch.setattr(live, "_RATE_AFTER_S", 0.2)
    with StopSignal() as stop:
        wheel = LiveWheel(lambda _: FastWheel(), SafetyLimits(0.1, 1.0, 1000.0, 80.0, 0.5), 50.0, stop, writes=False)
        samples = [reading.sample for reading in wheel.readings(3.0)]
    lost = next(i for i, sample in enumerate(samples) if sample.speed_rad_s is None)
    assert samples[lost].time_s - samples[lost - 1].time_s == pytest.approx(RATE / 50.0, rel=0.3)
    assert samples[lost + 1].time_s > samples[lost].time_s
