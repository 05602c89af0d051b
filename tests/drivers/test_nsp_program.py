"""NSP: what a program that runs, and a boot loader, are taken for: started when it must be, and never without need."""

from __future__ import annotations

import random
from pathlib import Path

import pytest

from rw_ekf.drivers.line.framing import Frame
from rw_ekf.drivers.line.nsp import FIRST_READ, INIT_ID, PING_ID
from rw_ekf.drivers.line.wire_layout import Register
from tests.drivers.test_nsp import Rig
from tests.injecting import put_faults
from tests.live.bench import ROOT

SPEED = FIRST_READ + 5


def deny(rig: Rig, *silent: int, refused: tuple[int, ...] = ()) -> None:
    """Have the wheel not answer these ids, and refuse to read those."""
    original = rig.server._answer

    def answer(frame: Frame, register: Register | None) -> bytes | None:
        if frame.id in silent:
            return None
        return b"" if frame.id in refused else original(frame, register)

    rig.server._answer = answer  # type: ignore[method-assign]


def test_a_bad_line_does_not_have_a_program_started_again() -> None:
    """Three replies of ten lost for a minute and a half: INIT, which would end what runs, is not sent once."""
    rig = Rig()
    wheel = rig.open()
    put_faults(rig.server, "drop/from:0.3")
    segments = set()
    for _ in range(600):
        sample = wheel.read(0.09)
        rig.clock.sleep(0.05)
        segments |= set() if sample is None else {sample.segment}
    assert rig.wanted.count(INIT_ID) == 1
    assert segments == {0}


def test_files_that_the_wheel_does_not_have_do_not_have_it_started() -> None:
    """Two of the map refused, one behind the other, in every turn: they are missing values and no boot loader."""
    rig = Rig()
    deny(rig, refused=(FIRST_READ + 1, FIRST_READ + 3))
    wheel = rig.open()
    for _ in range(50):
        sample = wheel.read(0.09)
        rig.clock.sleep(0.09)
        assert sample is not None
        assert (sample.temperature_degC, sample.bus_voltage_V, sample.segment) == (None, None, 0)
    assert rig.wanted.count(INIT_ID) == 1


def test_zeros_that_a_boot_loader_refuses_do_not_keep_it_there() -> None:
    """At one reading in half a second a zero is written between any two: the second refused reading starts it."""
    rig = Rig()
    wheel = rig.open()
    assert wheel.read(1.0) is not None
    rig.server.restart()
    for _ in range(3):
        assert wheel.read(0.09) is None or rig.server.started
        wheel.stop_current()
        rig.clock.sleep(0.5)
    assert rig.server.started
    assert wheel.stop_current().acknowledged


def test_a_mute_boot_loader_is_started() -> None:
    """One that answers PING and INIT and nothing else: found while opening, and after a reset."""
    rig = Rig()
    original = rig.server._answer

    def mute(frame: Frame, register: Register | None) -> bytes | None:
        return original(frame, register) if rig.server.started or frame.id in (PING_ID, INIT_ID) else None

    rig.server._answer = mute  # type: ignore[method-assign]
    wheel = rig.open()
    assert wheel.read(1.0) is not None
    rig.server.restart()
    samples = [wheel.read(0.09) for _ in range(25)]
    assert samples[0] is None
    assert samples[-1] is not None
    assert samples[-1].segment == 1


@pytest.mark.parametrize("turns", range(46, 56))
def test_a_reset_at_any_time_leaves_the_wheel_who_it_is(turns: int) -> None:
    """Who answers is asked every five seconds: a boot loader that answers just then is not taken for another wheel."""
    rig = Rig()
    wheel = rig.open()
    wheel.read(0.09)
    known = wheel.identity
    for _ in range(turns):
        wheel.read(0.09)
        rig.clock.sleep(0.09)
    rig.server.restart()
    for _ in range(12):
        wheel.read(0.09)
        assert wheel.identity in (None, known)
        rig.clock.sleep(0.09)
    assert wheel.identity == known


@pytest.mark.parametrize("delay_ms", [60, 115, 150, 215, 230, 260, 315, 330])
def test_a_line_that_keeps_every_reply_brings_no_old_reading(delay_ms: int) -> None:
    """Late by up to three requests, one after the other: B alone would repeat; none is taken for a new one."""
    rig = Rig()
    wheel = rig.open()
    assert wheel.read(1.0) is not None
    put_faults(rig.server, f"delay/from:{delay_ms}ms")
    for _ in range(60):
        turn_s = rig.clock.monotonic()
        rig.server.plant.state = rig.server.plant.state._replace(speed_rad_s=100.0 + 10.0 * turn_s)
        sample = wheel.read(0.09)
        assert sample is None or sample.speed_rad_s == pytest.approx(100.0 + 10.0 * turn_s, abs=0.5)
        rig.clock.sleep(max(0.0, turn_s + 0.1 - rig.clock.monotonic()))
    put_faults(rig.server, "")
    assert any(wheel.read(0.09) is not None for _ in range(3))


@pytest.mark.parametrize("unit", ["A", "mA"])
def test_a_float_carries_a_command_as_it_was_asked_for(tmp_path: Path, unit: str) -> None:
    """To a millionth of itself, in A and in mA, from a milliampere to 60 A."""
    rig = Rig(edited(tmp_path, "type: f32, unit: A}]}\n  - {id: 0x85", f"type: f32, unit: {unit}}}]}}\n  - {{id: 0x85"))
    wheel = rig.open()
    numbers = random.Random(1)
    for _ in range(100):
        wanted_A = 10.0 ** numbers.uniform(-3.0, 1.778)
        assert wheel.command_current(wanted_A).current_A == pytest.approx(wanted_A, rel=1e-6)
        assert rig.server.command_A == pytest.approx(wanted_A, rel=1e-6)


def edited(directory: Path, old: str, new: str) -> str:
    """The path of a map in which that stands instead."""
    text = (ROOT / "config" / "nsp-wheel.yaml").read_text(encoding="utf-8")
    assert text.count(old) == 1
    path = directory / "map.yaml"
    path.write_text(text.replace(old, new), encoding="utf-8")
    return str(path)
