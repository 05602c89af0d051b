"""Effects enter and leave a model by likelihood, jointly (docs/diagnosis.md, "Selection").

In every turn the best place of each effect is scored beside all that the model has; the strongest few are fitted in
full, shapes and all, and the best fit enters. Then each effect already in the model must still be missed when it is
left out, or goes: an offset that vanishes once viscous friction is split by direction explained nothing.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from rw_ekf.diagnosis.search.candidates import Score, hypotheses
from rw_ekf.diagnosis.search.confounding import Quantity, may_confound, quantity_of, says_more, scorer_beside
from rw_ekf.diagnosis.search.scorer import Scorer
from rw_ekf.diagnosis.search.trial import (
    EXPLAINED_SHARE,
    LOCAL_P,
    SIGNIFICANT_P,
    Selection,
    Trial,
    determined,
    matters,
    p_value,
    possible,
    terms_in,
)
from rw_ekf.diagnosis.standing import IMPOSSIBLE, TOO_SMALL, explained_by
from rw_ekf.effects.catalogue import CATALOGUE
from rw_ekf.likelihood import work
from rw_ekf.likelihood.fitting import Fit, fit_model
from rw_ekf.likelihood.frame import Prior
from rw_ekf.likelihood.model import Model
from rw_ekf.likelihood.one_step import Record, Reference
from rw_ekf.likelihood.robust_fit import smoothed_by_filter
from rw_ekf.model.effect import Candidate, Effect, RecordFacts, Term

_MOST_EFFECTS, _MOST_TURNS = 4, 7  # a periodic effect may have several lines
_TRIED = 3  # strongest candidates that are fitted in full in each turn
_WORTH_A_FIT_P = 1.0e-2
_RIVAL_MARGIN = 16.0  # of twice the log-likelihood on the part: nearer ones are compared on the whole record
_KEPT_SHARE = 0.5  # of the gain that a regression promised: a fit with less went astray
_WORTH_A_LAW = 16.0  # of twice the log-likelihood, for one law more
_ZOOMS = 8  # of the place of an event
_ALIAS_SHARE = 0.5  # of the best statistic: a candidate with less is no rival


class Search:
    """Finds the effects that a part of a record asks for."""

    def __init__(
        self,
        fit_part: Record,
        whole: Record,
        seen: Reference,
        prior: Prior,
        facts: RecordFacts,
        advance: Callable[[str], object],
        enough: float = SIGNIFICANT_P,
        share: float = work.SEARCH,
    ) -> None:
        """seen: the whole record's speed, smoothed under the base model; enough: p-value at which an effect enters.

        share: of the diagnosis's work that may be spent before the search ends where it stands.
        """
        self.work = whole.work
        self.share = share
        self.where = "the whole record" if fit_part is whole else "the part that is searched"
        self.fit_part = fit_part
        self.whole = whole
        self.seen = seen
        self.enough = enough
        self.prior = prior
        self.facts = facts
        self.advance = advance
        self.stationary_first = True  # what goes with time waits where time goes with speed or temperature
        self.set_aside = False  # something had to wait
        self.effects = [effect for effect in CATALOGUE.values() if effect.untestable(facts) is None and effect.in_state]

    def run(self, base: Fit) -> Selection:
        """Add effects to the base until nothing more is asked for."""
        selection = Selection(base, base)
        current = base
        for turn in range(_MOST_TURNS):
            if turn > 0 and not self.work.has(self.share):
                self.work.leave_out(f"the search of {self.where} for more than {_said(current)}")
                break
            self.advance("searching the catalogue")
            contenders = self._contenders(current, selection)
            if not contenders:
                break
            added = self._best_fit(current, contenders, selection)
            if added is None:
                break
            fit, trial = added
            if trial.effect.local_in_time:
                fit = self._with_other_laws(fit, trial)
            current = self.pruned(fit, selection)
            if terms_in(current.model) == terms_in(selection.final.model):
                break
            selection.final = current
        return selection

    def _open(self, model: Model) -> list[type[Effect]]:
        """Effects that may still enter: a periodic one at another order or frequency, any other once."""
        present = set(model.effects.ids)
        full = len(present) >= _MOST_EFFECTS
        memories = sum(1 for term in model.terms if term.effect.flow_kind)
        return [
            effect
            for effect in self.effects
            if ((effect.id not in present and not full) or (effect.repeats and effect.id in present))
            and not (effect.flow_kind and memories)
        ]

    def _contenders(self, current: Fit, selection: Selection) -> list[Score]:
        """Scores that are significant and large enough, strongest first; all others are noted as not significant."""
        effects = self._open(current.model)
        anywhere = [effect for effect in effects if not effect.local_in_time]
        scores = self._scores(current, anywhere)
        local = [effect for effect in effects if effect.local_in_time]
        whole = self.on_whole(current) if local else current
        if local and not (self._asks_for_a_law(scores) and may_confound(whole, "time", "speed")):
            here = self._local_scores(whole, local)
            if any(self._significant(score) for score in here.values()):
                # Whatever else would explain the whole record better than an event in it goes first.
                everywhere = self._scores(whole, anywhere)
                best = max((s.statistic for s in everywhere.values()), default=0.0)
                here = {name: s for name, s in here.items() if s.statistic > best}
                if here:
                    scores = {name: s for name, s in scores.items() if not self._significant(s)}
            scores |= here
        for name, score in scores.items():
            if name not in selection.trials or selection.trials[name].statistic < score.statistic:
                selection.trials[name] = self._trial(score)
        strong = [score for score in scores.values() if self._significant(score)]
        strong = self._stationary_first(current, strong, selection)
        return sorted(strong, key=lambda score: -score.statistic)

    def _asks_for_a_law(self, scores: dict[str, Score]) -> bool:
        """Whether something that holds at any time is significant: where time goes with speed an event waits for it."""
        return any(self._significant(s) and quantity_of(s.hypothesis.effect) != "time" for s in scores.values())

    def _local_scores(self, whole: Fit, local: list[type[Effect]]) -> dict[str, Score]:
        """Scores of events; where time goes with speed, of what is left beside any smooth function of that."""
        if not may_confound(whole, "time", "speed"):
            return self._scores(whole, local)
        return scorer_beside(whole, self.prior, "speed").best_of_each(self.facts, local, lambda: None)

    def _stationary_first(self, current: Fit, strong: list[Score], selection: Selection) -> list[Score]:
        """Leave out what goes with time as long as the record cannot tell it from an effect of speed or temperature.

        That must be a contender, or in the model already: a law that holds at any time goes first.
        """
        if not self.stationary_first:
            return strong
        timed = [
            s for s in strong if quantity_of(s.hypothesis.effect) == "time" and not s.hypothesis.effect.local_in_time
        ]
        others: list[Quantity] = ["speed", "temperature"]
        for other in others:
            there = any(quantity_of(s.hypothesis.effect) == other for s in strong) or any(
                quantity_of(term.effect) == other for term in current.model.terms
            )
            if not (timed and there and may_confound(current, "time", other)):
                continue
            for score in list(timed):
                effect = score.hypothesis.effect
                if not says_more(current, self.prior, self.facts, effect, other, self._enough(effect)):
                    selection.trials[score.id].decision = f"nothing beside a smooth effect of the {other}"
                    self.set_aside = True
                    strong = [s for s in strong if s is not score]
                    timed.remove(score)
        return strong

    def _scores(self, fit: Fit, effects: list[type[Effect]]) -> dict[str, Score]:
        scorer = Scorer(fit.frame, self.prior, fit.noise.variance, fit.noise.ratio)
        return scorer.best_of_each(self.facts, effects, lambda: None)

    def on_whole(self, fit: Fit) -> Fit:
        """The same model fitted to the whole record, from where the fit part left it."""
        follows = fit.frame.record.follows
        reference = Reference.of_speed(
            np.where(follows, fit.reference.speed, self.seen.speed),
            np.where(follows, fit.reference.spread, self.seen.spread),
        )
        return fit_model(self.whole, fit.model, self.prior, reference, fit.noise, fit.omit, turns=8)

    def _enough(self, effect: type[Effect]) -> float:
        return min(LOCAL_P, self.enough) if effect.local_in_time else self.enough

    def _significant(self, score: Score) -> bool:
        """Whether a candidate deserves a fit; one that is not linear is scored by a secant, which may fall short."""
        effect = score.hypothesis.effect
        enough = self._enough(effect) if effect.linear else _WORTH_A_FIT_P
        return p_value(effect, score.statistic, self.facts) < enough and (
            not effect.linear or score.size >= effect.smallest(self.facts)
        )

    def _trial(self, score: Score) -> Trial:
        effect = score.hypothesis.effect
        return Trial(
            effect,
            score.statistic,
            p_value(effect, score.statistic, self.facts),
            score.size,
            float(np.linalg.norm(score.std)) * score.hypothesis.unit,
            (score.hypothesis.starts(score.coefficients)[0],),
        )

    def _best_fit(self, current: Fit, contenders: list[Score], selection: Selection) -> tuple[Fit, Trial] | None:
        """Fit the strongest few in full, each from its own start; the best that stands enters."""
        best: tuple[Fit, Trial] | None = None
        local = contenders[0].hypothesis.effect.local_in_time
        for score in contenders[:_TRIED]:
            if best is not None and not self.work.has(self.share):
                self.work.leave_out(f"a full fit of {score.id}")
                continue
            if score.hypothesis.effect.linear and score.statistic < _ALIAS_SHARE * contenders[0].statistic:
                continue
            self.advance(f"fitting {score.id}")
            effect = score.hypothesis.effect
            start = self.on_whole(current) if local else current
            place = self._zoomed(start, score) if local else score
            fits = [
                self.refitted(start, start.model.with_terms(term))
                for term in place.hypothesis.starts(place.coefficients)
            ]
            fit = self._from_other_side(start, max(fits, key=lambda item: item.likelihood.value), place)
            shape_std = _shape_std(fit, score.id) if local else {}
            if local:
                fit = self.refitted(current, fit.model.settled(score.id))
                statistic = score.statistic
            else:
                statistic = 2.0 * (fit.likelihood.value - current.likelihood.value)
            trial = replace(self._trial(score), statistic=statistic, shape_std=shape_std)
            trial.p_value = p_value(effect, statistic, self.facts)
            selection.trials[score.id] = trial
            if not local and trial.p_value >= self._enough(effect):
                continue
            if not (matters(fit.model, score.id, self.facts) and determined(fit, score.id)):
                trial.decision = TOO_SMALL
                continue
            if not possible(fit.model, score.id, self.facts):
                trial.decision = IMPOSSIBLE
                continue
            if best is None or statistic > best[1].statistic:
                best = fit, trial
        return best

    def _zoomed(self, fit: Fit, score: Score) -> Score:
        """The best place of an event near the one found, by ever finer steps: a fit follows its onset only so far."""
        scorer = Scorer(fit.frame, self.prior, fit.noise.variance, fit.noise.ratio)
        effect = score.hypothesis.effect
        best: Score | None = None
        at = score.hypothesis.candidate
        for turn in range(_ZOOMS):
            places = [(effect, candidate) for candidate in effect.nearby(at, turn, self.facts)]
            for group in hypotheses(fit.frame, places):
                best = max(
                    [*scorer.score(group), *([best] if best else [])], key=lambda item: item.statistic, default=None
                )
            if best is None:
                return score
            at = best.hypothesis.candidate
        return best if best is not None else score

    def _from_other_side(self, start: Fit, fit: Fit, score: Score) -> Fit:
        """The same, or a likelier fit along the path of the filter with the effect: near rest there are two valleys.

        Tried only where a fit has lost most of what a linear effect promised.
        """
        promised = 0.5 * score.statistic
        gained = fit.likelihood.value - start.likelihood.value
        model = start.model.with_terms(score.hypothesis.starts(score.coefficients)[0])
        if not score.hypothesis.effect.linear or model.effects.table().hidden or gained > _KEPT_SHARE * promised:
            return fit
        record = start.frame.record
        part = record.follows | np.append(record.follows[1:], False)
        noise = float(np.sqrt(start.noise.variance))
        path = smoothed_by_filter(record.course, part & ~start.omit, model, record.constants, noise)
        other = fit_model(record, model, self.prior, path, start.noise, start.omit)
        return max(fit, other, key=lambda item: item.likelihood.value)

    def _with_other_laws(self, fit: Fit, trial: Trial) -> Fit:
        """An event and the law beside it shape each other where time goes with speed: the likeliest pair of them.

        Only alternatives that a law itself names as such are tried in its place, each with the event sought anew.
        """
        whole = self.on_whole(fit)
        name = trial.effect.id
        if not may_confound(whole, "time", "speed"):
            return fit
        tried = []
        for model in [fit.model, *_others(fit.model, self.effects)]:
            less = fit_model(self.whole, model.without(name), self.prior, whole.reference, whole.noise, whole.omit)
            score = self._local_scores(less, [trial.effect]).get(name)
            if score is not None:
                term = self._zoomed(less, score).hypothesis.starts(score.coefficients)[0]
                tried.append(self.refitted(less, less.model.with_terms(term)))
        if not tried:
            return fit
        best = max(tried, key=lambda item: 2.0 * item.likelihood.value - _WORTH_A_LAW * len(item.model.effects.ids))
        trial.shape_std |= _shape_std(best, name)
        return self.refitted(fit, best.model.settled(name))

    def without(self, fit: Fit, name: str) -> Fit:
        """The same part fitted without one effect."""
        return self.refitted(fit, fit.model.without(name))

    def told(self, fit: Fit, name: str) -> Fit:
        """The same part fitted with an effect that is known to be there; unchanged where the log cannot show it."""
        effect = CATALOGUE[name]
        start = self.on_whole(fit) if effect.local_in_time else fit
        score = self._scores(start, [effect]).get(name)
        if score is None:
            return fit
        starts = score.hypothesis.starts(score.coefficients)
        fits = [self.refitted(start, start.model.with_terms(term)) for term in starts]
        best = max(fits, key=lambda item: item.likelihood.value)
        return self.refitted(fit, best.model.settled(name)) if effect.local_in_time else best

    def refitted(self, start: Fit, model: Model) -> Fit:
        """Another model fitted to the part of `start`, from where that one stands."""
        return fit_model(start.frame.record, model, self.prior, start.reference, start.noise, start.omit)

    def with_rivals(self, selection: Selection) -> None:
        """For each effect chosen, those that fit nearly as well in its place; all fitted in full."""
        final = selection.final
        for name in final.model.effects.ids:
            if name in selection.base.model.effects.ids or CATALOGUE[name].local_in_time:
                continue
            near = self._near(selection, name)
            if not near:
                continue
            if not self.work.has(max(work.RIVALS, self.share)):
                self.work.leave_out(f"rivals of {name} ({', '.join(effect.id for effect in near)})")
                continue
            self.advance(f"comparing rivals of {name}")
            less = self.without(final, name)
            scores = self._scores(less, near)
            value = final.model.of(name)[0].values[0]
            for effect in near:
                if not self.work.has(max(work.RIVALS, self.share)):
                    self.work.leave_out(f"rivals of {name} ({effect.id})")
                    continue
                score = scores.get(effect.id)
                starts = [] if score is None else score.hypothesis.starts(score.coefficients)
                if not effect.linear and effect.coefficient.unit == CATALOGUE[name].coefficient.unit:
                    starts.append(Term.at(effect, Candidate(value)))
                fits = [self.refitted(less, less.model.with_terms(term)) for term in starts]
                fits = [fit for fit in fits if possible(fit.model, effect.id, self.facts)]
                if not fits:
                    continue
                rival = max(fits, key=lambda item: item.likelihood.value)
                constructed = self._same_by_construction(less, final, rival, name, effect)
                if constructed:
                    selection.constructed.setdefault(name, set()).add(effect.id)
                if constructed or 2.0 * (final.likelihood.value - rival.likelihood.value) < _RIVAL_MARGIN:
                    selection.rivals.setdefault(name, []).append(rival)

    def _same_by_construction(self, less: Fit, final: Fit, rival: Fit, name: str, other: type[Effect]) -> bool:
        """Whether an effect of time does what the one chosen does, in a record that has them confounded."""
        mine, its = quantity_of(CATALOGUE[name]), quantity_of(other)
        if its != "time" or mine == "time" or not may_confound(less, mine, its):
            return False
        gained = final.likelihood.value - less.likelihood.value
        if rival.likelihood.value - less.likelihood.value < EXPLAINED_SHARE * gained:
            return False
        return not says_more(less, self.prior, self.facts, CATALOGUE[name], its, self.enough)

    def _near(self, selection: Selection, name: str) -> list[type[Effect]]:
        """Effects worth comparing with one that was chosen: known aliases, and those that scored half as much."""
        least = _ALIAS_SHARE * selection.trials[name].statistic
        strong = sorted(selection.trials.values(), key=lambda trial: -trial.statistic)
        names = [trial.effect.id for trial in strong if trial.statistic > least][:_TRIED]
        names += [other for other in CATALOGUE[name].confounded if not CATALOGUE[other].linear]
        present = set(selection.final.model.effects.ids)
        memory = any(term.effect.flow_kind for term in selection.final.model.terms if term.id != name)
        return [
            effect
            for effect in self.effects
            if effect.id in names
            and effect.id not in present
            and not effect.local_in_time
            and not (effect.flow_kind and memory)
        ]

    def pruned(self, fit: Fit, selection: Selection) -> Fit:
        """Leave out, one by one, what is no longer missed or no longer matters."""
        while len(fit.model.effects.ids) > 1:
            losses = []
            for name in fit.model.effects.ids:
                if CATALOGUE[name].local_in_time:
                    continue
                less = self.without(fit, name)
                statistic = 2.0 * (fit.likelihood.value - less.likelihood.value)
                losses.append((statistic, name, less))
            if not losses:
                break
            statistic, name, less = min(losses, key=lambda item: item[0])
            if p_value(CATALOGUE[name], statistic, self.facts) < self._enough(CATALOGUE[name]) and matters(
                fit.model, name, self.facts
            ):
                break
            rest = [other for other in fit.model.effects.ids if other != name]
            if name in selection.trials:  # else the model given had it
                selection.trials[name].decision = explained_by(rest)
            fit = less
        return fit


def _said(fit: Fit) -> str:
    return ", ".join(fit.model.effects.ids) or "the model"


def _others(model: Model, effects: list[type[Effect]]) -> list[Model]:
    """Models with one steady linear law in the place of one that is its known alias, beside it, and without either."""
    found = []
    for name in model.effects.ids:
        effect = CATALOGUE[name]
        if _steady(effect):
            found.append(model.without(name))
        for other in effects:
            if other.id not in effect.confounded or other.id in model.effects.ids:
                continue
            if _steady(effect) and _steady(other):
                added = Term.at(other, Candidate(0.0))
                found += [model.without(name).with_terms(added), model.with_terms(added)]
    return found


def _steady(effect: type[Effect]) -> bool:
    """Whether it is one linear law that holds at any time."""
    return effect.linear and effect.components == 1 and not effect.of_one_record


def _shape_std(fit: Fit, name: str) -> dict[str, float]:
    """Standard deviations of an effect's refined shape constants, by name."""
    refined = ((fit.model.terms[i], j, at) for at, (i, j) in enumerate(fit.model.refined, start=fit.model.known))
    return {term.effect.constants[j].name: float(fit.std[at]) for term, j, at in refined if term.id == name}
