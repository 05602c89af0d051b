"""What a search holds: each effect's best candidate and what became of it, rivals, the model chosen."""

from __future__ import annotations

from dataclasses import dataclass, field

from rw_ekf.diagnosis.search.candidates import Score
from rw_ekf.diagnosis.search.scorer import Scorer
from rw_ekf.diagnosis.standing import NOT_SIGNIFICANT
from rw_ekf.likelihood.fitting import Fit
from rw_ekf.model.effect import Effect, RecordFacts, Term


@dataclass
class Trial:
    """What became of one effect's best candidate."""

    effect: type[Effect]
    statistic: float  # in the turn that decided about it
    p_value: float
    evidence: float  # see Score
    size: float  # coefficient, or amplitude of sine and cosine
    std: float
    terms: tuple[Term, ...] = ()
    decision: str | tuple[str, ...] = NOT_SIGNIFICANT  # in words; or the effects that have all of its gain

    @classmethod
    def of(cls, score: Score) -> Trial:
        """A candidate that was only scored."""
        return cls(
            score.effect, score.statistic, score.p_value, score.evidence, score.size, score.std, score.starts[:1]
        )


@dataclass(frozen=True)
class Rival:
    """Another effect in the place of one that was chosen."""

    name: str
    fit: Fit
    evidence: float  # beyond that of the one chosen


@dataclass
class Selection:
    """The outcome of the search."""

    base: Fit
    final: Fit
    trials: dict[str, Trial] = field(default_factory=dict)
    rivals: dict[str, list[Rival]] = field(default_factory=dict)  # by the id that was chosen
    constructed: dict[str, set[str]] = field(default_factory=dict)  # chosen id -> rivals no likelihood decides about
    unjudged: list[str] = field(default_factory=list)  # chosen ids of which no held-out figure says anything
    searched: list[tuple[Fit, dict[str, Score]]] = field(default_factory=list)  # beside each model of the search

    def without(self, name: str) -> Fit:
        """The final model without an effect; the search may have fitted that already."""
        ids, stribeck = [item for item in self.final.model.effects.ids if item != name], self.final.model.stribeck
        known = (
            fit for fit, _ in self.searched if list(fit.model.effects.ids) == ids and fit.model.stribeck == stribeck
        )
        return next(known, None) or self.final.without(name)

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
        before = set(self.base.model.effects.ids)
        return [name for name in fit.model.effects.ids if name not in before]
