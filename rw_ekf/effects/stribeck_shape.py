"""Another Stribeck curve than the configured one: another speed, or another law."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import ClassVar

from rw_ekf.effects.measures import STEADY_SHARE, dry_scale, lacks_slow_motion
from rw_ekf.model.effect import Candidate, Coefficient, RecordFacts, Shape, Term, size_of
from rw_ekf.model.effect_kinds import StribeckEffect
from rw_ekf.model.friction import LAW_CODES
from rw_ekf.numbers import plus_minus
from rw_ekf.units import rpm_from_rad_s

_LAW_NAMES = {code: name for name, code in LAW_CODES.items()}
# 0.1 m/s, the highest that is reported (Armstrong-Helouvry, Dupont & Canudas de Wit 1994, table 2), at 5 mm of radius.
_LATEST_FILM_RAD_S = 20.0
_LARGEST_SLOPE = 2.0 / math.e  # of Gauss's g by the logarithm of omega_s, at |omega| = omega_s


class StribeckShape(StribeckEffect):
    """omega_s = a, and g Gauss, Tustin or Lorentz, in place of the configured ones.

    The coefficient replaces, it does not add: "no effect" is the configured speed, not 0. Another speed and another law
    can stand for each other; only dwells at half to five Stribeck speeds distinguish them.
    """

    id = "stribeck_shape"
    equation = "f = sgn(omega) (s - c) [g(|omega|/a) - g_0(|omega|/omega_s)]"
    source = "[CK13 (1)], [F12, introduction]"
    coefficient = Coefficient("speed_rad_s", "rad/s", 1.0e-9, 1.0e6, "Stribeck speed, in place of the configured one")
    constants = (Coefficient("law", "", 0.0, 2.0, "code of the law: 0 gauss, 1 tustin, 2 lorentz", whole=True),)
    lacking = (lacks_slow_motion,)
    excitation = "dwells at half to five Stribeck speeds (2 to 20 rpm of a wheel): `rw-ekf excite identification`"
    confounded: ClassVar[dict[str, str]] = {
        "presliding_hysteresis": "dwells at half to five Stribeck speeds without reversal: a bristle is at rest there",
        "friction_lag": "dwells at half to five Stribeck speeds without reversal: a lag has settled there",
    }

    @staticmethod
    def smallest(facts: RecordFacts) -> float:
        """Smallest difference to the configured speed: half a percent of Coulomb friction where it shows most."""
        peak = max(abs(facts.friction.static - facts.friction.coulomb), 1.0e-12)
        logarithm = STEADY_SHARE * dry_scale(facts) / (_LARGEST_SLOPE * peak)
        return facts.stribeck_speed_rad_s * math.expm1(min(max(logarithm, 0.1), 2.3))

    @staticmethod
    def largest(facts: RecordFacts) -> float:
        """Half the top speed, where no bearing's film forms so late: what continues beyond is a law of the speed."""
        return max(min(0.5 * facts.top_speed_rad_s, _LATEST_FILM_RAD_S), facts.stribeck_speed_rad_s)

    @staticmethod
    def candidates(facts: RecordFacts) -> list[Candidate]:
        """A third to ten times the configured speed under the configured law, half to twice it under the others."""
        speed = facts.stribeck_speed_rad_s
        found = [
            Candidate(speed * ratio, (float(facts.stribeck_law), 0.0, 0.0)) for ratio in (0.3, 0.6, 1.7, 3.0, 5.0, 10.0)
        ]
        others = (law for law in sorted(_LAW_NAMES) if law != facts.stribeck_law)
        return found + [Candidate(speed * ratio, (float(law), 0.0, 0.0)) for law in others for ratio in (0.5, 1.0, 2.0)]

    @classmethod
    def matters(cls, terms: Sequence[Term], facts: RecordFacts) -> bool:
        """Another law, or a speed that differs enough from the configured one."""
        other_law = any(term.shape[0] != facts.stribeck_law for term in terms)
        return other_law or abs(terms[0].values[0] - facts.stribeck_speed_rad_s) >= cls.smallest(facts)

    @classmethod
    def possible(cls, terms: Sequence[Term], facts: RecordFacts, coulomb: float) -> bool:
        """Within what the record can show: dry friction alone must not cross the curve within a sample either."""
        return super().possible(terms, facts, coulomb) and size_of(terms) >= dry_scale(facts) * facts.period_s

    @classmethod
    def starts(cls, candidate: Candidate, found: float) -> list[Candidate]:
        """Every law: they are near each other, so that each deserves a fit."""
        return [candidate._replace(shape=(float(law), 0.0, 0.0)) for law in sorted(_LAW_NAMES)]

    @staticmethod
    def sentence(value: float, std: float, shape: Shape, facts: RecordFacts) -> str:
        """In multiples of the configured speed, where one was."""
        law = int(shape[0])
        how = "" if law == facts.stribeck_law else f", by {_LAW_NAMES[law].capitalize()}'s law"
        if facts.stribeck_is_open:
            return f"Break-away friction fades at {plus_minus(value, std)} rad/s ({rpm_from_rad_s(value):.3g} rpm){how}"
        base = max(facts.stribeck_speed_rad_s, 1.0e-12)
        times = plus_minus(value / base, std / base)
        return f"Break-away friction fades at {times} times the configured Stribeck speed{how}"

    @classmethod
    def described(cls, value: float, std: float, shape: Shape) -> dict[str, dict[str, float | str | None]]:
        """The law by its name."""
        found = super().described(value, std, shape)
        found["law"] = {"value": _LAW_NAMES[int(shape[0])], "std": None, "unit": ""}
        return found
