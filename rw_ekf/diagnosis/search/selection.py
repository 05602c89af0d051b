"""Effects enter and leave a model by likelihood, jointly (docs/diagnosis.md, "Selection").

In every turn the best place of each effect is scored beside all that the model has; the strongest few are fitted in
full, shapes and all, and the best fit enters. Then each effect already in the model must still be missed when it is
left out, or goes: an offset that vanishes once viscous friction is split by direction explained nothing.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from rw_ekf.diagnosis.search.candidates import Score
from rw_ekf.diagnosis.search.confounding import may_confound, quantity_of, scorer_beside, stationary_first
from rw_ekf.diagnosis.search.event import shape_std_of, with_other_laws, zoomed
from rw_ekf.diagnosis.search.scorer import Scorer
from rw_ekf.diagnosis.search.trial import (
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
from rw_ekf.likelihood.model import Model
from rw_ekf.likelihood.one_step import Record, Reference
from rw_ekf.likelihood.robust_fit import smoothed_by_filter
from rw_ekf.model.effect import Effect, RecordFacts

_MOST_EFFECTS, _MOST_TURNS = 4, 7  # a periodic effect may have several lines
MOST_TRIED = 3  # strongest candidates that are fitted in full in each turn
_WORTH_A_FIT_P = 1.0e-2
_KEPT_SHARE = 0.5  # of the gain that a regression promised: a fit with less went astray
ALIAS_SHARE = 0.5  # of the best statistic: a candidate with less is no rival


class Search:
    """Finds the effects that a part of a record asks for."""

    def __init__(
        self,
        whole: Record,
        seen: Reference,
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
        self.whole = whole
        self.seen = seen
        self.enough = enough
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
                where = "the whole record" if base.frame.record is self.whole else "the part that is searched"
                self.work.leave_out(f"the search of {where} for more than {_said(current)}")
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
                fit = with_other_laws(self, fit, trial)
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
        scores = self.scores(current, anywhere)
        local = [effect for effect in effects if effect.local_in_time]
        whole = current.widened(self.whole, self.seen) if local else current
        if local and not (self._asks_for_a_law(scores) and may_confound(whole, "time", "speed")):
            here = self.event_scores(whole, local)
            if any(self._significant(score) for score in here.values()):
                # Whatever else would explain the whole record better than an event in it goes first.
                everywhere = self.scores(whole, anywhere)
                best = max((s.statistic for s in everywhere.values()), default=0.0)
                here = {name: s for name, s in here.items() if s.statistic > best}
                if here:
                    scores = {name: s for name, s in scores.items() if not self._significant(s)}
            scores |= here
        for name, score in scores.items():
            if name not in selection.trials or selection.trials[name].statistic < score.statistic:
                selection.trials[name] = self._trial(score)
        strong = [score for score in scores.values() if self._significant(score)]
        strong = stationary_first(self, current, strong, selection) if self.stationary_first else strong
        return sorted(strong, key=lambda score: -score.statistic)

    def _asks_for_a_law(self, scores: dict[str, Score]) -> bool:
        """Whether something that holds at any time is significant: where time goes with speed an event waits for it."""
        return any(self._significant(s) and quantity_of(s.hypothesis.effect) != "time" for s in scores.values())

    def event_scores(self, whole: Fit, local: list[type[Effect]]) -> dict[str, Score]:
        """Scores of events; where time goes with speed, of what is left beside any smooth function of that."""
        if not may_confound(whole, "time", "speed"):
            return self.scores(whole, local)
        return scorer_beside(whole, "speed").best_of_each(self.facts, local, lambda: None)

    def scores(self, fit: Fit, effects: list[type[Effect]]) -> dict[str, Score]:
        """The best place of each effect beside all that a fitted model has."""
        return Scorer(fit).best_of_each(self.facts, effects, lambda: None)

    def enough_for(self, effect: type[Effect]) -> float:
        """The p-value at which an effect may enter."""
        return min(LOCAL_P, self.enough) if effect.local_in_time else self.enough

    def _significant(self, score: Score) -> bool:
        """Whether a candidate deserves a fit; one that is not linear is scored by a secant, which may fall short."""
        effect = score.hypothesis.effect
        enough = self.enough_for(effect) if effect.linear else _WORTH_A_FIT_P
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
        for score in contenders[:MOST_TRIED]:
            if best is not None and not self.work.has(self.share):
                self.work.leave_out(f"a full fit of {score.id}")
                continue
            if score.hypothesis.effect.linear and score.statistic < ALIAS_SHARE * contenders[0].statistic:
                continue
            self.advance(f"fitting {score.id}")
            effect = score.hypothesis.effect
            start = current.widened(self.whole, self.seen) if local else current
            place = zoomed(start, score, self.facts) if local else score
            fits = [
                start.refitted(start.model.with_terms(term)) for term in place.hypothesis.starts(place.coefficients)
            ]
            fit = self._from_other_side(start, max(fits, key=lambda item: item.likelihood.value), place)
            shape_std = shape_std_of(fit, score.id) if local else {}
            if local:
                fit = current.refitted(fit.model.settled(score.id))
                statistic = score.statistic
            else:
                statistic = 2.0 * (fit.likelihood.value - current.likelihood.value)
            trial = replace(self._trial(score), statistic=statistic, shape_std=shape_std)
            trial.p_value = p_value(effect, statistic, self.facts)
            selection.trials[score.id] = trial
            if not local and trial.p_value >= self.enough_for(effect):
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
        other = fit_model(record, model, start.prior, path, start.noise, start.omit)
        return max(fit, other, key=lambda item: item.likelihood.value)

    def told(self, fit: Fit, name: str) -> Fit:
        """The same part fitted with an effect that is known to be there; unchanged where the log cannot show it."""
        effect = CATALOGUE[name]
        start = fit.widened(self.whole, self.seen) if effect.local_in_time else fit
        score = self.scores(start, [effect]).get(name)
        if score is None:
            return fit
        starts = score.hypothesis.starts(score.coefficients)
        fits = [start.refitted(start.model.with_terms(term)) for term in starts]
        best = max(fits, key=lambda item: item.likelihood.value)
        return fit.refitted(best.model.settled(name)) if effect.local_in_time else best

    def pruned(self, fit: Fit, selection: Selection) -> Fit:
        """Leave out, one by one, what is no longer missed or no longer matters."""
        while len(fit.model.effects.ids) > 1:
            losses = []
            for name in fit.model.effects.ids:
                if CATALOGUE[name].local_in_time:
                    continue
                less = fit.without(name)
                statistic = 2.0 * (fit.likelihood.value - less.likelihood.value)
                losses.append((statistic, name, less))
            if not losses:
                break
            statistic, name, less = min(losses, key=lambda item: item[0])
            if p_value(CATALOGUE[name], statistic, self.facts) < self.enough_for(CATALOGUE[name]) and matters(
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
