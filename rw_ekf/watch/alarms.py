"""What a watch has to say: an alarm that begins, and later ends; as fields for a log and as a sentence."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from rw_ekf.numbers import number_of, plus_minus

DRAG_SPIKE = "drag_spike"
RESIDUAL = "residual_not_noise"
OVER = {DRAG_SPIKE: "drag_spike_over", RESIDUAL: "residual_noise_again"}

Details = Mapping[str, float | str | None]


@dataclass(frozen=True)
class Alarm:
    """One alarm. Times are the log's own [s]."""

    name: str
    since_s: float
    details: Details = field(default_factory=dict)
    ended_s: float | None = None

    @property
    def event(self) -> str:
        """Name under which it is logged: another one where it has ended."""
        return self.name if self.ended_s is None else OVER[self.name]

    def sentence(self, since: str, ended: str = "") -> str:
        """Return it for a person; since, ended: the times as that person reads them."""
        return (
            _spike_sentence(self, since, ended) if self.name == DRAG_SPIKE else _residual_sentence(self, since, ended)
        )


def _residual_sentence(alarm: Alarm, since: str, ended: str) -> str:
    dependence = alarm.details.get("largest_dependence")
    stated = f"largest dependence: {dependence}"
    if alarm.details.get("after") is not None:
        stated += f", after {alarm.details['after']}"
    if alarm.ended_s is not None:
        return f"residual is noise again since {ended} (it was not since {since}; {stated})"
    return f"residual is not noise since {since}, {stated}"


def _spike_sentence(alarm: Alarm, since: str, ended: str) -> str:
    amplitude, std = (number_of(alarm.details[key]) for key in ("amplitude_rad_s2", "std_rad_s2"))
    assert amplitude is not None
    size = f"{amplitude:.3g} rad/s^2 at least" if std is None else f"{plus_minus(amplitude, std)} rad/s^2"
    torque = alarm.details.get("amplitude_mNm")
    if torque is not None:
        inertia = alarm.details.get("inertia_kg_m2")
        size += f" ({torque:.2g} mNm{f', inertia {inertia:.4g} kg m^2' if inertia is not None else ''})"
    if alarm.ended_s is None:
        return f"drag spike since {since}, {size}"
    decay = alarm.details.get("decay_s")
    faded = f", decay {decay:.0f} s" if decay is not None else ""
    return f"drag spike of {size} since {since} is over at {ended}{faded} ({alarm.details['end']})"
