"""What a residual is held against: the quantities that a log has and that it varies in, and the models that left it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from rw_ekf.arrays import BoolArray, Float64Array
from rw_ekf.diagnosis.report.binning import BinnedMeans, binned_means, correlation_samples
from rw_ekf.diagnosis.report.canvas import AFTER, BEFORE
from rw_ekf.diagnosis.report.drawn_time import timeline
from rw_ekf.diagnosis.report.words import Units
from rw_ekf.units import RAD_S_PER_RPM

if TYPE_CHECKING:
    from rw_ekf.diagnosis.outcome import ModelTrace, Outcome

_MOST_BINS, _FEWEST_BINS = 28, 10
_INDEPENDENT_IN_BIN = 30.0
_STRUCTURE_WINDOW_S = 20.0
_LOW_SPEED_RAD_S = 40.0 * RAD_S_PER_RPM  # of a wheel
_LOW_STRIBECK_SPEEDS = 12.0
_FEW_HELDOUT = 200  # below so many held-out samples the whole record is shown


@dataclass(frozen=True)
class DrawnModel:
    """One of the models before and after, as every picture draws it."""

    name: str
    colour: str
    marker: str
    dashes: Any
    trace: ModelTrace


def models_of(diagnosis: Outcome) -> list[DrawnModel]:
    """Those there are; one that stands alone is red only where something is left in it."""
    before, after = diagnosis.before, diagnosis.after
    if before is None:
        return []
    good = after is None and (diagnosis.document().get("verdict") or {}).get("kind") == "adequate"
    found = [DrawnModel("before", AFTER if good else BEFORE, "o", (0, (4, 1.5)), before)]
    return found if after is None else [*found, DrawnModel("after", AFTER, "s", "-", after)]


def correlation_of(diagnosis: Outcome) -> float:
    """Samples of the residual that count as one: the better model's noise is the noise of both."""
    rate_hz = diagnosis.log.rate_hz
    window = max(51, int(_STRUCTURE_WINDOW_S * rate_hz)) if np.isfinite(rate_hz) else 51
    return correlation_samples(models_of(diagnosis)[-1].trace.residual_acceleration_rad_s2, window)


@dataclass(eq=False, frozen=True)
class Quantity:
    """One quantity, (n,) values of it, and the part and range of the record that is looked at."""

    title: str
    label: str
    x: Float64Array
    mask: BoolArray
    low: float
    high: float
    finest: bool = False  # with as many bins as may be: waves within a turn
    along_motion: bool = False  # times the speed's sign: braking is negative in both directions
    in_time: bool = False

    def means(self, y: Float64Array, correlation: float, lever: Float64Array | None = None) -> BinnedMeans:
        """Means of (n,) values over bins of the quantity; see `binned_means`."""
        independent = np.count_nonzero(self.mask) / correlation
        bins = _MOST_BINS if self.finest else int(np.clip(independent / _INDEPENDENT_IN_BIN, _FEWEST_BINS, _MOST_BINS))
        return binned_means(self.x, y, self.mask, np.linspace(self.low, self.high, bins + 1), correlation, lever)


def quantities_of(diagnosis: Outcome, units: Units) -> list[Quantity]:
    """What the residual is drawn against, in the report's units."""
    log, time = diagnosis.log, timeline(np.asarray(diagnosis.log.time_s, dtype=np.float64))
    everything = np.ones(len(log), dtype=bool)
    judged = diagnosis.heldout if np.count_nonzero(diagnosis.heldout) >= _FEW_HELDOUT else everything
    speed = log.speed_rad_s / units.speed_scale
    slow = _low_speed(diagnosis) / units.speed_scale
    found = [
        Quantity("time", time.label, time.values, everything, time.values[0], time.values[-1], in_time=True),
        _ranged("speed", f"speed [{units.speed}]", speed, judged),
        Quantity("low speed", f"|speed| [{units.speed}]", np.abs(speed), judged, 0.0, slow, along_motion=True),
        _ranged(units.drive, f"{units.drive} [{units.current}]", log.current_A / units.current_scale, judged),
    ]
    if diagnosis.angle_rad is not None:
        turn = np.degrees(np.mod(np.where(np.isfinite(diagnosis.angle_rad), diagnosis.angle_rad, np.nan), 2.0 * np.pi))
        label = f"angle within a turn{'' if diagnosis.angle_is_logged else ', integrated'} [deg]"
        found.append(Quantity("angle", label, turn, judged, 0.0, 360.0, finest=True))
    if diagnosis.temperature_degC is not None:
        found.append(_ranged("temperature", "temperature [°C]", diagnosis.temperature_degC, judged))
    return [quantity for quantity in found if quantity.high > quantity.low]


def _ranged(title: str, label: str, x: Float64Array, mask: BoolArray) -> Quantity:
    """A range that single stray readings do not widen."""
    known = x[mask & np.isfinite(x)]
    low, high = np.percentile(known[:: 1 + known.size // 200_000], (0.1, 99.9)) if known.size else (0.0, 0.0)
    return Quantity(title, label, x, mask, float(low), float(high))


def _low_speed(diagnosis: Outcome) -> float:
    """Up to where friction near rest matters [rad/s]: some Stribeck speeds, never more than a quarter of the range."""
    speed = np.abs(diagnosis.log.speed_rad_s)
    top = float(np.nanpercentile(speed, 99.0)) if np.isfinite(speed).any() else 0.0
    model = diagnosis.model
    low = _LOW_SPEED_RAD_S if model is None else _LOW_STRIBECK_SPEEDS * model.stribeck_speed_rad_s
    return min(low, 0.25 * top)
