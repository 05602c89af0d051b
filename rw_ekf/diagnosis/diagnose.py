"""From a log to a diagnosis: residual, hypotheses, evidence, verdict, a better model (docs/diagnosis.md)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from rw_ekf.diagnosis.candidates import testable
from rw_ekf.diagnosis.event import event_gain_percent
from rw_ekf.diagnosis.evidence import (
    EXPLAINED_SHARE,
    INDISTINGUISHABLE,
    MAP_P,
    WHOLE_P,
    threshold,
)
from rw_ekf.diagnosis.fitting import Fit
from rw_ekf.diagnosis.metrics import Judged, heldout_likelihood, judge_model
from rw_ekf.diagnosis.preparation import Prepared, prepare, unfit
from rw_ekf.diagnosis.quantisation import Lattice, find_lattice
from rw_ekf.diagnosis.records import Diagnosis, ModelTrace
from rw_ekf.diagnosis.residual_map import Dependence, residual_map
from rw_ekf.diagnosis.residual_tests import residual_tests
from rw_ekf.diagnosis.selection import Search, Selection, determined
from rw_ekf.diagnosis.split import Kind, split_record
from rw_ekf.diagnosis.verdict import (
    Verdict,
    described,
    grouped,
    improvement,
    left_over,
    sentence,
    separation,
)
from rw_ekf.effects.catalogue import CATALOGUE
from rw_ekf.effects.table import Column, EffectSet
from rw_ekf.replay import input_of_log
from rw_ekf.units import RAD_S_PER_RPM, rpm_from_rad_s

if TYPE_CHECKING:
    from rw_ekf.logs.wheel_log import WheelLog
    from rw_ekf.model_file import WheelModel
    from rw_ekf.settings.schema import Configuration

Float64Array = NDArray[np.float64]
Advance = Callable[[str], object]

SCHEMA = "rw_ekf.diagnosis/1"
MODEL_FILE = "augmented-model.yaml"
_QUANTISATION = "speed_quantisation"
_WORST_GAIN_PERCENT = -2.0  # an effect that matters does not make the free run worse; a small one may not better it
_LEAST_SIGMAS_OF_PART = 1.0  # what the whole record found, one part must know at least so well
_REGISTER_RPM = 0.6  # a finer grid than this is the wire's own register (0.5 rpm), which nobody calls an effect


@dataclass
class _Found:
    """A search and what it left, on the whole record."""

    prepared: Prepared
    search: Search
    selection: Selection
    whole: Fit  # the final model on the whole record
    left: list[Dependence]


def diagnose_log(
    log: WheelLog,
    configuration: Configuration | None = None,
    model: WheelModel | None = None,
    *,
    split: Kind = "blocks",
    advance: Advance = lambda text: None,
) -> Diagnosis:
    """Diagnose a log. Raises LogError for one without a single usable speed, FilterError where nothing can be fitted.

    model: what is known already, its effects included; without it the four parameters alone are the base.
    """
    data = input_of_log(log)
    reason = unfit(log, data)
    if reason is not None:
        return _unjudged(log, reason, split)
    advance("fitting the base model")
    found = _look(prepare(log, configuration, model, split), advance)
    if split == "blocks" and not _news(found) and _left(found):
        # What acts may have acted in the held-out blocks alone: then they are searched, and the others held out.
        other = _look(found.prepared.swapped(), advance)
        if _news(other):
            found = other
    advance("judging on the held-out part")
    lattice = _lattice(found)
    return _conclude(found, lattice, configuration, advance)


def fit_told(log: WheelLog, effect_ids: list[str], *, split: Kind = "blocks") -> float | None:
    """Free-run error [rpm] on the held-out part of a fit that is told the effects; None if it cannot run."""
    if unfit(log, input_of_log(log)) is not None:
        return None
    prepared = prepare(log, None, None, split)
    search = Search(prepared.fit_part, prepared.whole, prepared.seen, prepared.prior, prepared.facts, lambda text: None)
    fit = prepared.base
    for name in effect_ids:
        fit = search.told(fit, name)
    figure: float | None = _judge(prepared, fit, None).figures["free_run_rms_rpm"]
    return figure


def _look(prepared: Prepared, advance: Advance) -> _Found:
    """Search the fit part, then the whole record for what one part shows too little of; keep what is confirmed."""
    search = Search(prepared.fit_part, prepared.whole, prepared.seen, prepared.prior, prepared.facts, advance)
    selection = search.run(prepared.base)
    if _new_ids(selection):
        search.with_rivals(selection)
        _settle_rivals(search, selection)
        _confirm(prepared, search, selection, _new_ids(selection))
    _widen(prepared, search, selection, advance)
    advance("mapping the residual")
    whole = search.on_whole(selection.final)
    return _Found(prepared, search, selection, whole, residual_map(whole, prepared.prior, prepared.facts))


def _widen(prepared: Prepared, search: Search, selection: Selection, advance: Advance) -> None:
    """Look at the whole record for more, at a stricter level; coefficients are the fit part's all the same.

    The held-out part then has a share in finding an effect, but none in its size, and must still be predicted better.
    """
    advance("searching the whole record")
    whole, facts = prepared.whole, prepared.facts
    everywhere = Search(whole, whole, prepared.seen, prepared.prior, facts, advance, enough=WHOLE_P)
    wide = everywhere.run(search.on_whole(selection.final))
    names = [name for name in wide.final.model.effects.ids if name not in selection.final.model.effects.ids]
    if not names:
        return
    everywhere.with_rivals(wide)
    _settle_rivals(everywhere, wide)
    names = [name for name in wide.final.model.effects.ids if name not in selection.final.model.effects.ids]
    fit = selection.final
    for name in [name for name in fit.model.effects.ids if name not in wide.final.model.effects.ids]:
        fit = search.without(fit, name)
        selection.trials[name].decision = f"explained by {', '.join(names)}"
    for name in names:
        told = search.told(fit, name)
        selection.trials[name] = wide.trials[name]
        if determined(told, name, _LEAST_SIGMAS_OF_PART):
            fit = told
        else:
            selection.trials[name].decision = "not confirmed: the searched part knows no size of it"
    before = set(fit.model.effects.ids)
    selection.final = fit
    _confirm(prepared, search, selection, [name for name in names if name in before])
    selection.rivals |= {name: fits for name, fits in wide.rivals.items() if name in selection.final.model.effects.ids}
    selection.whole_record = [name for name in names if name in selection.final.model.effects.ids]


def _left(found: _Found) -> list[Dependence]:
    """What noise does not explain in the map."""
    return left_over(found.left, MAP_P)


def _new_ids(selection: Selection) -> list[str]:
    before = set(selection.base.model.effects.ids)
    return [name for name in selection.final.model.effects.ids if name not in before]


def _news(found: _Found) -> bool:
    return bool(_new_ids(found.selection))


def _settle_rivals(search: Search, selection: Selection) -> None:
    """Between explanations that the searched part cannot tell apart, the whole record decides where it can."""
    for name, fits in list(selection.rivals.items()):
        tried = [(search.on_whole(fit).likelihood.value, fit) for fit in (selection.final, *fits)]
        top, best = max(tried, key=lambda item: item[0])
        near = [fit for value, fit in tried if fit is not best and 2.0 * (top - value) < INDISTINGUISHABLE]
        selection.rivals.pop(name)
        if best is not selection.final:
            winner = next(other for other in best.model.effects.ids if other not in selection.final.model.effects.ids)
            selection.trials[name].decision = f"explained by {winner}"
            selection.final = best
            name = winner  # noqa: PLW2901
        if near:
            selection.rivals[name] = near


def _confirm(prepared: Prepared, search: Search, selection: Selection, names: list[str]) -> None:
    """Drop what worsens the held-out part, by its likelihood or by its free run; an event is not judged there."""
    for name in names:
        if CATALOGUE[name].local_in_time:
            continue
        less = search.without(selection.final, name)
        with_it = heldout_likelihood(prepared.heldout, selection.final, prepared.seen)
        likelier = with_it > heldout_likelihood(prepared.heldout, less, prepared.seen)
        gain = _gain_over(prepared, less, selection.final)
        if not likelier or (gain is not None and gain < _WORST_GAIN_PERCENT):
            selection.trials[name].decision = "not confirmed on the held-out part"
            selection.final = less


def _lattice(found: _Found) -> Lattice | None:
    """The grid of the readings, if it is coarser than their noise."""
    prepared, fit = found.prepared, found.whole
    if _QUANTISATION in prepared.base.model.effects.ids:
        return None
    judged = _judge(prepared, fit, None)
    innovation = judged.trace.one_step_error_rad_s
    speed = prepared.data.speed_rad_s
    lattice = find_lattice(
        speed, speed - innovation, judged.predicted_std_rad_s, fit.noise.variance, prepared.split.heldout,
        0.0 if prepared.setup.inertia_kg_m2 is None else _REGISTER_RPM * RAD_S_PER_RPM,
    )  # fmt: skip
    if lattice is None or lattice.statistic + lattice.heldout_statistic < 0.0:
        return None
    return lattice


def _judge(prepared: Prepared, fit: Fit, inertia: float | None) -> Judged:
    return judge_model(
        prepared.whole,
        fit.model,
        fit.noise,
        prepared.split.heldout,
        prepared.split.block,
        prepared.base.omit,
        prepared.seen,
        inertia,
    )


def _conclude(
    found: _Found, lattice: Lattice | None, configuration: Configuration | None, advance: Advance
) -> Diagnosis:
    prepared, selection = found.prepared, found.selection
    inertia = prepared.setup.inertia_kg_m2 if configuration is None else configuration.wheel.inertia_kg_m2
    before = _judge(prepared, selection.base, inertia)
    names = _new_ids(selection)
    left = _left(found)
    share = _share(found, left)
    unexplained = bool(left) and share < EXPLAINED_SHARE
    after = _judge(prepared, selection.final, inertia) if names else before
    quantised = lattice is not None and not unexplained
    verdict = _verdict(found, names, left, share, lattice if quantised else None, before, after)
    chosen = [] if unexplained else [*names, *([_QUANTISATION] if quantised else [])]
    for name in names:
        trial = selection.trials[name]
        trial.decision = "added" if not unexplained else "explains only part of the residual"
    advance("writing the model")
    model = _model(found, lattice if quantised else None) if chosen else None
    if chosen and quantised and not names:
        after = before
    document = {
        "schema": SCHEMA,
        "log": prepared.log.name,
        "samples": len(prepared.log),
        "rate_hz": prepared.log.rate_hz,
        "split": prepared.split.document(),
        "verdict": verdict.document(),
        "candidates": _candidates(found, lattice, verdict, before, after),
        "before": before.figures,
        "after": after.figures if chosen else before.figures,
        "model": MODEL_FILE if model is not None else None,
        "map": [
            {"dependence": d.name, "statistic": d.statistic, "degrees_of_freedom": d.freedom, "p_value": d.p_value}
            for d in found.left
        ],
        "residual_tests": {
            "before": residual_tests(before.trace.normalised_innovation),
            "after": residual_tests((after if chosen else before).trace.normalised_innovation),
        },
        "warnings": [*prepared.log.warnings, *prepared.setup.notes, *prepared.notes],
    }
    heldout = np.zeros(prepared.kept.size, dtype=bool)
    heldout[prepared.kept] = prepared.split.heldout
    return Diagnosis(
        prepared.log,
        document,
        heldout,
        _over_log(prepared, before.trace),
        _over_log(prepared, after.trace) if chosen else None,
        prepared.over_log(prepared.whole.temperature_degC) if prepared.temperature_is_logged else None,
        prepared.over_log(prepared.whole.angle_rad) if prepared.facts.angle else None,
        prepared.angle_is_logged,
        model,
        inertia,
    )


def _over_log(prepared: Prepared, trace: ModelTrace) -> ModelTrace:
    return ModelTrace(
        prepared.over_log(trace.one_step_error_rad_s),
        prepared.over_log(trace.free_run_rad_s),
        prepared.over_log(trace.residual_acceleration_rad_s2),
        prepared.over_log(trace.normalised_innovation),
    )


def _share(found: _Found, left: list[Dependence]) -> float:
    """Of all the structure there was, what the effects explain."""
    if not left:
        return 1.0
    base = found.search.on_whole(found.selection.base)
    explained = 2.0 * (found.whole.likelihood.value - base.likelihood.value)
    return explained / (explained + max(item.statistic for item in left)) if explained > 0.0 else 0.0


def _verdict(
    found: _Found,
    names: list[str],
    left: list[Dependence],
    share: float,
    lattice: Lattice | None,
    before: Judged,
    after: Judged,
) -> Verdict:
    facts = found.prepared.facts
    if left and share < EXPLAINED_SHARE:
        along = ", ".join(item.name for item in left[:2])
        partly = f"; {', '.join(names)} would explain {100.0 * share:.0f} % of it" if names else ""
        return Verdict(
            "unexplained",
            statement=(
                f"The residual is not noise: it depends on {along} (p = {left[0].p_value:.0e}) in a way that no effect "
                f"of the catalogue explains{partly}; see the map of the residual for its shape."
            ),
        )
    if not names and lattice is None:
        note = " (nothing was added to the model given)" if found.prepared.base.model.effects.columns else ""
        return Verdict(
            "adequate",
            statement=f"The model explains this log: what is left is noise of {_noise_text(found)}{note}.",
        )
    said = [sentence(found.selection.final, name, facts) for name in names]
    if lattice is not None:
        names = [*names, _QUANTISATION]
        said.append(CATALOGUE[_QUANTISATION].sentence(lattice.grid_rad_s, 0.0, (0.0, 0.0, 0.0), facts))
    groups = grouped(found.selection, names)
    seconds = sum(b - a for a, b in found.prepared.split.document()["heldout_s"])
    tail = "nothing is left in the residual" if not left else f"some dependence on {left[0].name} is left"
    where = ""
    if found.selection.whole_record:
        where = f" ({', '.join(found.selection.whole_record)} sought on the whole record)"
    if any(CATALOGUE[name].local_in_time for name in names):
        where += " (an event is sought on the whole record; its gain is that on every other 5 s inside it)"
    better = improvement(
        before.figures, after.figures, seconds, wheel_units=found.prepared.setup.inertia_kg_m2 is not None
    )
    text = f"{'; '.join(said)}; add {', '.join(names)}{where}: {better}; {tail}."
    if groups:
        text += f" {separation(groups[0])}."
    return Verdict("effect", names, groups, text)


def _noise_text(found: _Found) -> str:
    sigma = float(np.sqrt(found.whole.noise.variance))
    if found.prepared.setup.inertia_kg_m2 is None:
        return f"{sigma:.3g} in the unit of the speed"
    return f"{rpm_from_rad_s(sigma):.3g} rpm"


def _candidates(
    found: _Found, lattice: Lattice | None, verdict: Verdict, before: Judged, after: Judged
) -> list[dict[str, Any]]:
    """One entry for every effect of the catalogue, strongest first."""
    facts, selection = found.prepared.facts, found.selection
    reasons = testable(facts)
    entries = []
    for name, effect in CATALOGUE.items():
        trial = selection.trials.get(name)
        entry: dict[str, Any] = {
            "effect": name, "parameters": {}, "statistic": None, "p_value": None,
            "heldout_gain_percent": None, "decision": "not significant",
        }  # fmt: skip
        if name in selection.base.model.effects.ids:
            entry["decision"] = "in the model already"
            entry["parameters"] = _parameters(selection.final, name)
        elif name == _QUANTISATION:
            if lattice is not None:
                entry |= _lattice_entry(lattice)
                entry["decision"] = "added" if name in verdict.effects else "not significant"
            else:
                entry["decision"] = "no grid coarser than the noise"
        elif reasons[name] is not None:
            entry["decision"] = f"not testable: {reasons[name]}"
        elif trial is not None:
            entry |= {"statistic": trial.statistic, "p_value": trial.p_value, "decision": trial.decision}
            entry["threshold"] = threshold(effect, facts)
            if name in selection.final.model.effects.ids:
                entry["parameters"] = _parameters(selection.final, name)
                entry["heldout_gain_percent"] = _gain(found, name)
            else:
                entry["parameters"] = _tried(trial.columns, trial.std)
                if trial.decision == "not significant" and trial.p_value < 1.0e-5:
                    entry["decision"] = (
                        f"explained by {', '.join(_new_ids(selection))}" if _news(found) else "too small to matter"
                    )
            for group in verdict.indistinguishable:
                if name in group[1:]:
                    entry["decision"] = f"indistinguishable from {group[0]}"
        entries.append(entry)
    return sorted(entries, key=lambda e: -(e["statistic"] if e["statistic"] is not None else -1.0e300))


def _gain(found: _Found, name: str) -> float | None:
    """Percent by which the held-out error falls when the effect is added to the others."""
    if CATALOGUE[name].local_in_time:
        return event_gain_percent(found.whole, name, found.prepared.prior, found.prepared.seen)
    final = found.selection.final
    return _gain_over(found.prepared, found.search.without(final, name), final)


def _gain_over(prepared: Prepared, less: Fit, more: Fit) -> float | None:
    """Percent by which the free-run error (20 s ahead where there is none) on the held-out part is smaller."""
    before, after = _judge(prepared, less, None).figures, _judge(prepared, more, None).figures
    key = "free_run_rms_rpm" if before["free_run_rms_rpm"] is not None else "horizon_20s_rms_rpm"
    if not before[key] or after[key] is None:
        return None
    return float(100.0 * (1.0 - after[key] / before[key]))


def _parameters(fit: Fit, name: str) -> dict[str, Any]:
    return described(fit, name) if any(column.id == name for column in fit.model.columns) else {}


def _tried(columns: tuple[Column, ...], std: float) -> dict[str, Any]:
    """Parameters of a candidate that was only scored."""
    first = columns[0]
    value = float(np.linalg.norm([column.value for column in columns])) if len(columns) > 1 else first.value
    return dict(first.effect.described(value, std, first.shape))


def _lattice_entry(lattice: Lattice) -> dict[str, Any]:
    coefficient = CATALOGUE[_QUANTISATION].coefficient
    return {
        "parameters": {coefficient.name: {"value": lattice.grid_rad_s, "std": None, "unit": coefficient.unit}},
        "statistic": lattice.statistic,
        "p_value": None,
    }


def _model(found: _Found, lattice: Lattice | None) -> WheelModel:
    """The final model, fitted to the whole record, as a file carries it on."""
    from rw_ekf import __version__
    from rw_ekf.model.friction import LAW_CODES
    from rw_ekf.model_file import WheelModel

    fit, prepared = found.whole, found.prepared
    known = 4 + len(fit.model.columns)
    covariance = fit.likelihood.covariance[:known, :known]
    covariance = 0.5 * (covariance + covariance.T)
    effects = fit.model.effects.with_values(fit.model.effects.values, fit.std[4:known])
    variance = fit.noise.variance
    if lattice is not None:
        grid = Column(CATALOGUE[_QUANTISATION], lattice.grid_rad_s, 0.0, (0.0, 0.0, 0.0), in_state=False)
        effects = EffectSet((*effects.columns, grid))
        variance = max(variance - lattice.grid_rad_s**2 / 12.0, (0.02 * lattice.grid_rad_s) ** 2)
    names = {code: name for name, code in LAW_CODES.items()}
    return WheelModel(
        fit.model.parameters,
        tuple(tuple(float(v) for v in row) for row in covariance),
        fit.model.omega_s,
        names[fit.model.law],
        float(np.sqrt(variance)),
        float(np.sqrt(fit.noise.ratio * fit.noise.variance / prepared.data.period_s)),
        prepared.setup.inertia_kg_m2,
        {"method": "diagnose, fitted to the whole record", "log": prepared.log.name, "rw_ekf": __version__},
        effects,
    )


def _unjudged(log: WheelLog, reason: str, kind: Kind) -> Diagnosis:
    """The verdict for a log that cannot judge even the base model."""
    split = split_record(log.time_s, log.segment, log.speed_rad_s, kind, 0.0)
    advice = "`rw-ekf excite identification --config F` drives the wheel through all that is needed (600 s)"
    nothing = dict.fromkeys(
        (
            "one_step_rms_rpm",
            "horizon_1s_rms_rpm",
            "horizon_20s_rms_rpm",
            "free_run_rms_rpm",
            "nis_mean",
            "torque_rms_mNm",
        )
    )
    statement = f"Cannot be judged: {reason}; {advice}."
    document = {
        "schema": SCHEMA,
        "log": log.name,
        "samples": len(log),
        "rate_hz": log.rate_hz,
        "split": split.document(),
        "verdict": Verdict("insufficient_excitation", statement=statement).document(),
        "candidates": [],
        "before": nothing,
        "after": nothing,
        "model": None,
        "map": [],
        "residual_tests": {"before": None, "after": None},
        "warnings": list(log.warnings),
    }
    return Diagnosis(log, document, split.heldout, None, None, None, None, False, None)
