"""A wheel whose clock runs at another rate than the host's: what is not read is put where the wheel was."""

from __future__ import annotations

import numpy as np
import pytest

from rw_ekf.clock import VirtualClock
from rw_ekf.live.guard import SafetyLimits
from rw_ekf.live.live_wheel import LiveWheel, Place
from rw_ekf.live.stop_signal import StopSignal
from rw_ekf.records import IssuedCommand, LinkCounters, WheelIdentity, WheelSample

RATE = 6.0
LOST = 600


class FastWheel:
    """Six seconds of its own in each of ours; one reading is lost."""

    source = "test"
    link = LinkCounters()
    identity: WheelIdentity | None = None

    def __init__(self, clock: VirtualClock) -> None:
        self.clock = clock
        self.reads = 0

    def read(self, timeout_s: float) -> WheelSample | None:
        self.reads += 1
        return None if self.reads == LOST else WheelSample(RATE * self.clock.monotonic(), 1.0)

    def stop_current(self, by: str | None = None) -> IssuedCommand:
        return self.command_current(0.0)

    def command_current(self, current_A: float) -> IssuedCommand:
        raise AssertionError("this run never writes")

    def close(self) -> None:
        pass


def test_a_lost_reading_has_the_wheel_s_time() -> None:
    """The row without a speed stands one sample period of the wheel after the one before, not a sixth of it."""
    clock = VirtualClock()
    limits = SafetyLimits(0.1, 1.0, 1000.0, 80.0, 0.5)
    with StopSignal() as stop:
        wheel = LiveWheel(Place(lambda _: FastWheel(clock)), limits, 50.0, stop, clock, writes=False)
        samples = [reading.sample for reading in wheel.readings(lambda: RATE * 15.0) if reading.sample is not None]
    assert samples[LOST - 1].speed_rad_s is None
    times = [sample.time_s for sample in samples]
    assert np.diff(times) == pytest.approx(RATE / 50.0)
    assert clock.monotonic() == pytest.approx(15.0, abs=0.1)
