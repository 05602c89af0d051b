"""What may enter a model next: effects scored beside it, and the strongest fitted in full.

A score ranks what is worth a fit and decides nothing; what a fit is worth is decided by the ledger (docs/likelihood.md,
"The ledger").
"""

from __future__ import annotations

from dataclasses import replace

from rw_ekf.diagnosis.hypotheses.candidates import Score, p_value, threshold
from rw_ekf.diagnosis.hypotheses.confounding import beside_motion, deferred, event_scores, may_confound, quantity_of
from rw_ekf.diagnosis.hypotheses.event import fitted_at, fitted_event, settled_event
from rw_ekf.diagnosis.hypotheses.other_starts import possible_fit
from rw_ekf.diagnosis.hypotheses.scorer import Scorer
from rw_ekf.diagnosis.hypotheses.selection import Selection, Trial
from rw_ekf.diagnosis.prepare.preparation import Advance
from rw_ekf.diagnosis.standing import Decision, Reason, explained_by
from rw_ekf.diagnosis.thresholds import MOST_EFFECTS, SIGNIFICANT_P, WORTH_A_FIT_P
from rw_ekf.effects.catalogue import CATALOGUE, STRIBECK
from rw_ekf.likelihood import work_budget
from rw_ekf.likelihood.fitting import ROOM_SIGMAS, Fit
from rw_ekf.likelihood.model_vector import Model
from rw_ekf.likelihood.one_step import Record
from rw_ekf.likelihood.open_stribeck import likeliest_stribeck_speed
from rw_ekf.model.effect import Effect, RecordFacts

_ANOTHER_WAY = 2.0  # log-likelihood that another path may still bring to what one path left below significance


class Search:
    """Finds and fits what a record may require beyond a model."""

    def __init__(
        self,
        record: Record,
        facts: RecordFacts,
        advance: Advance,
        *,
        stationary_first: bool = True,
    ) -> None:
        """All of the record is searched; what goes with time waits where time goes with speed or temperature."""
        self.work = record.work
        self.facts = facts
        self.advance = advance
        self.stationary_first = stationary_first
        self.effects = [effect for effect in CATALOGUE.values() if effect.untestable(facts) is None and effect.in_state]

    def with_open_speed(self, fit: Fit) -> Fit:
        """The fit at the likeliest Stribeck speed beside what it has, where nobody gave one."""
        if not self.facts.stribeck_is_open or STRIBECK.id in fit.model.effects.ids:
            return fit
        if not self.work.has(work_budget.SEARCH):
            self.work.leave_out(f"other Stribeck speeds beside {', '.join(fit.model.effects.ids)}")
            return fit
        return likeliest_stribeck_speed(fit, self.facts.top_speed_rad_s)

    def _open(self, model: Model) -> list[type[Effect]]:
        """Effects that may still enter: a periodic one at another order or frequency, any other once."""
        present = set(model.effects.ids)
        full, memory = len(present) >= MOST_EFFECTS, any(term.effect.flow_kind for term in model.terms)
        return [
            effect
            for effect in self.effects
            if ((effect.id not in present and not full) or (effect.repeats and effect.id in present))
            and not (effect.flow_kind and memory)
        ]

    def contenders(self, current: Fit, selection: Selection) -> tuple[list[Score], Selection]:
        """Scores that are significant and large enough, the strongest first; others are noted as not significant."""
        effects = self._open(current.model)
        anywhere = [effect for effect in effects if not effect.local_in_time]
        scores = Scorer(current).best_of_each(self.facts, anywhere)
        everything = dict(scores)
        local = [effect for effect in effects if effect.local_in_time]
        # Where time goes with speed an event waits for what holds at any time.
        laws = any(self._significant(s) and quantity_of(s.effect) != "time" for s in scores.values())
        if local and not (laws and may_confound(current, "time", "speed")):
            here = event_scores(current, local, self.facts)
            everything |= here
            if any(self._significant(score) for score in here.values()):
                # Whatever else is likelier than an event goes first: by its gain, since an event has many places to be.
                best = max((s.screening_gain for s in scores.values()), default=0.0)
                here = {name: s for name, s in here.items() if s.screening_gain > best}
                if here:
                    scores = {name: s for name, s in scores.items() if not self._significant(s)}
            scores |= here
        trials = dict(selection.trials)
        for name, score in everything.items():
            if name not in trials or trials[name].statistic < score.statistic:
                trials[name] = Trial.of(score)
        selection = replace(selection, trials=trials, searched=(*selection.searched, (current, everything)))
        strong = [score for score in scores.values() if self._significant(score)]
        waiting = deferred(current, strong, self.facts, SIGNIFICANT_P) if self.stationary_first else {}
        for name, other in waiting.items():
            selection = replace(selection.decided(name, Decision(Reason.WAITS, other)), set_aside=True)
        strong = [score for score in strong if score.effect.id not in waiting]
        for score in [score for score in strong if score.effect.clocked]:
            if beside_motion(current, self.facts, score) >= SIGNIFICANT_P:
                selection = selection.decided(score.effect.id, Decision(Reason.NOT_BESIDE_MOTION))
                strong.remove(score)
        return sorted(strong, key=lambda score: -score.screening_gain), selection

    def _significant(self, score: Score) -> bool:
        """Whether a candidate deserves a fit; one that is not linear is scored by a secant, which may fall short."""
        effect = score.effect
        enough = SIGNIFICANT_P if effect.linear else WORTH_A_FIT_P
        large = self.facts.any_size or score.size + ROOM_SIGMAS * score.std >= effect.smallest(self.facts)
        return score.p_value < enough and (large or not effect.linear)

    def fitted(self, current: Fit, score: Score, *, local: bool) -> tuple[Fit, float]:
        """A candidate fitted in full beside a model, and twice what the likelihood gains."""
        effect = score.effect
        if local:  # without it is a model with it
            return settled_event(current, score, self.facts), score.statistic
        needed = 0.5 * threshold(effect, self.facts)
        fit = fitted_at(current, score, needed - _ANOTHER_WAY)
        if not fit.model.possible(effect.id, self.facts):
            fit = possible_fit(current, fit, score, self.facts)
        return fit, max(2.0 * (fit.likelihood.value - current.likelihood.value), 0.0)

    def with_known(self, fit: Fit, name: str) -> Fit:
        """The record fitted with an effect that is known to be there; unchanged where the log cannot show it."""
        effect = CATALOGUE[name]
        score = Scorer(fit).best_of_each(self.facts, [effect]).get(name)
        if score is None:
            return fit
        return fitted_event(fit, score, self.facts) if effect.local_in_time else fitted_at(fit, score)

    def pruned(self, fit: Fit, selection: Selection) -> tuple[Fit, Selection]:
        """Leave out, one by one, what is no longer missed or no longer matters, down to one effect."""
        while len(fit.model.effects.ids) > 1:
            names = [name for name in fit.model.effects.ids if not CATALOGUE[name].local_in_time]
            if not names:
                break
            losses = [(*self.loss_without(fit, name), name) for name in names]
            statistic, less, name = min(losses, key=lambda item: item[0])
            missed = p_value(CATALOGUE[name], statistic, self.facts) < SIGNIFICANT_P
            if missed and fit.may_matter(name, self.facts):
                break
            if name in selection.trials:  # else the model given had it
                left = less.model.effects.ids
                selection = selection.decided(name, explained_by(*left) if left else Decision(Reason.NOT_SIGNIFICANT))
            fit = less
        return fit, selection

    def loss_without(self, fit: Fit, name: str) -> tuple[float, Fit]:
        """Twice what the log-likelihood loses when an effect is left out, and the fit without it."""
        less = self.without(fit, name)
        return 2.0 * (fit.likelihood.value - less.likelihood.value), less

    def without(self, fit: Fit, name: str) -> Fit:
        """The same without an effect; where nobody gave a Stribeck speed, the likeliest one by the base model's law."""
        if name != STRIBECK.id or not self.facts.stribeck_is_open:
            return fit.without(name)
        curve = fit.model.of(name)[0]
        if curve.shape[0] != self.facts.stribeck_law:
            by_base_law = replace(curve, shape=(float(self.facts.stribeck_law), 0.0, 0.0))
            fit = fit.refitted(fit.model.changed(curve, by_base_law))
        less, speed = fit.model.without(name), fit.model.of(name)[0].values[0]
        return fit.refitted(replace(less, stribeck=less.stribeck._replace(omega_s=speed)))
