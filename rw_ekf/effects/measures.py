"""How large an effect is, in terms that hold for a plant of any size, and what a log lacks to show it at all."""

from __future__ import annotations

from datetime import UTC, datetime

from rw_ekf.model.effect import RecordFacts
from rw_ekf.numbers import plus_minus

STEADY_SHARE = 0.005  # of dry friction: a steady effect below it changes nothing that anybody would act on
SOUGHT_SHARE = 0.01  # the same for effects found by searching many onsets, orders or frequencies
SMALLEST_RANGE_K = 1.0
LONGEST_LAG_S = 10.0
_LEAST_SLOW = 10  # samples of slow motion: one fast start from rest has less and says nothing
_TINY = 1.0e-12


def dry_scale(facts: RecordFacts) -> float:
    """What sizes are measured by [rad/s^2]: Coulomb friction, or a tenth of viscous friction at top speed.

    The larger of the two; the second keeps a plant without dry friction (an air bearing) from being accused of trifles.
    """
    friction = facts.friction
    return max(friction.coulomb, 0.1 * abs(friction.viscous) * facts.top_speed_rad_s, _TINY)


def top_speed(facts: RecordFacts) -> float:
    """The record's largest |speed| [rad/s], never 0."""
    return max(facts.top_speed_rad_s, 1.0e-9)


def top_drive(facts: RecordFacts) -> float:
    """The largest acceleration that was requested of the motor [rad/s^2], never 0."""
    return max(abs(facts.friction.motor_gain) * facts.top_current_A, _TINY)


def friction_at(facts: RecordFacts, speed_rad_s: float) -> float:
    """All friction that the base model has at a speed [rad/s^2]; the scale of dry friction at least."""
    friction = facts.friction
    return max(friction.coulomb + abs(friction.viscous) * speed_rad_s, dry_scale(facts))


def largest_torque(facts: RecordFacts) -> float:
    """The largest acceleration that may act on a wheel which is still driven [rad/s^2].

    The drive itself, or three times all friction where that is more: a wheel that coasts has no drive.
    """
    return max(top_drive(facts), 3.0 * friction_at(facts, top_speed(facts)))


def temperature_range(facts: RecordFacts) -> float:
    """From the coldest to the warmest sample [K]; 1 K where that is less or not logged."""
    return max(facts.temperature_range_K or 0.0, SMALLEST_RANGE_K)


def lacks_temperature(facts: RecordFacts) -> str | None:
    """Why the temperatures of this log show nothing; None if they do."""
    range_K = facts.temperature_range_K or 0.0
    if range_K < SMALLEST_RANGE_K:
        return f"needs a temperature that changes by {SMALLEST_RANGE_K:g} K or more; it changes by {range_K:.2g} K"
    return None


def lacks_reversal(facts: RecordFacts) -> str | None:
    """Why a record that turns one way only shows nothing; None if it turns both ways."""
    return None if facts.reversals >= 1 else "needs a reversal; the record turns one way only"


def lacks_slow_motion(facts: RecordFacts) -> str | None:
    """Why a record that neither reverses nor turns slowly, from rest or back to it, shows nothing; None if it does."""
    if facts.reversals >= 1 or facts.slow_samples >= _LEAST_SLOW:
        return None
    return "needs a reversal, or a start or a stop; the record is of a wheel that turns fast, one way only"


def lacks_current(facts: RecordFacts) -> str | None:
    """Why a coast-down shows nothing; None if the motor was driven."""
    return None if facts.top_current_A > 0.0 else "needs a motor current; there is none in the record"


def of_coulomb(size_rad_s2: float, std_rad_s2: float, facts: RecordFacts) -> str:
    """A friction as a share of Coulomb friction; in rad/s^2 where there is hardly any of that."""
    coulomb = facts.friction.coulomb
    if coulomb < dry_scale(facts):
        return f"{plus_minus(size_rad_s2, std_rad_s2)} rad/s^2"
    return f"{plus_minus(100.0 * size_rad_s2 / coulomb, 100.0 * std_rad_s2 / coulomb)} % of Coulomb friction"


def moves(value: float) -> str:
    """The verb for a quantity that changes by `value` per something."""
    return "rises" if value > 0.0 else "falls"


def slope_percent(quantity: str, value: float, std: float, per: str) -> str:
    """A relative slope in words: "Viscous friction falls 3.02 +- 0.14 % per K"."""
    return f"{quantity} {moves(value)} {plus_minus(100.0 * abs(value), 100.0 * std)} % {per}"


def moment(time_s: float, facts: RecordFacts) -> str:
    """A time of the log, with that since its start where its own time does not begin at zero, and UTC."""
    since_s, utc = time_s - facts.first_s, utc_of(time_s, facts)
    since = f"{since_s:.1f} s after the log's start" if facts.first_s != 0.0 else ""
    reported = ", ".join(filter(None, (since, utc)))
    return f"{time_s:.1f} s ({reported})" if reported else f"{time_s:.1f} s"


def utc_of(time_s: float, facts: RecordFacts) -> str:
    """A time of the log as UTC, to the second; empty where it is not known when the log began."""
    if facts.began_utc_s is None:
        return ""
    moment_utc = datetime.fromtimestamp(facts.began_utc_s + time_s - facts.first_s, UTC)
    return f"{moment_utc:%Y-%m-%dT%H:%M:%SZ}"
