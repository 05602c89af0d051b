"""The list of faults on a line of four wheels, on a virtual clock: what strikes one wheel is that wheel's alone."""

from __future__ import annotations

import itertools
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rw_ekf.logs.reader import read_log
from tests.live.bus import FAMILIES, NAMES, PERIOD_S, TIMEOUT_S, BusBench, BusRan, make_bus, run_bus

STRUCK = "rw-y"
# A wheel is driven from the second second on. A fault lasts from the third to the sixth; what has recovered is judged
# over the whole period of 4 s of the current that is asked for, from 5 s behind the fault's end on.
LASTS_S, DRIVEN_AGAIN_S = 15.5, (11.0, 15.0)
# Row of the list, and the fault.
OF_ONE_WHEEL = {
    "13 id": "id",
    "13 length": "length",
    "14 nack": "nack@3s:3s",
    "14 nack, and acted": "nack-acted@3s:3s",
    "15 silence 0.3 s": "silence@3s:300ms",
    "15 silence 3 s": "silence@3s:3s",
    "15 no power": "dead@3s:3s",
    "16 frozen": "freeze@3s:3s",
    "17 reset": "reset@3s:1s",
    "18 not a number": "value:speed=nan@3s:3s",
    "18 out of range": "value:speed=1e6@3s:3s",
    "20 spikes": "spike:500:0.2@3s:3s",
    "22 its clock jumps": "clock:1h@3s:1s",
}
OF_THE_LINE = {
    "1 unplugged": "hangup@3s:3s",
    "7 split": "dribble:1ms@3s:3s",
    "8 bit flips": "flip:0.3@3s:3s",
    "8 junk": "insert:0.5:12@3s:3s",
    "9 endless junk": "flood:3000@3s:3s",
    "10 late": "delay/from:60ms:0.15@3s:3s",
    "11 twice": "duplicate@3s:3s",
    "12 the echo stays out": "",
    "15 the line is silent": "silence@3s:3s",
    "23 slow adapter": "delay/from:16ms@3s:3s",
    "24 blocked": "block@3s:3s",
}


def with_families(rows: Iterable[str]) -> list[Any]:
    """Each row with NSP, and by turns with registers or lines of text: whose a fault is, no map decides."""
    others = itertools.cycle(FAMILIES[1:])
    twice = ((pytest.param(row, FAMILIES[0]), pytest.param(row, next(others), marks=pytest.mark.slow)) for row in rows)
    return [one for both in twice for one in both]


def assert_recovered(
    bench: BusBench, ran: BusRan, names: tuple[str, ...], driven_s: tuple[float, float] = (13.0, 19.0)
) -> None:
    """Each is driven at the end as at the beginning, and has its zero behind it; driven_s: from when, until when."""
    for name in names:
        outcome = ran.outcome(name)
        assert ran.notes[name].states[-1] == "TRACKING", (name, ran.notes[name].stated)
        late = [abs(current) for at_s, current in bench[name].written if driven_s[0] < at_s < driven_s[1]]
        assert max(late) > 0.05
        assert outcome.zero_confirmed
        assert bench[name].electronics.command_A == 0.0
        speeds = read_log(outcome.files.log).speed_rad_s
        assert np.nanmax(np.abs(speeds)) < 1000.0


@pytest.mark.parametrize(("row", "family"), with_families(OF_ONE_WHEEL))
def test_a_fault_of_one_wheel_is_its_own(row: str, family: str, tmp_path: Path) -> None:
    """It recovers, or is held at zero where only a person may let it go on; the others lose no turn and no row."""
    fault = OF_ONE_WHEEL[row]
    fault = fault if "@" in fault else f"{fault}:0.5@3s:3s"
    bench = make_bus(tmp_path, "nowhere", family, f"echo,{STRUCK}={fault}")
    ran = run_bus(bench, LASTS_S)
    others = tuple(name for name in NAMES if name != STRUCK)
    assert_recovered(bench, ran, others, DRIVEN_AGAIN_S)
    for name in others:
        timing, statistics = ran.outcome(name).timing, ran.outcome(name).statistics
        assert timing.overruns == 0
        assert statistics.missing == 0
        assert 1e-3 * timing.late_ms_max <= TIMEOUT_S
        assert statistics.samples >= LASTS_S / PERIOD_S - 6
    assert bench[STRUCK].electronics.command_A == 0.0
    assert ran.outcome(STRUCK).zero_confirmed
    if ran.notes[STRUCK].states[-1] != "SAFE":
        assert_recovered(bench, ran, (STRUCK,), DRIVEN_AGAIN_S)


@pytest.mark.parametrize(("row", "family"), with_families(OF_THE_LINE))
def test_after_a_fault_of_the_line_all_wheels_are_driven_again(row: str, family: str, tmp_path: Path) -> None:
    """Whatever became of them meanwhile: when it is over, every wheel is tracked and driven, and ends at zero."""
    echo = OF_THE_LINE[row] or "echo@0s:3s,echo@6s"  # an adapter that forgets to echo for three seconds
    faults = echo if not OF_THE_LINE[row] else f"echo,{OF_THE_LINE[row]}"
    bench = make_bus(tmp_path, "nowhere", family, faults)
    ran = run_bus(bench, LASTS_S)
    assert_recovered(bench, ran, NAMES, DRIVEN_AGAIN_S)
