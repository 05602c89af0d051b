"""Something that is over at once: known by how much it moved the speed, and by nothing else."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

import rw_ekf
from rw_ekf.arrays import Float64Array
from rw_ekf.diagnosis.report.cause_curve import cause_curves
from rw_ekf.diagnosis.report.words import Units

PERIOD_S, FINER = 0.1, 50
RPM = math.pi / 30.0
Knocks = dict[int, float]  # [rad/s] at the begin of an interval


def wheel(current_A: Float64Array, knocks: Knocks) -> Float64Array:
    """Speeds (n,) of an independent wheel: Euler's method at 2 ms; it sticks at 0."""
    step, speed, found = PERIOD_S / FINER, 0.0, np.empty(current_A.size)
    for i, current in enumerate(current_A.tolist()):
        found[i] = speed
        speed += knocks.get(i, 0.0)
        for _ in range(FINER):
            drive = 15.2 * current
            if speed == 0.0:
                speed = step * (drive - math.copysign(0.62, drive)) if abs(drive) > 0.62 else 0.0
                continue
            friction = 0.0032 * abs(speed) + 0.58 + 0.04 * math.exp(-((speed / 0.42) ** 2))
            further = speed + step * (drive - math.copysign(friction, speed))
            speed = 0.0 if further * speed < 0.0 else further
    return found


def currents(seed: int) -> Float64Array:
    """Ten minutes of three sines, some reversals among them."""
    rng = np.random.default_rng(seed)
    turns = 2.0 * math.pi * PERIOD_S * np.arange(6000)[:, None] * np.array([1.0, 1.7, 2.9]) / 60.0
    return np.asarray(0.117 * np.sum(np.sin(turns + rng.uniform(0.0, 2.0 * math.pi, 3)), axis=1))


def diagnosed(current_A: Float64Array, speed_rad_s: Float64Array, seed: int) -> rw_ekf.Diagnosis:
    """Of a log with readings of 1 rpm of noise."""
    noise = RPM * np.random.default_rng(1000 + seed).standard_normal(speed_rad_s.size)
    time_s = PERIOD_S * np.arange(speed_rad_s.size)
    return rw_ekf.diagnose(rw_ekf.read({"time_s": time_s, "speed_rad_s": speed_rad_s + noise, "current_A": current_A}))


def jumps(reported: rw_ekf.Diagnosis) -> list[tuple[float, float, float, float]]:
    """Time [s] and by how much the speed changed [rpm] of each, with their standard deviations."""
    assert reported.model is not None
    found = []
    for term in reported.model.effects.terms:
        assert term.id == "spell"
        assert term.law is not None
        assert term.law.acts_as == "torque"
        lasts_s = term.law.last - term.law.first
        assert lasts_s == pytest.approx(PERIOD_S)
        size, std = -term.values[0] * lasts_s / RPM, term.stds[0] * lasts_s / RPM
        found.append((0.5 * (term.law.first + term.law.last), term.law.spread[0], size, std))
    return sorted(found)


@pytest.mark.parametrize(("seed", "knock_rpm"), [(0, -1.5), (1, 8.0)])
def test_a_knock_is_told_with_its_time_and_what_it_did_to_the_speed(seed: int, knock_rpm: float) -> None:
    """It was a drag that jumps up by 15 +- 7 % and decays in 2 s, or viscous friction that is another for a second."""
    current_A = currents(seed)
    reported = diagnosed(current_A, wheel(current_A, {3100: knock_rpm * RPM}), seed)
    assert reported.document()["verdict"]["effects"] == ["spell"]
    assert f"the speed {'rises' if knock_rpm > 0.0 else 'falls'} by" in reported.document()["verdict"]["statement"]
    assert "may also be" not in reported.document()["verdict"]["statement"]
    ((at_s, at_std_s, by_rpm, by_std_rpm),) = jumps(reported)
    assert abs(at_s - 310.05) < max(4.0 * at_std_s, PERIOD_S)
    assert abs(by_rpm - knock_rpm) < 3.5 * by_std_rpm < 0.3 * abs(knock_rpm) + 1.0


@pytest.mark.slow
def test_commands_that_were_not_taken_are_each_found() -> None:
    """Six times the wheel got none for a tenth of a second, which is no law of its motion: it was unexplained."""
    seed = 0
    rng = np.random.default_rng(50 + seed)
    current_A = currents(seed)
    taken = current_A.copy()
    at = [i for i in sorted(rng.permutation(np.arange(300, 5900, 400)).tolist()) if abs(current_A[i]) > 0.15][:6]
    taken[at] = 0.0
    reported = diagnosed(current_A, wheel(taken, {}), seed)
    assert reported.document()["verdict"]["effects"] == ["spell"]
    found = jumps(reported)
    assert len(found) == len(at)
    for i, (at_s, _, by_rpm, by_std_rpm) in zip(at, found, strict=True):
        assert PERIOD_S * i - 0.3 < at_s < PERIOD_S * i + 0.4
        missed_rpm = -15.2 * PERIOD_S * float(current_A[i]) / RPM
        assert abs(by_rpm - missed_rpm) < 4.0 * by_std_rpm + 0.03 * abs(missed_rpm)


def test_what_takes_its_time_is_no_knock() -> None:
    """A torque that pulls for eight seconds keeps both its times."""
    seed = 0
    current_A = currents(seed)
    pulled = current_A.copy()
    pulled[3000:3080] -= 0.15 * 0.58 / 15.2
    reported = diagnosed(current_A, wheel(pulled, {}), seed)
    assert reported.document()["verdict"]["effects"] == ["spell"]
    assert "at once" not in reported.document()["verdict"]["statement"]
    parameters = next(item for item in reported.document()["candidates"] if item["effect"] == "spell")["parameters"]
    begins, ends = parameters["begins_at"], parameters["ends_at"]
    assert abs(begins["value"] - 300.0) < 4.0 * begins["std"] + 0.5
    assert abs(ends["value"] - 308.0) < 4.0 * ends["std"] + 0.5


@pytest.mark.slow
def test_knocks_of_one_record_are_none_of_the_next(tmp_path: Path) -> None:
    """The model holds them; the wheel's next record, which has none, is adequate by it, and they are left out."""
    current_A = currents(0)
    taken = current_A.copy()
    taken[[300, 1100, 1500, 4300, 4700, 5500]] = 0.0
    found = diagnosed(current_A, wheel(taken, {}), 0)
    model = found.model
    assert model is not None
    (curve,) = cause_curves(found, Units(wheel=True, inertia_kg_m2=0.0015))  # one picture of all, each with its sigma
    assert curve.x.size == 6
    assert np.all(np.abs(curve.y) > curve.error)
    model.save(tmp_path / "wheel.model.yaml")
    read = rw_ekf.Model.load(tmp_path / "wheel.model.yaml")
    assert [term.id for term in read.effects.terms] == 6 * ["spell"]
    further = currents(7)
    noise = RPM * np.random.default_rng(3).standard_normal(further.size)
    time_s = PERIOD_S * np.arange(further.size)
    log = rw_ekf.read({"time_s": time_s, "speed_rad_s": wheel(further, {}) + noise, "current_A": further})
    again = rw_ekf.diagnose(log, read)
    assert again.document()["verdict"]["kind"] == "adequate"
    assert any("belonged to the record" in warning for warning in again.document()["warnings"])
