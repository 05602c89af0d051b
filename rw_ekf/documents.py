"""The JSON documents (docs/contract.md#documents), and their text for people. NaN and infinity are written as null."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from rw_ekf.filter.identifiability import report
from rw_ekf.identify.record_scale import DEFAULT_STRIBECK_SPEED_RAD_S
from rw_ekf.model.bounds import ASSUMED
from rw_ekf.model.state import PARAMETER_NAMES, STATE_NAMES, STATE_SIZE
from rw_ekf.numbers import plus_minus
from rw_ekf.statistics import RunStatistics
from rw_ekf.units import rpm_from_rad_s

if TYPE_CHECKING:
    from rw_ekf.filter.belief import Belief
    from rw_ekf.starting_point import FilterSetup
    from rw_ekf.wheel.effect_table import EffectSet

REPLAY_SCHEMA = "rw_ekf.replay/1"
FIT_SCHEMA = "rw_ekf.fit/1"
_PHYSICAL_NAMES = ("motor_constant_Nm_A", "viscous_Nms", "coulomb_Nm", "static_Nm")


def physical(values: Sequence[float], inertia_kg_m2: float | None) -> dict[str, float | None]:
    """Turn the four parameters per unit inertia into N m; null where the inertia is not known."""
    return {
        name: None if inertia_kg_m2 is None else value * inertia_kg_m2
        for name, value in zip(_PHYSICAL_NAMES, values, strict=True)
    }


def log_entry(
    log: str,
    statistics: RunStatistics,
    belief: Belief,
    setup: FilterSetup,
    warnings: Sequence[str],
    as_it_went: Belief | None = None,
) -> dict[str, Any]:
    """Return one element of `logs` of a replay document (docs/contract.md#replay).

    as_it_went: what the rows end with, where `belief` is in hindsight.
    """
    core = belief.core
    return {
        "log": log,
        "samples": statistics.samples,
        "duration_s": statistics.duration_s,
        "missing": statistics.missing,
        "rejected": statistics.rejected,
        "state": dict(zip(STATE_NAMES, (float(v) for v in core.mean), strict=True)),
        "std": dict(zip(STATE_NAMES, (float(v) for v in core.std), strict=True)),
        "covariance": [[float(v) for v in row] for row in core.covariance],
        "as_it_went": None if as_it_went is None else _parameters_document(as_it_went),
        "identifiable": {item.name: item.identifiable for item in report(core, setup.prior.core, statistics.points)},
        "effects": effects_document(setup.effects, belief),
        "physical": physical(belief.parameters, setup.inertia_kg_m2),
        **inertia_document(setup),
        "innovation": statistics.innovation_document(),
        "warnings": list(warnings),
    }


def _parameters_document(belief: Belief) -> dict[str, dict[str, float]]:
    values, stds = belief.parameters, belief.core.parameter_std
    return {name: {"value": v, "std": std} for name, v, std in zip(PARAMETER_NAMES, values, stds, strict=True)}


def as_it_went_text(entry: Mapping[str, Any]) -> str:
    """A line on what the rows and the picture end with, where the numbers above it are of the whole log."""
    reported = [f"{name} {plus_minus(item['value'], item['std'])}" for name, item in entry["as_it_went"].items()]
    ends = ", ".join(reported)
    return f"  these are in hindsight, of the whole log; its rows are the filter's as it went, and end with {ends}"


def effects_document(effects: EffectSet, belief: Belief) -> dict[str, Any]:
    """The effects' coefficients: {id: {"value", "std", "unit"}}; of a periodic one the largest amplitude."""
    known = STATE_SIZE + effects.size
    now = effects.with_values(belief.mean[STATE_SIZE:known], belief.std[STATE_SIZE:known])
    found: dict[str, Any] = {}
    for term in now.terms:
        value, std = term.effect.amplitude(term.values, np.diag(np.square(term.stds)))
        if term.id not in found or abs(value) > abs(found[term.id]["value"]):
            found[term.id] = {"value": value, "std": std, "unit": term.effect.coefficient.unit}
    return found


def effects_text(effects: Mapping[str, Any]) -> list[str]:
    """A line for each effect of an `effects_document`."""
    return [f"  {name}: {plus_minus(item['value'], item['std'])} {item['unit']}" for name, item in effects.items()]


def inertia_document(setup: FilterSetup) -> dict[str, Any]:
    """What turned accelerations into torques, and who gave it: configuration, model, or nobody (`assumed`)."""
    known = setup.inertia_kg_m2 is not None
    return {"inertia_kg_m2": setup.inertia_kg_m2, "inertia_from": setup.inertia_from if known else None}


def inertia_text(inertia_kg_m2: float, inertia_from: str) -> str:
    """The inertia that turned accelerations into torques, and who gave it."""
    whose = {"configuration": "as configured", "model": "from the model"}.get(
        inertia_from, "the default, assumed: every torque goes with it; give `wheel.inertia_kg_m2`"
    )
    return f"inertia {inertia_kg_m2:.4g} kg m^2, {whose}"


def torques_text(core: Belief, inertia_kg_m2: float, setup: FilterSetup) -> str:
    """The two dry frictions of a belief in the parameters as torques, and what was assumed behind them.

    Beside a Stribeck speed that is not the wheel's static friction is another, as every torque is with the inertia.
    """
    milli, values, stds = 1.0e3 * inertia_kg_m2, core.parameters, core.parameter_std
    dry = (("Coulomb", values.coulomb, stds.coulomb), ("static", values.static, stds.static))
    shown = [f"{name} {plus_minus(milli * value, milli * std)} mN m" for name, value, std in dry]
    behind = inertia_text(inertia_kg_m2, setup.inertia_from)
    omega_s = setup.constants.stribeck.omega_s
    is_fitted = setup.effects.table().stribeck_at >= 0
    if setup.inertia_from == ASSUMED and omega_s == DEFAULT_STRIBECK_SPEED_RAD_S and not is_fitted:
        behind += (
            f"; Stribeck speed {rpm_from_rad_s(omega_s):.4g} rpm, the default, assumed: static friction goes with it; "
            "give `wheel.stribeck_speed_rpm`"
        )
    return f"as torques: {', '.join(shown)} ({behind})"


def entry_text(entry: Mapping[str, Any], statistics: RunStatistics, belief: Belief, setup: FilterSetup) -> str:
    """Return the same for a person: no digit that sigma does not allow."""
    prior = setup.prior
    lines = [
        f"{entry['log']}: {entry['samples']} samples, {entry['duration_s']:.1f} s"
        f" ({entry['missing']} missing, {entry['rejected']} rejected)"
    ]
    width = max(len(name) for name in PARAMETER_NAMES)
    lines += [f"  {item.name:<{width}}  {item.text()}" for item in report(belief.core, prior.core, statistics.points)]
    lines += effects_text(entry["effects"])
    if setup.inertia_kg_m2 is not None:
        lines.append("  " + torques_text(belief.core, setup.inertia_kg_m2, setup))
    speed = rpm_from_rad_s(entry["state"]["speed_rad_s"])
    lines.append(
        f"  {'speed':<{width}}  {speed:.2f} +- {rpm_from_rad_s(entry['std']['speed_rad_s']):.2f} rpm at the end"
    )
    innovation = entry["innovation"]
    if innovation["rms_rpm"] is not None:
        lines.append(
            f"  innovation: rms {innovation['rms_rpm']:.3g} rpm, mean {innovation['mean_rpm']:+.2g} rpm, "
            f"NIS {innovation['nis_mean']:.3f}, {100 * innovation['nis_inside_95']:.1f} % inside the 95 % band"
        )
    lines += [f"  warning: {text}" for text in entry["warnings"]]
    return "\n".join(lines)
