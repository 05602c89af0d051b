"""A diagnosis as the search would leave it, made from the simulated plant: what the report is tested with.

The model before is a regression on the smoothed record's derivative, the model after the plant itself.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.signal import savgol_filter

from rw_ekf.arrays import BoolArray, Float64Array
from rw_ekf.control.profiles import make_profile, sample_profile
from rw_ekf.diagnosis.outcome import ModelTrace
from rw_ekf.diagnosis.result import Diagnosis
from rw_ekf.drivers.sim.plant_batch import PlantRun, simulate_run
from rw_ekf.drivers.sim.plant_effect_text import parse_effects
from rw_ekf.drivers.sim.plant_parameters import PlantNoise, PlantParameters
from rw_ekf.logs.wheel_log import WheelLog
from rw_ekf.model.state import FrictionParameters
from rw_ekf.units import RAD_S_PER_RPM
from rw_ekf.wheel.model_file import WheelModel

INERTIA_KG_M2 = 1.5e-3
BLOCK_S = 60.0
RATE_HZ = 10.0


def example(
    effects: Sequence[str] = ("viscous_temperature:slope_1_K=-0.03",),
    *,
    profile: str = "identification",
    seed: int = 1,
    name: str = "runs/2026-11-21T0512.csv",
    kind: str = "effect",
    statement: str | None = None,
    with_angle: bool = True,
    with_temperature: bool = True,
) -> Diagnosis:
    """One diagnosis; kind: the verdict's. Without effects nothing is added and there is no model after."""
    sampled = sample_profile(make_profile(profile, seed=seed), RATE_HZ)
    time_s, current_A = np.array(sampled[0]), np.array(sampled[1])
    plant = parse_effects(list(effects))
    run = simulate_run(plant, current_A, time_s, seed=seed)
    n = time_s.size
    log = WheelLog(
        name, time_s, run.measured_speed_rad_s, current_A, "current_command_A", np.zeros(n), np.zeros(n, np.int64)
    )
    heldout = (time_s // BLOCK_S).astype(int) % 2 == 1
    base = _regressed(run, ~heldout)
    before, after = _trace(run, base, heldout, seed), _trace(run, plant, heldout, seed)
    if kind != "effect":
        after, keep = before, None
    else:
        keep = after
    found = effects[0].split(":")[0] if effects else ""
    document = _document(log, kind, found)
    document["before"] = _metrics(before, run, heldout)
    document["after"] = _metrics(after, run, heldout)
    document["verdict"]["statement"] = (statement or _STATEMENTS[kind]).format(
        found=found, before=document["before"]["free_run_rms_rpm"], after=document["after"]["free_run_rms_rpm"]
    )
    document["model"] = "augmented-model.yaml" if kind == "effect" else None
    if kind == "insufficient_excitation":
        document["before"] = document["after"] = dict.fromkeys(document["before"])
    return Diagnosis(
        log=log,
        content=document,
        heldout=heldout if kind != "insufficient_excitation" else np.zeros(n, dtype=bool),
        before=None if kind == "insufficient_excitation" else before,
        after=keep,
        temperature_degC=run.temperature_degC if with_temperature else None,
        angle_rad=run.angle_rad if with_angle else None,
        angle_is_logged=False,
        model=_model() if kind == "effect" else None,
    )


def many_samples(diagnosis: Diagnosis, samples: int) -> Diagnosis:
    """The same diagnosis repeated until it has so many samples."""

    def again(values: Any) -> Any:
        return np.resize(values, samples)

    def trace(one: ModelTrace | None) -> ModelTrace | None:
        if one is None:
            return None
        return ModelTrace(
            again(one.one_step_error_rad_s),
            again(one.free_run_rad_s),
            again(one.residual_acceleration_rad_s2),
            again(one.normalised_innovation),
        )

    log = diagnosis.log
    longer = replace(
        log,
        time_s=np.arange(samples) / RATE_HZ,
        speed_rad_s=again(log.speed_rad_s),
        current_A=again(log.current_A),
        command_delay_s=np.zeros(samples),
        segment=np.zeros(samples, np.int64),
    )
    temperature, angle = diagnosis.temperature_degC, diagnosis.angle_rad
    return replace(
        diagnosis,
        log=longer,
        heldout=again(diagnosis.heldout),
        before=trace(diagnosis.before),
        after=trace(diagnosis.after),
        temperature_degC=None if temperature is None else again(temperature),
        angle_rad=None if angle is None else again(angle),
    )


def _smooth(speed: Float64Array) -> Float64Array:
    """Acceleration [rad/s^2] of a smoothed record."""
    slope: Float64Array = savgol_filter(speed, 11, 2, deriv=1, delta=1.0 / RATE_HZ)
    return slope


def _regressed(run: PlantRun, fit: BoolArray) -> PlantParameters:
    """k, b and c of the four-parameter model from the fit part, away from rest."""
    speed = run.measured_speed_rad_s
    changes = np.flatnonzero(np.diff(run.current_command_A) != 0.0)
    steady = np.ones(speed.size, dtype=bool)
    for shift in range(-6, 7):
        steady[np.clip(changes + shift, 0, speed.size - 1)] = False
    turning = fit & steady & (np.abs(speed) > 4.0)
    phi = np.column_stack((run.current_command_A, -speed, -np.sign(speed)))
    k, b, c = np.linalg.lstsq(phi[turning], _smooth(speed)[turning], rcond=None)[0]
    return PlantParameters(motor_gain=k, viscous=b, coulomb=c, static=c + 0.0174)


def _trace(run: PlantRun, p: PlantParameters, heldout: BoolArray, seed: int) -> ModelTrace:
    """The model's free run by blocks, and the residual: the plant's acceleration less the model's, plus noise."""
    time_s, measured = run.time_s, run.measured_speed_rad_s
    free = np.empty_like(measured)
    starts = np.flatnonzero(np.diff(heldout, prepend=~heldout[:1]))
    for first, last in zip(starts, [*starts[1:], time_s.size], strict=True):
        part = slice(first, last)
        free[part] = simulate_run(
            p, run.current_command_A[part], time_s[part], PlantNoise(0.0), initial_speed_rad_s=measured[first],
            initial_temperature_degC=run.temperature_degC[first],
        ).speed_rad_s  # fmt: skip
    noise = np.random.default_rng([seed, 7]).standard_normal((2, time_s.size))
    gap = _drag(run, run.parameters) - _drag(run, p)
    smoothed = savgol_filter(gap + 0.12 * noise[0], 9, 2)
    error = np.append(0.0, gap[:-1] / RATE_HZ) + RAD_S_PER_RPM * noise[1]
    return ModelTrace(error, free, smoothed, error / RAD_S_PER_RPM)


def _drag(run: PlantRun, p: PlantParameters) -> Float64Array:
    """Acceleration of the terms in which the examples differ, at the true speed."""
    warm = run.temperature_degC - 20.0
    speed = run.speed_rad_s
    ripple = p.ripple_1_rad_s2 * np.sin(p.ripple_1_order * run.angle_rad + p.ripple_1_phase_rad)
    dry = p.coulomb + p.bump_rad_s2 * np.exp(-(((np.abs(speed) - p.bump_speed_rad_s) / p.bump_width_rad_s) ** 2))
    return (
        p.motor_gain * run.current_A
        - p.viscous * (1.0 + p.viscous_temperature_1_K * warm) * speed
        - p.asymmetry_1_s * np.abs(speed)
        - p.quadratic_drag_1_rad * speed * np.abs(speed)
        - np.sign(speed) * dry
        - ripple
        + p.offset_rad_s2
    )


def _rms(values: Float64Array) -> float:
    return float(np.sqrt(np.nanmean(values**2)))


def _metrics(trace: ModelTrace, run: PlantRun, heldout: BoolArray) -> dict[str, float | None]:
    one = _rms(trace.one_step_error_rad_s[heldout]) / RAD_S_PER_RPM
    free = _rms((run.measured_speed_rad_s - trace.free_run_rad_s)[heldout]) / RAD_S_PER_RPM
    return {
        "one_step_rms_rpm": one,
        "horizon_1s_rms_rpm": one + 0.02 * (free - one),
        "horizon_20s_rms_rpm": one + 0.4 * (free - one),
        "free_run_rms_rpm": free,
        "nis_mean": _rms(trace.normalised_innovation[heldout]) ** 2,
        "torque_rms_mNm": 1.0e3 * INERTIA_KG_M2 * _rms(trace.residual_acceleration_rad_s2[heldout]),
    }


def _model() -> WheelModel:
    covariance = tuple(tuple(1.0e-6 if i == j else 0.0 for j in range(4)) for i in range(4))
    return WheelModel(FrictionParameters(15.205, 0.00322, 0.5863, 0.6037), covariance, 4.0 * RAD_S_PER_RPM)


_STATEMENTS = {
    "adequate": "The four-parameter model explains this log: nothing structured is left in the residual.",
    "effect": "Viscous friction falls 3.00 +- 0.05 % per K; add {found}: free-run error {before:.3g} -> {after:.3g} "
    "rpm on the held-out 300 s; nothing is left in the residual.",
    "unexplained": "A drag that depends on speed is left that no effect of the catalogue explains: look at the "
    "residual against speed.",
    "insufficient_excitation": "The speed is constant: nothing can be said of friction or motor gain; drive the wheel "
    "through `rw-ekf excite identification`.",
}


def _document(log: WheelLog, kind: str, found: str) -> dict[str, Any]:
    edges = np.arange(0.0, log.duration_s + BLOCK_S, BLOCK_S)
    spans = [[float(a), float(b)] for a, b in pairwise(edges)]
    named = [found] if kind == "effect" else []
    return {
        "schema": "rw_ekf.diagnosis/1",
        "log": log.name,
        "samples": len(log),
        "rate_hz": log.rate_hz,
        "split": {"kind": "blocks", "fit_s": spans[::2], "heldout_s": spans[1::2]},
        "verdict": {
            "kind": kind,
            "effects": named,
            "indistinguishable": [["transport_delay", "actuator_lag"]] if kind == "effect" else [],
            "statement": "",
        },
        "candidates": [] if kind == "insufficient_excitation" else _candidates(found if named else ""),
    }


def _candidates(found: str) -> list[dict[str, Any]]:
    def related(numbers: tuple[float, float, float]) -> tuple[float, float, float, str]:
        return (*numbers, f"explained by {found}") if found else (1.9, 0.4, 0.0, "not significant")

    rows: list[tuple[str, dict[str, Any], float | None, float | None, float | None, str]] = [
        ("coulomb_drift", {}, *related((812.4, 0.0, 31.2))),
        ("coulomb_temperature", {}, *related((651.0, 0.0, 22.9))),
        ("quadratic_drag", {}, *related((48.1, 2.3e-11, 3.1))),
        ("offset_torque", {}, 3.2, 0.31, -0.4, "not significant"),
        ("viscous_asymmetry", {}, 2.9, 0.36, 0.1, "not significant"),
        ("cubic_drag", {}, 6.6, 0.02, math.nan, "too small to matter in practice"),
        ("motor_saturation", {}, 1.1, 0.55, 0.0, "not significant"),
        ("current_deadzone", {}, 0.7, 0.6, 0.0, "not significant"),
        ("actuator_lag", {}, 0.4, 0.7, 0.0, "indistinguishable from transport_delay"),
        ("transport_delay", {}, 0.41, 0.7, 0.0, "indistinguishable from actuator_lag"),
        ("presliding_hysteresis", {}, 0.02, 0.9, 0.0, "not significant"),
        ("friction_lag", {}, -0.01, 1.0, 0.0, "not significant"),
        ("drag_spike", {}, 7.2, 0.2, None, "not significant"),
        ("stribeck_shape", {}, 0.9, 0.6, 0.0, "not significant"),
        ("external_torque", {}, 11.2, 0.18, 0.2, "not significant"),
        ("speed_quantisation", {}, None, None, None, "not significant"),
        ("motor_gain_temperature", {}, 3.3, 0.11, 0.2, "not significant"),
        ("torque_ripple", {}, None, None, None, "not testable: needs angle_rad, which is not logged"),
    ]
    named = {
        "viscous_temperature": ("slope_1_K", -0.0300, 0.0005, "1/K"),
        "viscous_asymmetry": ("difference_1_s", 2.0e-4, 3.0e-6, "1/s"),
    }
    if found:
        rows = [row for row in rows if row[0] != found]
        name, value, std, unit = named.get(found, ("amplitude", 0.0301, 0.0010, "rad/s^2"))
        rows.insert(0, (found, {name: {"value": value, "std": std, "unit": unit}}, 5321.7, 0.0, 89.4, "added"))
    keys = ("effect", "parameters", "statistic", "p_value", "heldout_gain_percent", "decision")
    return [dict(zip(keys, row, strict=True)) for row in rows]
