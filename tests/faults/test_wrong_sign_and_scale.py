"""Row 19: sign or scale wrong in the wire map: found by a small move before the profile, the map's line named."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rw_ekf.commissioning.map_copy import write_corrected_map
from rw_ekf.drivers.sim.plant_parameters import PlantParameters
from rw_ekf.learning.learned_file import read_learned
from rw_ekf.units import RAD_S_PER_RPM
from tests.faults.rig import FAMILY, LineWheel
from tests.faults.test_learned_and_model import stated
from tests.live.bench import FAMILIES
from tests.live.daemon import Ran
from tests.live.test_blind_wheel import wrong_map

MARKED: dict[str, Any] = {"profile": "steps", "amplitude_A": 0.45, "period_s": 60.0}  # currents that no move asks for


def profile_began(wheel: LineWheel) -> int:
    """How many currents were written before the profile's; the first of MARKED is more than 0.2 A."""
    large = [i for i, current in enumerate(wheel.written_A) if abs(current) > 0.2]
    return large[0] if large else len(wheel.written_A)


def known(wheel: LineWheel) -> bool:
    """Whether the learned file says that the sign is confirmed."""
    return read_learned(wheel.learned).wheel.sign_confirmed


@pytest.mark.parametrize("speed_rad_s", [0.0, 20.0, -200.0])
def test_a_healthy_wheel_is_confirmed_before_the_profile(tmp_path: Path, speed_rad_s: float) -> None:
    """Row 19: a few seconds, a tenth of an ampere, a few rpm; then the profile, and never again for this wheel."""
    wheel = LineWheel(tmp_path, speed_rad_s=speed_rad_s)
    ran = wheel.run(70.0, command=MARKED)
    assert len(stated(ran, "confirming_sign")) == 1
    (text,) = stated(ran, "sign_confirmed")
    assert "a positive current turns the wheel forward" in text
    began = profile_began(wheel)
    assert 30 < began < 80  # ten a second
    assert 0.05 < max(map(abs, wheel.written_A[:began])) < 0.15
    coasted = 0.1 * began * (0.6 + 0.0033 * abs(speed_rad_s))
    assert abs(wheel.speeds_rad_s[began] - speed_rad_s) < coasted + 20.0 * RAD_S_PER_RPM
    assert ran.outcome.start["sign_confirmed"] is True
    assert known(wheel)
    wheel.written_A.clear()
    again = wheel.run(10.0, command=MARKED)
    assert stated(again, "confirming_sign") == []
    assert profile_began(wheel) < 5


@pytest.mark.parametrize(
    ("field", "scale"), [("speed", -1.0), ("speed", -10.0), ("current_command", -1.0), ("current_command", -0.1)]
)
@pytest.mark.parametrize(
    ("family", "speed_rad_s"),
    [(FAMILIES[0], 0.0), (FAMILIES[0], 20.0), (FAMILIES[1], 0.0), (FAMILIES[2], 0.0), (FAMILIES[4], 0.0)],
    indirect=["family"],
)
@pytest.mark.usefixtures("family")
def test_a_wrong_sign_never_sees_the_profile(tmp_path: Path, field: str, speed_rad_s: float, scale: float) -> None:
    """Row 19: SAFE within the move, zero from then on, the sentence names both lines; nothing is learned from it."""
    wheel = LineWheel(tmp_path, speed_rad_s=speed_rad_s)
    protocol = wrong_map(tmp_path, field, scale, FAMILY.get())
    limits = {"current_A": 0.3, "speed_rpm": 1000.0, "silence_s": 0.5}
    ran = wheel.run(60.0, wheel={"protocol": protocol}, limits=limits)
    (text,) = stated(ran, "wrong_sign")
    named = str(tmp_path / "can-wheel.dbc") if FAMILY.get() == "can-wheel" else protocol
    assert text.count(named) == 2
    assert ran.outcome.state.state.value == "SAFE"
    assert set(wheel.written_A[125:]) == {0.0}  # ten a second: as long as a move lasts at most
    assert max(map(abs, wheel.speeds_rad_s)) < speed_rad_s + 300.0 * RAD_S_PER_RPM
    assert not list((tmp_path / "runs").glob("*.learned.yaml"))
    assert ran.outcome.start["sign_confirmed"] is False


@pytest.mark.parametrize("field", ["speed", "current_command"])
@pytest.mark.parametrize("scale", [10.0, 0.1])
def test_a_scale_ten_times_off_is_not_confirmed(tmp_path: Path, field: str, scale: float) -> None:
    """Row 19: named with the factor, the sign is not confirmed, the learning is not kept, and it is tried again."""
    wheel = LineWheel(tmp_path, speed_rad_s=20.0)
    protocol = wrong_map(tmp_path, field, scale)
    limits = {"current_A": 0.3, "speed_rpm": 1600.0, "silence_s": 0.5}
    ran = wheel.run(60.0, wheel={"protocol": protocol}, limits=limits, command={"period_s": 8.0, "amplitude_A": 0.25})
    (text,) = stated(ran, "odd_gain")
    assert protocol in text
    assert ran.outcome.start["sign_confirmed"] is False
    assert "learned_not_kept" in ran.notes.events
    assert not list((tmp_path / "runs").glob("*.learned.yaml"))
    again = wheel.run(5.0, wheel={"protocol": protocol}, limits=limits)
    assert len(stated(again, "confirming_sign")) == 1


def test_a_mended_map_is_another_map(tmp_path: Path) -> None:
    """Row 19: confirmed through one map, the sign is moved for again through another; learned through it likewise."""
    wheel = LineWheel(tmp_path)
    wheel.run(70.0)
    ran = wheel.run(20.0, wheel={"protocol": wrong_map(tmp_path, "pressure", 2.0)})
    assert "another wire map" in stated(ran, "learned_not_used")[0]
    assert len(stated(ran, "confirming_sign")) == 1


def test_stronger_friction_than_believed_takes_more_current(tmp_path: Path) -> None:
    """Row 19: three times the break-away: twice the current moves it, and it is confirmed."""
    wheel = LineWheel(tmp_path, PlantParameters(coulomb=1.8, static=2.0))
    ran = wheel.run(30.0, command={"profile": "sine", "amplitude_A": 0.3, "period_s": 10.0})
    assert len(stated(ran, "sign_confirmed")) == 1
    assert ran.outcome.start["sign_confirmed"] is True


def test_drag_is_no_wrong_sign(tmp_path: Path) -> None:
    """Row 19: a torque of half the Coulomb friction against the motion and strong windage: confirmed all the same."""
    plant = PlantParameters(offset_rad_s2=-0.3, quadratic_drag_1_rad=2e-5)
    for speed_rad_s in (0.0, 100.0, -100.0):
        wheel = LineWheel(tmp_path, plant, speed_rad_s=speed_rad_s)
        ran = wheel.run(20.0, fresh=True)
        assert len(stated(ran, "sign_confirmed")) == 1


@pytest.mark.parametrize("sense", [1.0, -1.0])
def test_near_the_speed_limit_the_move_only_brakes(tmp_path: Path, sense: float) -> None:
    """Row 19: 5 rpm below the limit the move begins by braking, is never above the limit, and confirms the sign."""
    limit_rpm = 2000.0
    wheel = LineWheel(tmp_path, speed_rad_s=sense * (limit_rpm - 5.0) * RAD_S_PER_RPM)
    ran = wheel.run(12.0, limits={"speed_rpm": limit_rpm, "silence_s": 0.5}, command=MARKED)
    began = profile_began(wheel)
    forward, speed = sense * np.array(wheel.written_A[:began]), sense * np.array(wheel.speeds_rad_s[:began])
    close = speed > (limit_rpm - 15.0) * RAD_S_PER_RPM
    assert close.sum() > 3
    assert max(forward[close]) <= 0.0
    assert min(forward[close]) < -0.05
    assert max(speed) < (limit_rpm + 5.0) * RAD_S_PER_RPM
    assert len(stated(ran, "sign_confirmed")) == 1


def test_a_limit_too_small_to_move_the_wheel(tmp_path: Path) -> None:
    """Row 19: 20 mA do not break it loose: said with the current that would, nothing above the limit, it goes on."""
    wheel = LineWheel(tmp_path)
    small = {"amplitude_A": 0.01, "bias_A": 0.0}
    ran = wheel.run(20.0, limits={"current_A": 0.02, "silence_s": 0.5}, command=small)
    (text,) = stated(ran, "sign_not_confirmed")
    assert "0.02 A did not move the wheel (limits.current_A" in text
    assert "0.0397 A would" in text
    assert max(map(abs, wheel.written_A)) <= 0.02
    assert ran.outcome.start["sign_confirmed"] is False
    assert ran.outcome.state.state.value == "TRACKING"


@pytest.mark.parametrize(
    "command", [{"profile": "none"}, {"profile": "zero"}, {"profile": "sine", "confirm_sign": False}]
)
def test_who_does_not_move_the_wheel_does_not_confirm_it(tmp_path: Path, command: dict[str, Any]) -> None:
    """Row 19: profiles none and zero make no move, and neither does who says so."""
    wheel = LineWheel(tmp_path, speed_rad_s=20.0)
    ran = wheel.run(5.0, command=command)
    assert stated(ran, "confirming_sign") == []
    if command["profile"] != "sine":
        assert set(wheel.written_A) <= {0.0}


def test_the_profile_s_own_time_begins_after_the_move(tmp_path: Path) -> None:
    """Row 19: S3 lasts 90 s; with the move before it the run is longer by just the move, and its phase is told."""
    wheel = LineWheel(tmp_path)
    ran = wheel.run(None, command={"profile": "S3"})
    log = ran.log
    assert 93.0 < log.time_s[-1] - log.time_s[0] < 100.0
    assert confirmed_and_whole(ran)


def confirmed_and_whole(ran: Ran) -> bool:
    """Whether the sign was confirmed and nothing is missing from the run."""
    return ran.outcome.start["sign_confirmed"] is True and not ran.outcome.unwritten


@pytest.mark.parametrize("access", ["write", "read"])
@pytest.mark.parametrize("family", [FAMILIES[2]], indirect=True)
@pytest.mark.usefixtures("family")
def test_a_sign_of_one_side_of_the_command_is_named_and_not_the_speed(tmp_path: Path, access: str) -> None:
    """Row 19, where telemetry must bear a command out: SAFE for what is known, within the first pulse.

    On a CAN bus nothing then counts as taken, so that no motion follows from it; that says nothing about the speed.
    """
    wheel = LineWheel(tmp_path)
    protocol = write_corrected_map(FAMILY.get(), {("current_command", access): -1.0}, tmp_path)
    ran = wheel.run(30.0, wheel={"protocol": protocol}, limits={"current_A": 0.3, "silence_s": 0.5})
    (text,) = stated(ran, "sign_not_confirmed")
    assert text.startswith("every current that is commanded is told by telemetry with the opposite sign")
    assert "speed" not in text
    assert ran.outcome.state.state.value == "SAFE"
    assert ran.outcome.state.reason in text
    assert 0.0 < max(map(abs, wheel.written_A)) < 0.15
    assert set(wheel.written_A[40:]) == {0.0}
