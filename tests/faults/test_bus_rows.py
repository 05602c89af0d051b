"""The list of faults on a line of four wheels, on a virtual clock: what strikes one wheel is that wheel's alone."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from rw_ekf.logs.reader import read_log
from tests.live.bus import FAMILIES, NAMES, PERIOD_S, TIMEOUT_S, BusBench, BusRan, make_bus, run_bus

EACH_FAMILY = pytest.mark.parametrize(
    "family", [FAMILIES[0], *(pytest.param(one, marks=pytest.mark.slow) for one in FAMILIES[1:])]
)
STRUCK = "rw-y"
# Row of the list, and the fault, from the fifth second to the eighth where it lasts.
OF_ONE_WHEEL = {
    "13 id": "id",
    "13 length": "length",
    "14 nack": "nack@5s:3s",
    "14 nack, and acted": "nack-acted@5s:3s",
    "15 silence 0.3 s": "silence@5s:300ms",
    "15 silence 3 s": "silence@5s:3s",
    "15 no power": "dead@5s:3s",
    "16 frozen": "freeze@5s:3s",
    "17 reset": "reset@5s:1s",
    "18 not a number": "value:speed=nan@5s:3s",
    "18 out of range": "value:speed=1e6@5s:3s",
    "20 spikes": "spike:500:0.2@5s:3s",
    "22 its clock jumps": "clock:1h@5s:1s",
}
OF_THE_LINE = {
    "1 unplugged": "hangup@5s:3s",
    "7 split": "dribble:1ms@5s:3s",
    "8 bit flips": "flip:0.3@5s:3s",
    "8 junk": "insert:0.5:12@5s:3s",
    "9 endless junk": "flood:3000@5s:3s",
    "10 late": "delay/from:60ms:0.15@5s:3s",
    "11 twice": "duplicate@5s:3s",
    "12 the echo stays out": "",
    "15 the line is silent": "silence@5s:3s",
    "23 slow adapter": "delay/from:16ms@5s:3s",
    "24 blocked": "block@5s:3s",
}


def assert_recovered(bench: BusBench, ran: BusRan, names: tuple[str, ...]) -> None:
    """Each is driven at the end as at the beginning, and has its zero behind it."""
    for name in names:
        outcome = ran.outcome(name)
        assert ran.notes[name].states[-1] == "TRACKING", (name, ran.notes[name].said)
        late = [abs(current) for at_s, current in bench[name].written if 13.0 < at_s < 19.0]
        assert max(late) > 0.05
        assert outcome.zero_confirmed
        assert bench[name].electronics.command_A == 0.0
        speeds = read_log(outcome.files.log).speed_rad_s
        assert np.nanmax(np.abs(speeds)) < 1000.0


@EACH_FAMILY
@pytest.mark.parametrize("row", OF_ONE_WHEEL)
def test_a_fault_of_one_wheel_is_its_own(row: str, family: str, tmp_path: Path) -> None:
    """It recovers, or is held at zero where only a person may let it go on; the others lose no turn and no row."""
    fault = OF_ONE_WHEEL[row]
    fault = fault if "@" in fault else f"{fault}:0.5@5s:3s"
    bench = make_bus(tmp_path, "nowhere", family, f"echo,{STRUCK}={fault}")
    ran = run_bus(bench, 20.0)
    others = tuple(name for name in NAMES if name != STRUCK)
    assert_recovered(bench, ran, others)
    for name in others:
        timing, statistics = ran.outcome(name).timing, ran.outcome(name).statistics
        assert timing.overruns == 0
        assert statistics.missing == 0
        assert 1e-3 * timing.late_ms_max <= TIMEOUT_S
        assert statistics.samples >= 20.0 / PERIOD_S - 6
    assert bench[STRUCK].electronics.command_A == 0.0
    assert ran.outcome(STRUCK).zero_confirmed
    if ran.notes[STRUCK].states[-1] != "SAFE":
        assert_recovered(bench, ran, (STRUCK,))


@EACH_FAMILY
@pytest.mark.parametrize("row", OF_THE_LINE)
def test_after_a_fault_of_the_line_all_wheels_are_driven_again(row: str, family: str, tmp_path: Path) -> None:
    """Whatever became of them meanwhile: when it is over, every wheel is tracked and driven, and ends at zero."""
    echo = OF_THE_LINE[row] or "echo@0s:5s,echo@8s"  # an adapter that forgets to echo for three seconds
    faults = echo if not OF_THE_LINE[row] else f"echo,{OF_THE_LINE[row]}"
    bench = make_bus(tmp_path, "nowhere", family, faults)
    ran = run_bus(bench, 20.0)
    assert_recovered(bench, ran, NAMES)
