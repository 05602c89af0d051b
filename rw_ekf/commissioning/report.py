"""The page about a commissioned wheel: who it is, what was measured, its friction, what to do next; in one file."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from rw_ekf.arrays import Float64Array, by_identity
from rw_ekf.commissioning.progress import Progress
from rw_ekf.commissioning.setting import CONFIGURATION_FILE
from rw_ekf.diagnosis.report.canvas import AFTER, BEFORE, INK, legend, new_figure, plain, png
from rw_ekf.diagnosis.report.template_engine import rendered
from rw_ekf.drawing import picture
from rw_ekf.errors import PictureError
from rw_ekf.filter.estimator import Estimator
from rw_ekf.logs.atomic import write_text
from rw_ekf.logs.wheel_log import WheelLog
from rw_ekf.numbers import plus_minus
from rw_ekf.records import WheelSample
from rw_ekf.starting_point import setup_of_model
from rw_ekf.units import rpm_from_rad_s
from rw_ekf.wheel.model_file import WheelModel

PAGE, PICTURE = "report.html", "friction.png"
_TEMPLATES = Path(__file__).parent / "templates"
_WINDOW_S = 1.0
_BINS, _LEAST_IN_BIN, _POINTS = 40, 4, 200
_SLOWEST_RAD_S = 1.0e-3
_USUAL_NOISE_RAD_S, _USUAL_TORQUE_NOISE, _PERIOD_S = 0.1, 0.003, 0.1


@by_identity
class FrictionCurve(NamedTuple):
    """Friction against speed: the model's with its band (k,), and what windows of the log show (m,)."""

    speed_rad_s: Float64Array
    friction_rad_s2: Float64Array
    two_sigma: Float64Array
    seen_rad_s: Float64Array
    seen_rad_s2: Float64Array
    seen_error: Float64Array


def friction_curve(log: WheelLog, model: WheelModel) -> FrictionCurve:
    """The model's friction, effects included, where the log moved; beside it gain times current less acceleration."""
    setup = setup_of_model(model, _USUAL_NOISE_RAD_S, _USUAL_TORQUE_NOISE, _PERIOD_S)
    prior = setup.prior
    first = Estimator(setup.constants, prior.mean, prior.covariance, setup.effects, setup.effect_drift).step(
        WheelSample(0.0, 0.0)
    )
    fastest = float(np.nanmax(np.abs(log.speed_rad_s)))
    forward = np.append(
        _SLOWEST_RAD_S, np.geomspace(10.0 * _SLOWEST_RAD_S, fastest, _POINTS)
    )  # dense where it is steep
    speeds = np.concatenate((-forward[::-1], forward))
    believed = [first.friction_torque_rad_s2(float(speed)) for speed in speeds]
    at, seen, error = _seen(log, model.parameters.motor_gain, fastest)
    return FrictionCurve(
        speeds, np.array([b.value for b in believed]), 2.0 * np.array([b.std for b in believed]), at, seen, error
    )


def _seen(log: WheelLog, gain: float, fastest: float) -> tuple[Float64Array, Float64Array, Float64Array]:
    """Speed, friction and two standard errors by bins of speed, from seconds in which the direction stays."""
    step = max(round(_WINDOW_S / max(float(np.median(np.diff(log.time_s))), 1.0e-6)), 1)
    first = np.arange(0, len(log) - step, step)
    last = first + step
    lasts = log.time_s[last] - log.time_s[first]
    charge = np.concatenate(([0.0], np.cumsum(log.current_A[:-1] * np.diff(log.time_s))))
    late = log.command_delay_s * np.append(0.0, np.diff(log.current_A))  # until then the current before it holds
    charge = charge - np.concatenate(([0.0], np.cumsum(late)[:-1]))
    ends = log.speed_rad_s[first], log.speed_rad_s[last]
    with np.errstate(divide="ignore", invalid="ignore"):
        friction = gain * (charge[last] - charge[first]) / lasts - (ends[1] - ends[0]) / lasts
    speed = 0.5 * (ends[0] + ends[1])
    good = np.isfinite(friction) & (ends[0] * ends[1] > 0.0) & (log.segment[first] == log.segment[last])
    edges = np.linspace(-fastest, fastest, _BINS + 1)
    rows = []
    for low, high in itertools.pairwise(edges):
        inside = good & (speed >= low) & (speed < high)
        if np.count_nonzero(inside) >= _LEAST_IN_BIN:
            values = friction[inside]
            rows.append((speed[inside].mean(), values.mean(), 2.0 * values.std(ddof=1) / np.sqrt(values.size)))
    table = np.array(rows).reshape(-1, 3)
    return table[:, 0], table[:, 1], table[:, 2]


@picture
def friction_picture(curve: FrictionCurve, gain: float, unit: str) -> bytes:
    """The curve as a PNG: friction as the current that balances it."""
    figure = new_figure(3.6, 8.0)
    axis = figure.subplots()
    plain(axis)
    milli = 1.0e3 / gain
    at, value, band = rpm_from_rad_s(1.0) * curve.speed_rad_s, milli * curve.friction_rad_s2, milli * curve.two_sigma
    fill = axis.fill_between(at, value - band, value + band, color=AFTER, alpha=0.25, lw=0.0)
    (line,) = axis.plot(at, value, color=AFTER, lw=2.0)
    points = axis.errorbar(
        rpm_from_rad_s(1.0) * curve.seen_rad_s, milli * curve.seen_rad_s2, milli * curve.seen_error,
        fmt="o", color=BEFORE, ms=3.2, elinewidth=1.0,
    )  # fmt: skip
    axis.axhline(0.0, color=INK, lw=0.6)
    axis.set_xlabel("speed [rpm]", fontsize=9)
    axis.set_ylabel(f"friction, as current that balances it [m{unit}]", fontsize=9)
    legend(figure, [(line, "model"), (fill, "± 2 sigma"), (points, "measured: mean ± 2 standard errors")])
    return png(figure)


def write_page(progress: Progress, log: WheelLog, model: WheelModel, made: Mapping[str, Any]) -> None:
    """Write report.html. Raises BadInputError where it cannot be written, PictureError behind that."""
    failed: PictureError | None = None
    pictures = {}
    unit = progress["limits"]["unit"]
    try:
        curve = friction_curve(log, model)
        pictures[PICTURE] = friction_picture(curve, model.parameters.motor_gain, unit)
    except PictureError as error:
        failed = error
    verdict = made["verdict"]
    values = {
        "kind": verdict["kind"],
        "verdict": verdict["name"],
        "statement": verdict["statement"],
        "identity": _identity(progress),
        "measured": _measured(progress),
        "parameters": [
            (name, plus_minus(item["value"], item["std"]), item["unit"], item["identifiable"])
            for name, item in made["parameters"].items()
        ],
        "pictures": pictures,
        "checked": progress["sign"]["checked"],
        "minutes": f"{progress.document()['wheel_s'] / 60.0:.1f}",
        "warnings": made["warnings"],
        "steps": _steps(progress, made),
    }
    write_text(progress.directory / PAGE, rendered("commission.html", values, _TEMPLATES))
    if failed is not None:
        raise failed


def _identity(progress: Progress) -> str:
    found = progress["find"]
    who = found["identity"] or {}
    named = [f"{name.replace('_', ' ')} {value}" for name, value in who.items() if value is not None]
    baud = [] if found["baud"] is None else [f"{found['baud']} baud"]
    return " · ".join([*(named or ["no serial number"]), found["port"], found["protocol"], *baud])


def _measured(progress: Progress) -> list[tuple[str, str, str]]:
    """Name, value, and what it stands on."""
    still, sign, delay, limits = (progress[step] for step in ("still", "sign", "delay", "limits"))
    unit, ratio = limits["unit"], sign["speed_ratio"]
    lattice = still["lattice_rad_s"]
    forward, backward = sign["breakaway_A"]
    heat = "" if limits["temperature_degC"] is None else f", {limits['temperature_degC']:.3g} degC"
    return [
        ("limits", f"{limits['current_A']:.4g} {unit}, {limits['speed_rpm']:.4g} rpm{heat}", f"by {limits['by']}"),
        ("sign and scales", sign["map_text"], "the first move"),
        ("speed scale", sign["speed_ratio_text"], f"by {sign['speed_ratio_by']}; the line alone cannot tell it"),
        ("gain", f"{plus_minus(sign['motor_gain'], sign['motor_gain_std'])} rad/s^2/{unit}", "pulses"),
        ("break-away", f"{forward:.3g} {unit} forward, {backward:.3g} backward", "slow ramps from rest"),
        ("noise of a reading", f"{rpm_from_rad_s(ratio * still['noise_rad_s']):.3g} rpm", "20 s at rest"),
        ("step of a reading", "none seen" if lattice is None else f"{rpm_from_rad_s(ratio * lattice):.3g} rpm",
         "at rest"),
        ("a reading is new every", f"{delay['new_every_ms']:.3g} ms" if delay["new_every_ms"] else "not told",
         f"asked at {delay['rate_hz']:.3g} Hz in motion"),
        ("a sample takes", f"{still['read_ms']:.3g} ms, at most {still['read_ms_max']:.3g} ms", "60 of them at rest"),
        ("command delay beyond the line", "not seen" if delay["beyond_line_ms"] is None else
         f"{plus_minus(delay['beyond_line_ms'], delay['beyond_line_std_ms'])} ms", "pulses in motion"),
        ("clock", f"{still['clock_ppm']:+.3g} ppm, jitter {still['clock_jitter_ms']:.2g} ms", "against the computer's"),
    ]  # fmt: skip


def _steps(progress: Progress, made: Mapping[str, Any]) -> list[str]:
    path = progress.directory / CONFIGURATION_FILE
    steps = [
        f"`rw-ekf check-config {path}`, then `rw-ekf run --config {path}`: it holds zero until `command` says more."
    ]
    if made["verdict"]["kind"] == "unexplained":
        steps.append(
            "The model lacks something: the diagnosis' own report says where it sits, and what record would show it."
        )
    if any(factor["field"] == "speed" and factor["factor"] < 0.0 for factor in progress["sign"]["factors"]):
        steps.append(
            "Forward is now where a positive current turns the wheel. If your attitude control means it the other way "
            "round, turn the signs of speed and of the currents in the wire map together."
        )
    steps.append(
        "Torques need the rotor's inertia: give `wheel.inertia_kg_m2` if you know it, else 1.5e-3 kg m^2 is taken."
    )
    return [*steps, "`diagnosis/report.html` beside this page has the residual, and what else was thought of."]
