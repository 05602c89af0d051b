"""Dynamic model compensation, [CK13] (14) and (15): the friction that the model predicts is added to the request."""

from __future__ import annotations

from rw_ekf.control.compensation.known import WheelKnown
from rw_ekf.records import Tick


class DynamicModelCompensation:
    """I = (a + f(omega)) / k; at rest f is the break-away friction in the direction that is requested.

    omega is the filter's speed: the sign of a raw reading chatters (the friction changes sign with the noise). With
    parameters that are exact, and readings of 1 and 5 rpm noise, the raw speed costs 0.02 and 0.15 deg at the reversal
    of the default bench, the filter's under 0.01 at both.

    Of a diagnosed model f has all that slows the wheel, offset, temperature, ripple, and hidden states as they stand
    now; a dead zone, saturation and the gain's temperature are undone in the current. A lag, a delay, and how a hidden
    state changes until the next current are not: predictive crossing inverts them too.
    """

    def current_A(self, tick: Tick, request_rad_s2: float, known: WheelKnown) -> float:
        """The current [A] for an acceleration [rad/s^2]."""
        friction = known.friction_against_rad_s2(request_rad_s2, known.speed_rad_s)  # (14), (15)
        return known.current_for_A(request_rad_s2 + friction)
