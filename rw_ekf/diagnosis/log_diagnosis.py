"""From a log to a diagnosis: residual, hypotheses, evidence, verdict, a better model (docs/likelihood.md)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, replace
from typing import TYPE_CHECKING, get_args

from rw_ekf.checking.choices import SplitKind, chosen
from rw_ekf.diagnosis.checks.confirmation import better_known
from rw_ekf.diagnosis.checks.heldout import FIGURES, performance
from rw_ekf.diagnosis.hypotheses.contenders import Search
from rw_ekf.diagnosis.hypotheses.excitation import information
from rw_ekf.diagnosis.hypotheses.outgrown_laws import LeftBehind, laws_left_behind
from rw_ekf.diagnosis.hypotheses.temperature_lag import with_likely_lag
from rw_ekf.diagnosis.investigate.found import Found
from rw_ekf.diagnosis.investigate.high_rate import thoroughly_investigated
from rw_ekf.diagnosis.investigate.late_rows import sentence_about_late_rows
from rw_ekf.diagnosis.investigate.sampled_loop import stated_of_sampled_loop
from rw_ekf.diagnosis.investigate.sigmas import with_known_lag
from rw_ekf.diagnosis.prepare.preparation import Advance, Prepared, prepare
from rw_ekf.diagnosis.prepare.source import Source, source_of
from rw_ekf.diagnosis.prepare.split import split_record
from rw_ekf.diagnosis.result import Diagnosis
from rw_ekf.diagnosis.verdict.conclude import conclude
from rw_ekf.diagnosis.verdict.document import SCHEMA
from rw_ekf.diagnosis.verdict.since_model import sentence_since_model
from rw_ekf.diagnosis.verdict.verdict import Verdict
from rw_ekf.effects.catalogue import with_own
from rw_ekf.identify.misread import misreadings_and_questions
from rw_ekf.logs.wheel_log import WheelLog
from rw_ekf.model.effect import Effect

if TYPE_CHECKING:
    from rw_ekf.settings.schema import Configuration
    from rw_ekf.wheel.model_file import WheelModel

_EXCITE = "`rw-ekf excite identification --config F` drives the wheel through all that is needed (600 s)"


def diagnose_log(
    log: WheelLog | Sequence[WheelLog],
    configuration: Configuration | None = None,
    model: WheelModel | None = None,
    *,
    split: SplitKind = "blocks",
    advance: Advance = lambda text: None,
    own: Sequence[type[Effect]] = (),
) -> Diagnosis:
    """Diagnose a log, or several of one wheel: shared parameters, each log with a start and a clock of its own.

    Raises LogError for one without a single usable speed, FilterError where nothing can be fitted.

    model: what is known already, its effects included; without it the four parameters alone are the base. Raises
    BadInputError for one with which the filter runs away. own: effects beside the catalogue's, by formulas of a user's
    own; those of the model need not be named again. Raises ConfigError where two of one id differ.
    """
    chosen("split", split, get_args(SplitKind))
    known = () if model is None else model.own_effects
    with with_own((*known, *own)):
        return _diagnosed(log, configuration, model, split, advance)


def _diagnosed(
    log: WheelLog | Sequence[WheelLog],
    configuration: Configuration | None,
    model: WheelModel | None,
    split: SplitKind,
    advance: Advance,
) -> Diagnosis:
    logs = [log] if isinstance(log, WheelLog) else log
    source = source_of(logs, () if model is None else model.effects.columns)
    described = configuration is not None or model is not None
    wanted = [(one, *misreadings_and_questions(one, described=described)) for one in logs]
    misread = [(one.name, text) for one, odd, _ in wanted for text in odd]
    if misread:
        faults = "; ".join(f"{name}: {text}" if len(logs) > 1 else text for name, text in misread)
        mend = "Mend the column map (`--columns map.yaml`) as the verdict says, and diagnose again."
        return _unjudged(source, split, f"the log is misread: {faults}", mend)
    source = replace(source, notes=(*source.notes, *(text for _, _, texts in wanted for text in texts)))
    if source.unfit is not None:
        return _unjudged(source, split, f"{source.unfit}; {_EXCITE}")
    advance("fitting the base model")
    prepared = prepare(source, configuration, model, split)
    left = LeftBehind() if model is None else laws_left_behind(prepared, model.effects)
    found = None if left.at_once else _investigated(prepared, advance)
    if model is not None and left.words and (found is None or found.new_ids or found.is_unexplained):
        source = replace(source, notes=(*source.notes, *left.words))
        # Laws were found beside each other: what one was off by may be in another.
        aside = model.without(model.effects.laws)
        found = _investigated(prepare(source, configuration, aside, split), advance)
    assert found is not None
    found = _with_sentence_first(found, stated_of_sampled_loop(found) or sentence_about_late_rows(found))
    if model is not None:
        found = _with_sentence_first(found, sentence_since_model(found))
    advance("judging on the held-out part")
    reported = conclude(found, advance)
    if len(logs) > 1 or logs[0].whole is None:
        return reported
    from rw_ekf.diagnosis.long_log_diagnosis import (
        held_against_all,  # few logs are so long, and a replay is much to import
    )

    return held_against_all(reported, found, logs[0].whole, advance)


def _investigated(prepared: Prepared, advance: Advance) -> Found:
    prepared = with_likely_lag(richer_part(prepared), advance)
    prepared.record.work.start_clock()
    return with_known_lag(thoroughly_investigated(prepared, advance))


def _with_sentence_first(found: Found, sentence: str) -> Found:
    """The same with a sentence more in front of the verdict."""
    source = found.prepared.source
    return replace(
        found, prepared=replace(found.prepared, source=replace(source, first_remark=source.first_remark + sentence))
    )


def richer_part(prepared: Prepared) -> Prepared:
    """Exchange the parts where the one that is held out can say more; halves are taken as they are.

    A part without a break-away, say, knows the static friction from its prior alone, and figures of the other one would
    be of that: the part is fitted then whose knowledge of the base model carries further.
    """
    if prepared.split.kind == "halves":
        return prepared
    if int(prepared.split.heldout.sum()) > 2 * int(prepared.split.fit.sum()):
        return prepared.exchanged()
    here, there = (information(prepared.base, part, prepared.facts) for part in (prepared.fit_part, prepared.heldout))
    ratios = [math.log(there[name] / here[name]) for name in here if here[name] > 0.0 < there[name]]
    return better_known(prepared.exchanged() if ratios and sum(ratios) > 0.0 else prepared, prepared.base)


def fit_with_effects(log: WheelLog, effect_ids: list[str], *, split: SplitKind = "blocks") -> float | None:
    """Free-run error [rpm] on the held-out part of a fit that is given the effects; None if it cannot run."""
    source = source_of([log])
    if source.unfit is not None:
        return None
    prepared = richer_part(prepare(source, None, None, split))
    search = Search(prepared.record, prepared.facts, lambda text: None)
    fit = prepared.base
    for name in effect_ids:
        fit = search.with_known(fit, name)
    figure: float | None = performance(prepared, fit).figures["free_run_rms_rpm"]
    return figure


def _unjudged(source: Source, kind: SplitKind, why: str, advice: str | None = None) -> Diagnosis:
    """The verdict for a log that cannot judge even the base model; advice: what to do, if not to excite the wheel."""
    log = source.log
    split = split_record(log.time_s, log.segment, log.speed_rad_s, kind, 0.0)
    nothing = dict.fromkeys(FIGURES)
    statement = f"{source.first_remark}Cannot be judged: {why}."
    document = {
        "schema": SCHEMA,
        **source.document(),
        "split": split.document(),
        "verdict": asdict(Verdict("insufficient_excitation", statement=statement)),
        "candidates": [],
        "before": nothing,
        "after": nothing,
        "model": None,
        "inertia_kg_m2": None,
        "inertia_from": None,
        "parameters": {"before": None, "after": None},
        "explanations": [],
        "ledger": [],
        "ended": None,
        "map": [],
        "torque_noise": None,
        "reading_noise": None,
        "swallowed": [],
        "shapes": [],
        "residual_tests": {"before": None, "after": None},
        "warnings": [*source.notes, *log.warnings],
        "left_out": [],
        **({} if advice is None else {"advice": advice}),
    }
    return Diagnosis(log, document, split.heldout, in_rpm=log.in_rpm)
