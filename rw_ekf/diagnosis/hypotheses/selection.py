"""What a search holds: each effect's best candidate and what became of it, rivals, the model chosen."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from rw_ekf.diagnosis.hypotheses.candidates import Score, p_value
from rw_ekf.diagnosis.hypotheses.scorer import Scorer
from rw_ekf.diagnosis.standing import Decision, Reason
from rw_ekf.diagnosis.thresholds import INFLATION
from rw_ekf.filter.tails import chi_square_tail
from rw_ekf.likelihood.fitting import Fit
from rw_ekf.likelihood.model_vector import Model
from rw_ekf.model.effect import Effect, RecordFacts, Term

UNDECIDED = Decision(Reason.NOT_SIGNIFICANT)


@dataclass(frozen=True)
class Trial:
    """What became of one effect's best candidate."""

    effect: type[Effect]
    statistic: float  # in the turn that decided about it
    p_value: float
    screening_gain: float  # see Score
    size: float  # coefficient, or amplitude of sine and cosine
    std: float
    terms: tuple[Term, ...] = ()
    decision: Decision = UNDECIDED

    @classmethod
    def of(cls, score: Score) -> Trial:
        """A candidate that was only scored."""
        return cls(
            score.effect, score.statistic, score.p_value, score.screening_gain, score.size, score.std, score.starts[:1]
        )

    @classmethod
    def of_law(cls, term: Term, less: Fit, fit: Fit) -> Trial:
        """A law without a formula, fitted beside a model."""
        statistic = 2.0 * (fit.likelihood.value - less.likelihood.value)
        found = fit.model.of(term.id)[-1]
        p = chi_square_tail(max(statistic, 0.0) / INFLATION, len(term.values))
        size, std = fit.size_of(term.id)
        return cls(term.effect, statistic, p, 0.5 * statistic, size, std, (found,))

    def found_by(self, statistic: float, facts: RecordFacts) -> Trial:
        """The same, fitted in full."""
        gained = 0.5 * (statistic - self.statistic) / INFLATION
        p = p_value(self.effect, statistic, facts)
        return replace(self, statistic=statistic, p_value=p, screening_gain=self.screening_gain + gained)


@dataclass(frozen=True)
class Rival:
    """Another effect in the place of one that was chosen."""

    name: str
    fit: Fit
    ahead: float  # log of how much likelier than the one chosen
    constructed: bool = False  # the record has both as one: no likelihood decides


@dataclass(frozen=True)
class Selection:
    """What a search has found so far; each step of it makes another."""

    base: Fit
    final: Fit
    trials: Mapping[str, Trial] = field(default_factory=dict)
    rivals: Mapping[str, tuple[Rival, ...]] = field(default_factory=dict)  # by the id that was chosen
    searched: tuple[tuple[Fit, Mapping[str, Score]], ...] = ()  # scores beside each model of the search
    set_aside: bool = False  # something that goes with time had to wait

    def tried(self, trial: Trial) -> Selection:
        """With what became of one candidate."""
        return replace(self, trials={**self.trials, trial.effect.id: trial})

    def decided(self, name: str, decision: Decision, final: Fit | None = None) -> Selection:
        """With a decision about a candidate, and the model that it leads to, if that is another."""
        trials = {**self.trials, name: replace(self.trials[name], decision=decision)}
        return replace(self, trials=trials, final=self.final if final is None else final)

    def without(self, name: str) -> Fit:
        """The final model without an effect; the search may have fitted that already."""
        less = self.final.model.without(name)
        known = (
            fit for fit, _ in self.searched if _holds(fit.model) == _holds(less) and fit.model.stribeck == less.stribeck
        )
        return next(known, None) or self.final.refitted(less)

    def one_by_construction(self, name: str) -> frozenset[str]:
        """Rivals of an effect about which no likelihood decides."""
        return frozenset(rival.name for rival in self.rivals.get(name, ()) if rival.constructed)

    def scores_beside(self, fit: Fit, effects: list[type[Effect]], facts: RecordFacts) -> dict[str, Score]:
        """Scores of effects beside a model, taken from the search where it made them."""
        for known, scores in self.searched:
            if known is fit and not any(effect.local_in_time for effect in effects):
                return {effect.id: scores[effect.id] for effect in effects if effect.id in scores}
        return Scorer(fit).best_of_each(facts, effects)

    @property
    def new_ids(self) -> list[str]:
        """Effects of the final model that the base did not have."""
        return self.new_in(self.final)

    def new_in(self, fit: Fit) -> list[str]:
        """Effects of another fit's model that the base did not have."""
        return list(fit.model.effects.beyond(self.base.model.effects))


def _holds(model: Model) -> list[tuple[str, bool]]:
    """What is in a model, in its order: ids, and whether each was given."""
    return [(term.id, term.given) for term in model.effects.terms]
