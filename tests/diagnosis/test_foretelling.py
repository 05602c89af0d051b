"""An independent machine that leaves no noise whatever is added: what is told of it, and how far that carries."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from rw_ekf.arrays import Float64Array
from rw_ekf.course.course import Course
from rw_ekf.course.free_run import free_run
from rw_ekf.diagnosis.investigate import foretelling
from rw_ekf.diagnosis.investigate.foretelling import NOTE, NOTE_SLOWER, as_it_foretells
from rw_ekf.diagnosis.investigate.law_rows import with_laws
from rw_ekf.diagnosis.investigate.rounding import investigated
from rw_ekf.diagnosis.log_diagnosis import diagnose_log
from rw_ekf.diagnosis.prepare.preparation import prepare
from rw_ekf.diagnosis.prepare.source import source_of
from rw_ekf.diagnosis.verdict.conclude import conclude
from rw_ekf.likelihood.one_step import state_vector
from rw_ekf.logs.wheel_log import WheelLog
from rw_ekf.model.friction import LAW_NAMES, Stribeck
from rw_ekf.model.state import PARAMETER_NAMES, SPEED, FrictionParameters
from rw_ekf.units import rpm_from_rad_s
from rw_ekf.wheel.effect_table import EffectSet
from rw_ekf.wheel.model_file import WheelModel
from tests.diagnosis.simulated import log_of, simulated

RATE_HZ, NOISE_RAD_S, STEPS = 100.0, 0.05, 40
GAIN, SATURATION, VISCOUS, COULOMB = 60.0, 0.15, 0.4, 10.0
COUPLING_HZ, LOAD_SHARE, DAMPING = 11.0, 0.35, 0.06


def quiet(text: str) -> None:
    """Nobody watches."""


def machine(seed: int, seconds: float) -> WheelLog:
    """A motor that turns its load through a coupling that swings at 11 Hz, with a drag that no catalogue has."""
    random, n = np.random.default_rng(seed), round(seconds * RATE_HZ)
    drive = np.repeat(random.uniform(-1.0, 1.0, n), random.integers(50, 300, n))[:n]
    swing = (2.0 * math.pi * COUPLING_HZ) ** 2 * LOAD_SHARE * (1.0 - LOAD_SHARE)
    damping = 2.0 * DAMPING * 2.0 * math.pi * COUPLING_HZ * LOAD_SHARE * (1.0 - LOAD_SHARE)
    motor, load, twist, step_s = 0.0, 0.0, 0.0, 1.0 / RATE_HZ / STEPS
    speed = np.empty(n)
    for i, effort in enumerate(drive.tolist()):
        speed[i] = motor
        for _ in range(STEPS):
            carried = swing * twist + damping * (motor - load)
            push = GAIN * effort * (1.0 - SATURATION * abs(effort)) - VISCOUS * motor - carried
            dry = COULOMB * (1.0 + 0.5 * math.sin(abs(motor) / 18.0))
            way = math.copysign(1.0, motor if motor != 0.0 else push)
            push = 0.0 if motor == 0.0 and abs(push) <= dry else push - dry * way
            after = motor + step_s * push / (1.0 - LOAD_SHARE)
            load += step_s * carried / LOAD_SHARE
            twist += step_s * (motor - load)
            motor = 0.0 if motor * after < 0.0 else after
    reading = speed + NOISE_RAD_S * random.standard_normal(n)
    time_s = np.arange(n, dtype=np.float64) / RATE_HZ
    nothing = np.zeros(n)
    return WheelLog(
        "machine.csv", time_s, reading, drive, "current_A", nothing, nothing.astype(np.int64), {"current_A": drive},
        rows_read=n,
    )  # fmt: skip


def missed_rpm(model: WheelModel, log: WheelLog) -> float:
    """Root mean square by which a model, run free over stretches of ten seconds, misses a log it never saw.

    Without what needs an angle: none is logged, and the phase of another log's is anybody's guess.
    """
    kept = tuple(term for term in model.effects.terms if not term.effect.angular)
    model = replace(model, effects=EffectSet(kept))
    course, first = Course.of_log(log), np.arange(0, len(log) - 1000, 1000)
    coefficients = np.array([*model.parameters, *model.effects.values])
    states = np.tile(state_vector(coefficients, model.effects), (first.size, 1))
    states[:, SPEED] = log.speed_rad_s[first]
    stribeck = Stribeck(model.stribeck_speed_rad_s, {name: law for law, name in LAW_NAMES.items()}[model.stribeck_law])
    run = free_run(course, model.effects, stribeck, states, first, first + 999, keep_path=True).path_rad_s
    error: Float64Array = (run - log.speed_rad_s)[np.isfinite(run)]
    return rpm_from_rad_s(float(np.sqrt(np.mean(error**2))))


@pytest.mark.slow
def test_a_machine_that_leaves_no_noise_gets_a_model_that_foretells_another_log() -> None:
    """Swinging coupling, drag of its own: laws with numbers by simulation, right on a log with another drive."""
    diagnosis = diagnose_log(machine(1, 100.0))
    document = diagnosis.document()
    assert document["verdict"]["kind"] == "effect", document["verdict"]["statement"]
    assert "learned_law" in document["verdict"]["effects"]
    assert {NOTE, NOTE_SLOWER} & set(document["warnings"])
    assert document["after"]["free_run_rms_rpm"] < 0.25 * document["before"]["free_run_rms_rpm"]
    assert diagnosis.model is not None
    before = FrictionParameters(*(document["parameters"]["before"][name]["value"] for name in PARAMETER_NAMES))
    plain = replace(diagnosis.model, parameters=before, effects=EffectSet())
    other = machine(2, 60.0)
    assert missed_rpm(diagnosis.model, other) < 0.35 * missed_rpm(plain, other)


def test_a_wheel_that_leaves_noise_keeps_its_likeliest_numbers() -> None:
    """Nothing is asked where nothing is wrong: the very same finding comes back."""
    prepared = prepare(
        source_of([log_of(simulated(["offset_torque:torque_rad_s2=0.03"], seed=3))]), None, None, "blocks"
    )
    found = with_laws(investigated(prepared, quiet), quiet)
    assert found.new_ids == ["offset_torque"]
    assert as_it_foretells(found, quiet) is found


@pytest.mark.parametrize(("share", "stands"), [(1.0, True), (1.0e-6, False)])
def test_numbers_by_which_a_named_effect_is_nothing_are_none(
    share: float, stands: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whatever they foretell: "currents below 0.00 mA make no torque" stood beside a verdict that named it."""
    run = simulated(["offset_torque:torque_rad_s2=0.03"], seed=3)
    found = investigated(prepare(source_of([log_of(run)]), None, None, "blocks"), quiet)
    assert found.new_ids == ["offset_torque"]
    monkeypatch.setattr(foretelling, "_gained", lambda *fits: 1.0)
    monkeypatch.setattr(foretelling, "_no_worse_ahead", lambda *fits: True)
    vector = found.fit.model.vector
    vector[-1] *= share
    way = replace(found.fit, model=found.fit.model.with_vector(vector))
    assert (foretelling._foretelling(found, found.fit, way) is not None) is stands


@pytest.mark.slow
def test_what_was_refused_and_foretells_more_is_described_and_named_as_no_cause() -> None:
    """Its model is kept, for it misses by a quarter less; the verdict is that nothing explains the record."""
    prepared = prepare(source_of([machine(1, 20.0)]), None, None, "blocks")
    found = as_it_foretells(with_laws(investigated(prepared, quiet), quiet), quiet)
    assert found.new_ids
    reported = conclude(replace(found, described=True), quiet)
    document = reported.document()
    assert document["verdict"]["kind"] == "unexplained"
    assert document["verdict"]["effects"] == []
    assert "as a description, and as no cause" in document["verdict"]["statement"]
    assert reported.model is not None
    assert document["after"]["free_run_rms_rpm"] < 0.8 * document["before"]["free_run_rms_rpm"]
