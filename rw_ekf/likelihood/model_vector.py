"""The model under diagnosis as one vector: four parameters, coefficients of effects, and shapes that are refined."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from rw_ekf.arrays import Float64Array
from rw_ekf.filter.belief import Belief
from rw_ekf.model.effect import Effect, RecordFacts, Shape, Term
from rw_ekf.model.effect_kinds import StribeckEffect
from rw_ekf.model.friction import Stribeck
from rw_ekf.model.law import Law
from rw_ekf.model.state import MOTOR_GAIN, PARAMETER_COUNT, STATE_SIZE, FrictionParameters
from rw_ekf.wheel.effect_table import ABSENT, NO_EFFECTS, EffectSet


@dataclass(frozen=True)
class Model:
    """Parameters and effects with their values; stribeck is the base's."""

    parameters: FrictionParameters
    stribeck: Stribeck
    effects: EffectSet = NO_EFFECTS

    @property
    def terms(self) -> tuple[Term, ...]:
        """The effects whose coefficients are states."""
        return self.effects.state_terms

    @property
    def placed(self) -> list[tuple[Term, slice]]:
        """Those, each with the place of its coefficients in the vector."""
        found, at = [], PARAMETER_COUNT
        for term in self.terms:
            found.append((term, slice(at, at + len(term.values))))
            at += len(term.values)
        return found

    @property
    def with_laws_as_curves(self) -> Model:
        """The same, its laws as the curves that they are: for a pass that learns nothing."""
        return replace(self, effects=self.effects.with_laws_as_curves())

    @property
    def known(self) -> int:
        """Number of parameters and coefficients, which come before the refined shapes."""
        return PARAMETER_COUNT + self.effects.size

    @property
    def sought_laws(self) -> list[Law]:
        """Its laws whose coefficients are found here, not those that are known from elsewhere."""
        return [term.law for term in self.terms if term.law is not None and term.law.prior_std]

    @property
    def has_memory(self) -> bool:
        """Whether it has a friction with a memory."""
        return self.effects.table().memory_state_at != ABSENT

    @property
    def coefficients(self) -> Float64Array:
        """Parameters, then coefficients: (4 + m,)."""
        return np.array([*self.parameters, *self.effects.values])

    @property
    def refined(self) -> list[tuple[int, int]]:
        """(term, constant) of every shape constant that is fitted with the rest."""
        return [(i, constant) for i, term in enumerate(self.terms) if not term.settled for constant in term.refined]

    @property
    def vector(self) -> Float64Array:
        """Everything that is fitted: parameters, coefficients, refined shapes."""
        return np.concatenate((self.coefficients, [self.terms[i].shape[j] for i, j in self.refined]))

    def with_vector(self, vector: Float64Array) -> Model:
        """The same model with other numbers, each kept within its bounds."""
        terms = []
        for term, at in self.placed:
            limits = term.effect.coefficient
            terms.append(replace(term, values=tuple(np.clip(vector[at], limits.lower, limits.upper).tolist())))
        for (i, j), value in zip(self.refined, vector[self.known :], strict=True):
            limits = terms[i].effect.constants[j]
            number = float(np.clip(value, limits.lower, limits.upper))
            terms[i] = replace(terms[i], shape=_with(terms[i].shape, j, number))
        rest = [term for term in self.effects.terms if not term.effect.in_state]
        parameters = FrictionParameters(*(float(v) for v in vector[:PARAMETER_COUNT]))
        return replace(self, parameters=parameters, effects=EffectSet((*terms, *rest)))

    def limited(self, step: Float64Array) -> Float64Array:
        """A step (p,) no longer than the linearisation carries: shapes and coefficients that are not linear."""
        out = step.copy()
        for term, at in self.placed:
            if not term.effect.linear:
                carries = 0.7 * np.abs(term.values)
                out[at] = np.clip(out[at], -carries, 2.0 * carries)
        for place, (i, j) in enumerate(self.refined, start=self.known):
            reach = self.terms[i].effect.constants[j].reach_at(self.terms[i].shape[j])
            out[place] = float(np.clip(out[place], -reach, reach))
        return out

    def numbers_of(self, effect_id: str) -> list[int]:
        """Which of the terms are of one effect, as `EffectSet.of` has them."""
        own = {id(term) for term in self.effects.of(effect_id)}
        return [number for number, term in enumerate(self.terms) if id(term) in own]

    def of(self, effect_id: str) -> list[Term]:
        """The same terms."""
        return [self.terms[number] for number in self.numbers_of(effect_id)]

    def placed_of(self, effect_id: str) -> list[tuple[Term, slice]]:
        """The same, each with its place in the vector."""
        placed = list(self.placed)
        return [placed[number] for number in self.numbers_of(effect_id)]

    def matters(self, effect_id: str, facts: RecordFacts) -> bool:
        """Whether an effect in the model is large enough to matter in practice."""
        terms = self.of(effect_id)
        return bool(terms) and (facts.any_size or terms[0].effect.matters(terms, self.seen_by(terms[0].effect, facts)))

    def seen_by(self, effect: type[Effect], facts: RecordFacts) -> RecordFacts:
        """What a record offers an effect of this model: where nobody gave a Stribeck speed, at the model's own.

        A Stribeck curve itself is measured by the base model's.
        """
        if not facts.stribeck_is_open or issubclass(effect, StribeckEffect):
            return facts
        own = [term.values[0] for term in self.terms if issubclass(term.effect, StribeckEffect)]
        return replace(facts, stribeck_speed_rad_s=own[0] if own else self.stribeck.omega_s)

    def possible(self, effect_id: str, facts: RecordFacts) -> bool:
        """Whether an effect in the model has a size and shape that a machine can have."""
        terms = self.of(effect_id)
        return not terms or terms[0].effect.possible(terms, facts, self.parameters.coulomb)

    def with_terms(self, *added: Term) -> Model:
        """The same model with more effects."""
        return replace(self, effects=EffectSet((*self.effects.terms, *added)))

    def without(self, effect_id: str) -> Model:
        """The same model without the terms of one effect, as `EffectSet.of` has them."""
        gone = {id(term) for term in self.effects.of(effect_id)}
        return replace(self, effects=EffectSet(tuple(t for t in self.effects.terms if id(t) not in gone)))

    def changed(self, term: Term, other: Term) -> Model:
        """The same model with another term in the place of one that it has."""
        terms = tuple(other if item is term else item for item in self.effects.terms)
        return replace(self, effects=replace(self.effects, terms=terms))

    def settled(self, effect_id: str) -> Model:
        """The same model, the shapes of one effect no longer refined."""
        terms = tuple(replace(t, settled=True) if t.id == effect_id else t for t in self.effects.terms)
        return replace(self, effects=EffectSet(terms))

    def with_found_laws(self, effect_id: str) -> Model:
        """The same model, nothing known beforehand of the coefficients of one effect's laws."""
        terms = (
            t if t.id != effect_id or t.law is None else replace(t, law=replace(t.law, prior_std=()))
            for t in self.effects.terms
        )
        return replace(self, effects=EffectSet(tuple(terms)))

    @property
    def base(self) -> Model:
        """The same without any effect."""
        return replace(self, effects=NO_EFFECTS)


def prior_rows(prior: Belief, model: Model) -> tuple[Float64Array, Float64Array]:
    """What an a priori says of a model's vector x (p,) as W x = aim, each row of unit variance: W (k, p), aim (k,).

    Coefficients are found by the effect they belong to, several of one in their order; those of effects that the model
    has not are left out. Those of a law that is still to be found have its own.
    """
    found_elsewhere = [(term, at) for term, at in model.placed if term.law is None or not term.law.prior_std]
    unmatched = [(place, term.id) for term, at in found_elsewhere for place in range(at.start, at.stop)]
    states, places = list(range(MOTOR_GAIN, STATE_SIZE)), list(range(PARAMETER_COUNT))
    for state, effect_id in enumerate(prior.effect_ids, start=STATE_SIZE):
        found = next((item for item in unmatched if item[1] == effect_id), None)
        if found is not None:
            unmatched.remove(found)
            states.append(state)
            places.append(found[0])
    root = np.linalg.cholesky(np.linalg.inv(prior.covariance[np.ix_(states, states)])).T
    laws = [(term.law.prior_std, at) for term, at in model.placed if term.law is not None and term.law.prior_std]
    rows = np.zeros((len(states) + sum(len(stds) for stds, _ in laws), model.vector.size))
    rows[: len(states), places] = root
    row = len(states)
    for stds, at in laws:
        rows[row : row + len(stds), at] = np.diag(1.0 / np.array(stds))
        row += len(stds)
    return rows, np.concatenate((root @ prior.mean[states], np.zeros(row - len(states))))


def _with(shape: Shape, at: int, value: float) -> Shape:
    changed = list(shape)
    changed[at] = value
    return (changed[0], changed[1], changed[2])
