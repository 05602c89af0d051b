"""Are the noises the same everywhere? What a fit calls noise may be structure (docs/likelihood.md).

A model that lacks something narrow pays in process noise, and is then adequate. What gives it away is that the noise is
larger where the structure is. So the noise in many windows of speed, of current and in either direction is compared
with that of all the rest, by the slope of the likelihood with respect to a variance of the window's own; and so is the
readings' noise. What noise alone does to these slopes is drawn from the fit itself.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import islice
from typing import Any, Literal

import numpy as np

from rw_ekf.arrays import BoolArray, Float64Array
from rw_ekf.diagnosis.checks.residual_tests import left_over
from rw_ekf.diagnosis.thresholds import NOISE_P
from rw_ekf.filter.consistency import skewed_tail
from rw_ekf.likelihood.fitting import Fit
from rw_ekf.likelihood.profile import LEAST_RATIO
from rw_ekf.likelihood.structure import where_begun
from rw_ekf.likelihood.whitening import adjoint
from rw_ekf.likelihood.work_budget import whitening_units
from rw_ekf.model.effect import RecordFacts
from rw_ekf.model.friction import FAST_STRIBECK_SPEEDS
from rw_ekf.numbers import number_text, p_text
from rw_ekf.units import RAD_S_PER_RPM

Along = Literal["speed", "current", "direction"]
Source = Literal["torque", "readings"]
_SOURCES: tuple[Source, ...] = ("torque", "readings")

_FEW, _DRAWS = 100, 400
_WORTH_MORE = 0.01  # p by few draws: for a finding to have more their spread would have to be wrong by a half
_AT = 0.05  # level at which the draws themselves show how many windows are independent
_WIDTH, _STEP = 1.6, 1.25  # a window of speeds ends at so many times its beginning; the next begins so much further
_OF_TOP_SPEED = ((0.0, 0.25), (0.25, 0.5), (0.5, 0.75), (0.75, 1.1), (0.0, 0.5), (0.25, 0.75), (0.5, 1.1))
_OF_TOP_CURRENT = ((0.0, 0.1), (0.1, 0.25), (0.25, 0.5), (0.25, 1.1), (0.5, 1.1))
_LEAST_SHARE, _MOST_SHARE = 0.01, 0.7  # of the intervals that are compared at all
_LEAST_INTERVALS = 200
_SEED = 20261
_HARDLY = 10.0  # times larger than elsewhere: there it is as good as none


@dataclass(eq=False, frozen=True)
class Window:
    """Intervals whose noise is compared with that of the rest."""

    along: Along
    low: float  # of |speed| [rad/s] or |current| [A]; of a direction -1 or 1
    high: float
    inside: BoolArray  # (n,)


@dataclass(frozen=True)
class NoiseFinding:
    """A window in which torque noise, or that of the readings, is larger than elsewhere."""

    along: Along
    low: float
    high: float
    inside: float  # what it moves the speed by there, rad/s per sqrt(s); of readings rad/s
    elsewhere: float
    p_value: float  # that noise alone looks so in any of the windows
    source: Source = "torque"

    @property
    def times(self) -> float | None:
        """How much larger; None where there is next to none elsewhere."""
        return self.inside / self.elsewhere if self.inside < _HARDLY * self.elsewhere else None

    def document(self, *, in_rpm: bool) -> dict[str, Any]:
        """`torque_noise`, or `reading_noise`, of the document (docs/contract.md#diagnosis)."""
        unit, scale = self._unit(in_rpm=in_rpm)
        noise, noise_unit = (RAD_S_PER_RPM, "rpm") if in_rpm else (1.0, "rad/s")
        noise_unit += "/sqrt(s)" if self.source == "torque" else ""
        return {
            "varies_with": self.along,
            "from": self.low / scale,
            "to": self.high / scale,
            "unit": unit,
            "inside": self.inside / noise,
            "elsewhere": self.elsewhere / noise,
            "noise_unit": noise_unit,
            "times": self.times,
            "p_value": self.p_value,
            "sentence": self.sentence(in_rpm=in_rpm),
        }

    def sentence(self, *, in_rpm: bool) -> str:
        """`torque noise is 2.4 times larger between 50 and 70 rpm: structure may hide in it`."""
        unit, scale = self._unit(in_rpm=in_rpm)
        where = f"between {number_text(self.low / scale, 2)} and {number_text(self.high / scale, 2)} {unit}"
        if self.along == "direction":
            where = "where the wheel turns forward" if self.low > 0.0 else "where the wheel turns backward"
        if self.source == "readings":
            unit = "rpm" if in_rpm else "rad/s (or m/s)"
            inside, elsewhere = (
                number_text(x / (RAD_S_PER_RPM if in_rpm else 1.0), 2) for x in (self.inside, self.elsewhere)
            )
            sentence = f"readings are off by {inside} {unit} {where}, and by {elsewhere} elsewhere"
            return f"{sentence} ({p_text(self.p_value)})"
        if self.times is not None:
            sentence = f"torque noise is {number_text(self.times, 2)} times larger {where} than elsewhere"
        else:
            size = self.inside / (RAD_S_PER_RPM if in_rpm else 1.0)
            moved = f"{number_text(size, 2)} {'rpm' if in_rpm else 'rad/s (or m/s)'}"
            sentence = f"torque noise moves the speed by {moved} in a second {where}, and hardly elsewhere"
        return f"{sentence} ({p_text(self.p_value)}): structure may hide in it"

    def _unit(self, *, in_rpm: bool) -> tuple[str, float]:
        if self.along == "speed":
            return ("rpm", RAD_S_PER_RPM) if in_rpm else ("rad/s (or m/s)", 1.0)
        if self.along == "current":
            return ("mA", 1.0e-3) if in_rpm else ("A (or N)", 1.0)
        return "", 1.0


def noise_findings(fit: Fit, facts: RecordFacts) -> dict[Source, NoiseFinding]:
    """Of either noise the window in which it stands out most from the rest, where one does at `NOISE_P`."""
    windows, used = _windows(fit, facts)
    if not windows:
        return {}
    seen, draws = _slopes(fit, windows, used)
    alone = list(islice(draws, _FEW))
    few = np.array(alone)
    wanted = [i for i in range(len(_SOURCES)) if _p_values(seen[i], few[:, i])[0].min() <= _WORTH_MORE]
    if not wanted:
        return {}
    alone += islice(draws, _DRAWS - _FEW)
    many = np.array(alone)
    found = {
        _SOURCES[i]: _finding(fit, facts, windows, used, _SOURCES[i], _p_values(seen[i], many[:, i])) for i in wanted
    }
    return {source: finding for source, finding in found.items() if finding is not None}


def _finding(
    fit: Fit, facts: RecordFacts, windows: list[Window], used: BoolArray, source: Source,
    tested: tuple[Float64Array, float],
) -> NoiseFinding | None:  # fmt: skip
    """The clearest window of one noise; tested: what `_p_values` says of each."""
    p, independent = tested
    best = int(np.argmin(p))
    together = -math.expm1(independent * math.log1p(-min(float(p[best]), 1.0 - 1.0e-12)))
    if together >= NOISE_P:
        return None
    window = windows[best]
    low, high = window.low, window.high
    if window.along == "speed":  # no more than was compared
        low = max(low, FAST_STRIBECK_SPEEDS * facts.stribeck_speed_rad_s)
        high = min(high, facts.top_speed_rad_s)
    sizes = _sizes(fit, window.inside) if source == "torque" else _reading_sizes(fit, window.inside, used)
    inside, elsewhere = sizes
    if inside <= elsewhere:
        return None
    return NoiseFinding(window.along, low, high, inside, elsewhere, together, source)


def _windows(fit: Fit, facts: RecordFacts) -> tuple[list[Window], BoolArray]:
    """What is compared, and among which intervals (n,): none near rest, where a wheel breaks away early or late."""
    record = fit.linearised.record
    began = where_begun(fit.trajectory.speed)
    size, current = np.abs(began), np.abs(record.course.mean_current_A)
    rest = FAST_STRIBECK_SPEEDS * facts.stribeck_speed_rad_s
    used = record.follows & (size > rest) & (np.abs(fit.trajectory.speed) > rest)
    if used.sum() < _LEAST_INTERVALS:
        return [], used
    top, most = facts.top_speed_rad_s, facts.top_current_A
    count = max(0, math.ceil(math.log(max(top / rest, 1.0)) / math.log(_STEP)))
    lows = rest * _STEP ** np.arange(count)
    ranges: list[tuple[Along, Float64Array, float, float]] = [
        *(("speed", size, float(low), float(low) * _WIDTH) for low in lows),
        *(("speed", size, low * top, high * top) for low, high in _OF_TOP_SPEED),
        *(("current", current, low * most, high * most) for low, high in _OF_TOP_CURRENT),
    ]
    found = [Window(along, low, high, used & (x >= low) & (x < high)) for along, x, low, high in ranges]
    found += [Window("direction", way, way, used & (way * began > 0.0)) for way in (-1.0, 1.0)]
    least, largest = _LEAST_SHARE * used.sum(), _MOST_SHARE * used.sum()
    return [window for window in found if least < window.inside.sum() < largest], used


def _slopes(fit: Fit, windows: list[Window], used: BoolArray) -> tuple[Float64Array, Iterator[Float64Array]]:
    """Slopes of the log-likelihood by a variance of each window's own, (2, 2 + windows), and draws under noise alone.

    Of the torque, then of the readings. The first two windows are of all intervals that are compared, and of all
    others. The slope by the variance of one interval's torque is half the square of the adjoint of what is left there,
    but for a constant that the draws have too; by that of one reading, half the square of that less what the next
    interval carries back: the smoothed error of the reading over its variance (de Jong 1989).
    """
    linearised, noise = fit.linearised, fit.noise
    r, A, _ = linearised.whitened(noise.ratio, noise.variance, linearised.jacobian, linearised.memory_jacobian)
    lengths = np.linalg.norm(A, axis=0)
    Q, _ = np.linalg.qr(A[:, lengths > 0.0] / lengths[lengths > 0.0])
    at, n = linearised.innovation_at, linearised.chain.reading.size
    q = noise.ratio * noise.variance / linearised.record.course.period_s
    within = 0.5 * np.column_stack([used, ~used, *(w.inside for w in windows)])
    weights = linearised.chain.noisy_s[:, None] * within
    carried = np.where(linearised.chain.follows, linearised.chain.slopes[:, 0], 0.0)[1:]

    def slopes(left: Float64Array) -> Float64Array:
        left = left - Q @ (Q.T @ left)
        white, back = np.zeros(n), np.zeros(n)
        white[at] = left * math.sqrt(left.size / max(float(left @ left), 1.0e-300))
        adjoint(linearised.chain, q, noise.variance, white, back)
        own = back.copy()
        own[:-1] -= carried * back[1:]
        return np.stack([(back**2) @ weights, (own**2) @ within])

    def drawn() -> Iterator[Float64Array]:
        rng = np.random.default_rng(_SEED)
        while True:
            linearised.record.work.charge(whitening_units(n, 1))
            yield slopes(rng.standard_normal(r.size))

    return slopes(r), drawn()


def _p_values(seen: Float64Array, alone: Float64Array) -> tuple[Float64Array, float]:
    """(p of each window by itself, how many are independent); what a common noise can follow is taken off.

    seen (2 + windows,), alone (draws, 2 + windows): as `_slopes` gives them, drawn.
    """
    mean = alone.mean(axis=0)
    seen, alone = seen - mean, alone - mean
    follow = np.linalg.lstsq(alone[:, :2], alone[:, 2:], rcond=None)[0]
    seen, alone = seen[2:] - seen[:2] @ follow, alone[:, 2:] - alone[:, :2] @ follow
    p, p_alone = skewed_tail(seen, alone)
    smallest = float(np.quantile(p_alone.min(axis=1), _AT))
    return p, max(math.log1p(-_AT) / math.log1p(-smallest), 1.0)


def _reading_sizes(fit: Fit, inside: BoolArray, used: BoolArray) -> tuple[float, float]:
    """The readings' noise in a window and in all else that was compared [rad/s], by what the fit leaves of each.

    Zero where there are no readings on either side, as of a sensor that is new now and then: nothing is stated of them.
    """
    white, sigma = left_over(fit), math.sqrt(fit.noise.variance)
    known = np.isfinite(white)
    there, elsewhere = (white[known & mask] for mask in (inside, used & ~inside))
    if not (there.size and elsewhere.size):
        return 0.0, 0.0
    return sigma * float(np.sqrt(np.mean(there**2))), sigma * float(np.sqrt(np.mean(elsewhere**2)))


def _sizes(fit: Fit, inside: BoolArray) -> tuple[float, float]:
    """The likeliest torque noise in a window and elsewhere [rad/s per sqrt(s)], the readings' noise at its best."""
    from scipy.optimize import minimize

    linearised, noise = fit.linearised, fit.noise
    period, n = linearised.record.course.period_s, linearised.innovation_at.size
    chain = linearised.chain

    def ratios(logs: Float64Array) -> tuple[float, float]:
        low, high = math.log(LEAST_RATIO), math.log(100.0)
        there, elsewhere = (math.exp(float(np.clip(v, low, high))) for v in logs)
        return there, elsewhere

    def whitened(logs: Float64Array) -> tuple[float, float]:
        there, elsewhere = ratios(logs)
        noisy = chain._replace(noisy_s=np.where(inside, chain.noisy_s * there / elsewhere, chain.noisy_s))
        r, A, sums = replace(linearised, chain=noisy).whitened(
            elsewhere, noise.variance, linearised.jacobian, linearised.memory_jacobian
        )
        left = r - A @ np.linalg.lstsq(A, r, rcond=None)[0]
        return float(left @ left), sums

    def worse(logs: Float64Array) -> float:
        rss, sums = whitened(logs)
        return 0.5 * (n * math.log(max(rss, 1.0e-300)) + sums)

    start = math.log(max(noise.ratio, 10.0 * LEAST_RATIO))
    simplex = np.array([[start + 1.0, start - 1.0], [start + 3.0, start - 1.0], [start + 1.0, start - 4.0]])
    best = minimize(worse, simplex[0], method="Nelder-Mead",
                    options={"maxfev": 60, "xatol": 0.05, "fatol": 0.05, "initial_simplex": simplex})  # fmt: skip
    variance = whitened(best.x)[0] / n * noise.variance
    there, elsewhere = ratios(best.x)
    return math.sqrt(there * variance / period), math.sqrt(elsewhere * variance / period)
