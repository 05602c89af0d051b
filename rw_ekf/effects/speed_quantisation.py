"""A speed reading on a grid coarser than its noise."""

from __future__ import annotations

from rw_ekf.model.effect import Candidate, Coefficient, RecordFacts, Shape
from rw_ekf.model.effect_kinds import ReadingEffect
from rw_ekf.numbers import plus_minus
from rw_ekf.units import rpm_from_rad_s


class SpeedQuantisation(ReadingEffect):
    """y = a round((omega + noise)/a); the rounding error is spread evenly over one grid step."""

    id = "speed_quantisation"
    equation = "y = a round((omega + noise)/a)"
    source = "Widrow & Kollar 2008, uniform quantisation noise"
    coefficient = Coefficient("grid_rad_s", "rad/s", 0.0, 1.0e6, "distance between neighbouring readings")
    excitation = "none: the values themselves show it, once they change"

    @staticmethod
    def smallest(facts: RecordFacts) -> float:
        """The noise: a finer grid than that is lost in it."""
        return facts.speed_noise_rad_s

    @staticmethod
    def largest(facts: RecordFacts) -> float:
        """The top speed: a grid coarser than that reads nothing."""
        return max(facts.top_speed_rad_s, facts.speed_noise_rad_s)

    @staticmethod
    def candidates(facts: RecordFacts) -> list[Candidate]:
        """One to sqrt(12) times the noise, which is then all of the grid's making."""
        return [Candidate(facts.speed_noise_rad_s * ratio) for ratio in (1.0, 2.0, 3.4641)]

    @staticmethod
    def variance(a: float) -> float:
        """a^2/12, the variance of an even spread over a."""
        return a * a / 12.0

    @staticmethod
    def sentence(value: float, std: float, shape: Shape, facts: RecordFacts) -> str:
        """In both units of speed: no other quantity is as near to the telemetry's own."""
        return f"Speed readings lie on a grid of {plus_minus(value, std)} rad/s ({rpm_from_rad_s(value):.4g} rpm)"
