"""From fits to a verdict: what is named, what cannot be distinguished, and one sentence a person can act on."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

from rw_ekf.diagnosis.checks.command_periods import chance_of_answer
from rw_ekf.diagnosis.checks.heldout import Performance, percent_better
from rw_ekf.diagnosis.checks.reading_grid import Lattice
from rw_ekf.diagnosis.hypotheses.confounding import Quantity, is_smooth_in_time, one_and_the_same, separates
from rw_ekf.diagnosis.hypotheses.selection import Selection
from rw_ekf.diagnosis.investigate.found import Found
from rw_ekf.diagnosis.standing import Reason
from rw_ekf.diagnosis.thresholds import DOUBTFUL, GRID_GAINS, GROUP, LEAST_POSTERIOR
from rw_ekf.diagnosis.verdict.explanations import NONE
from rw_ekf.diagnosis.verdict.posterior import SOMETHING_ELSE
from rw_ekf.diagnosis.verdict.sentences import (
    improvement,
    lag_of,
    measured_by_little,
    noise_text,
    or_another_kind,
    or_another_law,
    or_another_order,
    sentence_of,
    separation,
)
from rw_ekf.effects.catalogue import CATALOGUE, GRID
from rw_ekf.model.law import OF_SPEED
from rw_ekf.numbers import chance_text, p_text
from rw_ekf.units import rpm_from_rad_s

_FAR_OFF = 2.0  # times the readings' noise, by which a model that explains a record does not miss it
_CONFUSED_WITH_TIME: tuple[Quantity, ...] = ("speed", "temperature")


@dataclass(frozen=True)
class Verdict:
    """The `verdict` object of the document."""

    kind: str
    effects: list[str] = field(default_factory=list)
    indistinguishable: list[list[str]] = field(default_factory=list)
    posterior: dict[str, float] = field(default_factory=dict)  # by id, and of `none` and `something_else`
    statement: str = ""


@dataclass(frozen=True)
class Evidence:
    """All that a verdict is made of."""

    found: Found
    lattice: Lattice | None  # None: no grid that is named
    posterior: dict[str, float]
    before: Performance  # on the held-out part
    after: Performance
    heldout_s: float  # how long that is
    by_turns: bool  # whether each stretch of it is foretold by all the rest of the record
    failed: Mapping[str, float]  # what tests of the residual found that noise does not have, in words, with its p
    noisy: str | None  # what the noises have swallowed, in words
    doubted: list[str] = field(default_factory=list)  # effects that were found and are less likely than not
    describes: bool = False  # those foretell the record better all the same


def verdict_on(shown: Evidence) -> Verdict:
    """What is reported of a record, from what was found in it."""
    found, elsewhere = shown.found, shown.posterior.get(SOMETHING_ELSE, 0.0)
    named = bool(found.new_ids) or shown.lattice is not None
    if found.is_unexplained and not _is_chance(shown):
        text = _of_no_catalogue(found)
    elif shown.describes:
        text = _description(shown)
    elif shown.doubted and not shown.failed and shown.posterior.get(NONE, 0.0) >= 0.5:
        return Verdict("adequate", posterior=shown.posterior, statement=_adequate(shown))
    elif shown.doubted or (not named and _lacks_something(shown.posterior)):
        text = (
            "This log wants more than the model, and does not settle what: "
            f"{_doubts(found.selection, shown.posterior)}; the residual itself looks like noise of {noise_text(found)}."
        )
    elif named:
        return _effect(shown)
    elif shown.failed:
        beside = "" if shown.noisy is None else f"; and {shown.noisy}"
        text = (
            f"What is left is not noise: {_reported(shown.failed)}{beside}. No effect of the catalogue explains it; "
            "the estimates may be off by more than their sigmas say."
        )
    elif shown.noisy is not None and elsewhere > 0.5:
        text = f"What is left is not noise as it should be: {shown.noisy}. No effect of the catalogue explains it."
    elif elsewhere > 0.5:
        text = (
            "Something that is in no catalogue is likelier behind this log than the model alone; see the map of the "
            "residual."
        )
    else:
        return Verdict("adequate", posterior=shown.posterior, statement=_adequate(shown))
    return Verdict("unexplained", posterior=shown.posterior, statement=text)


def _is_chance(shown: Evidence) -> bool:
    """Whether what the map shows of a model to which nothing was added is likelier chance than anything else."""
    return not shown.found.new_ids and shown.posterior.get(NONE, 0.0) >= 0.5


def _of_no_catalogue(found: Found) -> str:
    left = found.left
    along = ", ".join(item.name for item in left[:2])
    nearest = found.new_ids if found.nearest is None else found.selection.new_in(found.nearest)
    partly = f"; {', '.join(nearest)} would explain {100.0 * found.share:.0f} % of it" if nearest else ""
    if found.nearest is not None:
        partly += ", less likely than one smooth law without a name"
    return (
        f"The residual is not noise: it depends on {along} (p = {left[0].p_value:.0e}) in a way that no effect of the "
        f"catalogue explains{partly}; see the map of the residual for its shape."
    )


def _description(shown: Evidence) -> str:
    """What comes nearest where something else is likelier: no cause, and a model that foretells better."""
    found, chance = shown.found, chance_text(shown.posterior[SOMETHING_ELSE])
    nearest = "; ".join(sentence_of(found.reported, name, found.prepared.facts) for name in found.new_ids)
    if chance_of_answer(found.fit, found.prepared.record.course) > 0.5:
        nearest += " (a period of the command's own: what answers the command late may look like that)"
    return (
        f"Something that is in no catalogue is likelier ({chance}) behind this log than what comes nearest to it: "
        f"{nearest}. With that {_gained(shown, list(found.new_ids))}: the model holds it as a description, and as no "
        f"cause; {_what_is_left(shown)}."
    )


def _adequate(shown: Evidence) -> str:
    selection = shown.found.selection
    given, kept = set(selection.base.model.effects.ids), set(selection.final.model.effects.ids)
    note = " (nothing was added to the model given)" if given else ""
    if given - kept:
        note = f" (of the model given, {', '.join(sorted(given - kept))} is not missed)"
    doubt = _doubt(selection, shown.posterior) + ("" if shown.noisy is None else f"; but {shown.noisy}")
    if shown.found.left:
        left, chance = shown.found.left[0], chance_text(shown.posterior.get(SOMETHING_ELSE, 0.0))
        doubt += (
            f"; it depends on {left.name} (p = {left.p_value:.0e}), by chance unless something else ({chance}) is there"
        )
    return f"The model explains this log: what is left is noise of {noise_text(shown.found)}{note}{doubt}."


def _effect(shown: Evidence) -> Verdict:
    """What was named, how large it is, what it gains, what is left, and what would separate it from others."""
    found, facts = shown.found, shown.found.prepared.facts
    names = list(found.new_ids)
    sentences = [
        sentence_of(found.reported, name, facts)
        + or_another_order(found, name)
        + or_another_law(found, name)
        + or_another_kind(found, name)
        for name in names
    ]
    if shown.lattice is not None:
        names.append(GRID.id)
        sentences.append(GRID.sentence(shown.lattice.grid_rad_s, 0.0, (0.0, 0.0, 0.0), facts))
    where = ""
    if any(CATALOGUE[name].local_in_time for name in names):
        where = " (an event is sought on the whole record; its gain is that on every other 5 s inside it)"
    text = f"{'; '.join(sentences)}{lag_of(found)}; add {', '.join(names)}{where}: "
    text += f"{_gained(shown, names)}; {_what_is_left(shown)}."
    text += measured_by_little(found, by_turns=shown.by_turns)
    groups = _grouped(found.selection, names, shown.posterior)
    text += f" {separation(groups[0], shown.posterior, found.selection)}." if groups else _another_record(found, names)
    if shown.posterior.get(SOMETHING_ELSE, 0.0) >= 0.5:
        chance = chance_text(shown.posterior[SOMETHING_ELSE])
        text += f" The chance that something else is behind this, or beside it: {chance}."
    return Verdict("effect", names, groups, shown.posterior, text)


def _gained(shown: Evidence, names: list[str]) -> str:
    before, after = shown.before.figures, shown.after.figures
    better = improvement(before, after, shown.heldout_s, wheel_units=shown.found.prepared.in_rpm)
    gained = percent_better(before, after)
    if names == [GRID.id] and (gained is None or gained < GRID_GAINS):
        return f"no held-out error is smaller for knowing it ({better})"
    return better


def _what_is_left(shown: Evidence) -> str:
    left = shown.found.left
    some = [f"some dependence on {left[0].name} is left"] if left else []
    some += [f"what is left is not noise: {_reported(shown.failed)}"] if shown.failed else []
    some += [shown.noisy] if shown.noisy is not None else []
    return ", and ".join(some) or _nothing_is_left(shown)


def _nothing_is_left(shown: Evidence) -> str:
    """That noise is all, one step ahead; with what the model misses by all the same where it runs free."""
    if shown.lattice is not None:
        return "nothing but the rounding is left"
    noise_rpm = rpm_from_rad_s(math.sqrt(shown.found.fit.noise.variance))
    missed = (shown.after.figures["free_run_rms_rpm"] or 0.0) / noise_rpm
    if missed < _FAR_OFF:
        return "nothing is left in the residual"
    return f"nothing is left one step ahead, but run free it misses by {missed:.2g} times the readings' noise"


def _another_record(found: Found, names: list[str]) -> str:
    """Which record would show whether what goes with time, or the speed, does, where this one has the two as one."""
    timed = any(is_smooth_in_time(CATALOGUE[name]) for name in names)
    laws = any(law.quantity in OF_SPEED for law in found.fit.model.sought_laws)
    wanted: tuple[Quantity, ...] = _CONFUSED_WITH_TIME if timed else ("speed",) if laws else ()
    other = next((other for other in wanted if one_and_the_same(found.fit, "time", other)), None)
    if other is None:
        return ""
    way, what = separates(other), "time" if timed else "the speed"
    return f" {way[:1].upper()}{way[1:]} would show whether it goes with {what} at all."


def _reported(failed: Mapping[str, float]) -> str:
    """`it is correlated in time (p = 1e-71), and its mean is not zero (p = 2e-05)`."""
    return ", and ".join(f"{words} ({p_text(p)})" for words, p in failed.items())


def _lacks_something(posterior: dict[str, float]) -> bool:
    """Whether an effect that may not be named is likelier than the model alone, and than anything else."""
    effects = _effects_in(posterior)
    return bool(effects) and posterior[effects[0]] > max(posterior.get(NONE, 1.0), posterior.get(SOMETHING_ELSE, 0.0))


def _doubt(selection: Selection, posterior: dict[str, float]) -> str:
    """What speaks against a model to which nothing was added, where it is not four times as likely as anything else."""
    likeliest = max((posterior[name] for name in _effects_in(posterior)), default=0.0)
    doubted = likeliest >= DOUBTFUL and posterior.get(NONE, 1.0) < 1.0 - 2.0 * DOUBTFUL
    return f"; but {_doubts(selection, posterior)}" if doubted else ""


def _doubts(selection: Selection, posterior: dict[str, float]) -> str:
    """How probable it is that nothing is missing, and what is likeliest to be, with why it was not named."""
    first, *others = _effects_in(posterior)
    effects = [first, *(name for name in others if posterior[name] >= DOUBTFUL)]
    chances = ", ".join(f"{name} {chance_text(posterior[name])}" for name in effects[:GROUP])
    trial = selection.trials.get(effects[0])
    explained = trial is None or trial.decision.reason is Reason.EXPLAINED
    why = "" if trial is None or explained else f"; {effects[0]} is {trial.decision.words}"
    return f"the probability that nothing is missing is {chance_text(posterior[NONE])} ({chances}{why})"


def _effects_in(posterior: dict[str, float]) -> list[str]:
    """The ids of effects, the most probable first."""
    return [name for name in posterior if name not in {NONE, SOMETHING_ELSE}]


def _grouped(selection: Selection, chosen: list[str], posterior: dict[str, float]) -> list[list[str]]:
    """Each effect with those that the data cannot distinguish from it, the most probable of them."""
    groups: list[list[str]] = []
    for name in chosen:
        constructed = selection.one_by_construction(name)
        described = {other for group in groups for other in group} & constructed
        rivals = [
            rival.name
            for rival in selection.rivals.get(name, ())
            if posterior.get(rival.name, 0.0) >= LEAST_POSTERIOR or rival.name in constructed
            if rival.name not in chosen and rival.name not in described
        ]
        if rivals:
            rivals.sort(key=lambda other: -posterior.get(other, 0.0))
            groups.append([name, *dict.fromkeys(rivals)][:GROUP])
    return groups
