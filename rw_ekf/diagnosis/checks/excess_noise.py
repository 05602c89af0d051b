"""What noise had to swallow: a fit pays for what a model lacks in noise, of the torque or of the readings.

Where that is more than wheels have, or not the same everywhere, or not a normal noise at all, it is a finding, and not
a size that a person passes over (docs/likelihood.md, "What noise swallows").
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from rw_ekf.diagnosis.checks.residual_tests import left_over
from rw_ekf.diagnosis.checks.uneven_noise import NoiseFinding, noise_findings
from rw_ekf.diagnosis.thresholds import BEYOND_DOUBT_P, FAR_OFF, USUAL_TORQUE_NOISE
from rw_ekf.filter.tails import chi_square_tail, poisson_tail
from rw_ekf.likelihood.fitting import Fit
from rw_ekf.likelihood.model_vector import prior_rows
from rw_ekf.likelihood.profile import at_ratio
from rw_ekf.model.effect import RecordFacts
from rw_ekf.numbers import number_text, p_text
from rw_ekf.units import rpm_from_rad_s

_SIDED_P = 1.0e-3  # that readings far off lie so much more on one side
_UNEVEN = 1.4  # times: readings with long tails are not as even as draws of normal noise


class Swallowed(NamedTuple):
    """One thing that the noise of a fit may hide."""

    sentence: str
    p_value: float  # that noise as it should be looks so
    is_else: bool  # something else than the model is behind it: not readings with long tails, which are harmless


class Noises(NamedTuple):
    """What was found of a fit's noises."""

    torque: NoiseFinding | None  # where its noise is larger than elsewhere
    readings: NoiseFinding | None
    reported: tuple[Swallowed, ...]
    excess: Swallowed | None = None  # of the torque's noise throughout, beyond what wheels have

    @property
    def torque_p_value(self) -> float:
        """That noise of the torque, as it should be, looks so: larger in places, or throughout; 1 where it does."""
        return min((item.p_value for item in (self.torque, self.excess) if item is not None), default=1.0)

    @property
    def sentence(self) -> str | None:
        """All of it, in subclauses; None where there is nothing."""
        return "; and ".join(item.sentence for item in self.reported) or None

    @property
    def p_value(self) -> float:
        """The smallest of what something else is behind; 1 where nothing is."""
        return min((item.p_value for item in self.reported if item.is_else), default=1.0)


NOTHING = Noises(None, None, ())


def noises_of(fit: Fit, facts: RecordFacts, *, in_rpm: bool) -> Noises:
    """What the noises of a fit show."""
    uneven = noise_findings(fit, facts)
    torque, readings = uneven.get("torque"), uneven.get("readings")
    tails = _tails(fit)
    if tails is not None and readings is not None and readings.inside < _UNEVEN * readings.elsewhere:
        readings = None
    reported = [Swallowed(item.sentence(in_rpm=in_rpm), item.p_value, True) for item in (torque, readings) if item]
    if readings is not None and tails is not None and not tails.is_else:
        tails = None  # noises of two sizes have long tails when they are taken for one
    excess = _torque(fit, in_rpm=in_rpm)
    return Noises(torque, readings, (*reported, *(item for item in (tails, excess) if item is not None)), excess)


def _torque(fit: Fit, *, in_rpm: bool) -> Swallowed | None:
    """A torque noise that is many times a wheel's, where the record is much less likely with what wheels have."""
    record, noise = fit.linearised.record, fit.noise
    usual = record.torque_noise
    if usual is None:
        return None
    density = noise.ratio * noise.variance / record.period_s
    times = math.sqrt(density) / usual.scale
    if times < USUAL_TORQUE_NOISE:
        return None
    known = None if fit.prior is None else prior_rows(fit.prior, fit.model)
    ratio = noise.ratio * (USUAL_TORQUE_NOISE / times) ** 2
    lost = fit.likelihood.restricted - at_ratio(fit.linearised, known, noise.variance, ratio).restricted
    p = chi_square_tail(max(2.0 * lost, 0.0), 1)
    if p >= BEYOND_DOUBT_P:
        return None
    moved = rpm_from_rad_s(math.sqrt(density)) if in_rpm else math.sqrt(density)
    return Swallowed(
        f"torque noise moves the speed by {number_text(moved, 2)} {'rpm' if in_rpm else 'rad/s (or m/s)'} in a second, "
        f"{times:.0f} times what a wheel's usually does ({p_text(p)}): a torque that comes and goes or a "
        "friction that jumps, may hide in it; a long record at one speed would show it as steps",
        p, True,
    )  # fmt: skip


def _tails(fit: Fit) -> Swallowed | None:
    """Readings that lie further off than normal noise ever does, all to one side (lost counts) or to both."""
    white = left_over(fit)
    known = np.isfinite(white)
    far = known & (np.abs(np.where(known, white, 0.0)) > FAR_OFF)
    count = int(far.sum())
    p = poisson_tail(count, int(known.sum()) * math.erfc(FAR_OFF / math.sqrt(2.0)))
    if p >= BEYOND_DOUBT_P:
        return None
    ahead = float(np.mean(white[far] * fit.trajectory.speed[far] > 0.0))
    share = 100.0 * count / int(known.sum())
    words = f"{number_text(share, 2)} % of the readings lie further than {FAR_OFF:g} sigma off ({p_text(p)})"
    if 2.0 * math.exp(-2.0 * count * (ahead - 0.5) ** 2) >= _SIDED_P:  # Hoeffding's bound on even odds
        return Swallowed(f"{words}, on either side: their noise has long tails, and no sigma tells it whole", p, False)
    way = "ahead of" if ahead > 0.5 else "behind"
    return Swallowed(
        f"{words}, nearly all {way} the motion: counts {'read twice' if ahead > 0.5 else 'lost'}, or a torque that "
        "lasts less than a sample; the encoder's raw counts would show which",
        p, True,
    )  # fmt: skip
