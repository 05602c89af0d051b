"""A wheel followed from reading to reading by the model's own propagation, with the drag that the model lacks."""

from __future__ import annotations

from rw_ekf.control.compensation.known import WheelKnown
from rw_ekf.control.compensation.unmodelled_drag import SpeedNoise, UnmodelledDrag, mean_sign
from rw_ekf.records import Outlook, Tick


class FollowedWheel:
    """Speed and unmodelled drag at each tick; `begin`, `follow` or `stand`, then `ahead` for what comes next.

    The filter's gate refuses what its model cannot explain, which is what is looked for here. A reading is an outlier
    where not even five times Coulomb friction, from the last reading that was used on, could have led to it.
    """

    def __init__(self, noise: SpeedNoise) -> None:
        self._noise = noise
        self._drag: UnmodelledDrag | None = None
        self._ahead: Outlook | None = None
        self._unread_s = 0.0
        self.speed_rad_s = 0.0

    @property
    def drag_rad_s2(self) -> float:
        """Against the motion, above the model's friction."""
        return 0.0 if self._drag is None else self._drag.drag_rad_s2

    def forget(self) -> None:
        """Begin anew at the next tick."""
        self._drag = self._ahead = None

    def follow(self, tick: Tick, known: WheelKnown, span: tuple[float, float] | None) -> float:
        """Take a tick's reading; the speed [rad/s] then.

        span: interval [s] since the last tick and the current [A] in force in it; None after a gap.
        """
        drag, ahead = self._drag, self._ahead
        if span is None or drag is None or ahead is None or ahead.lead_s > span[0]:
            self._drag = UnmodelledDrag(known.parameters.coulomb, self._noise) if drag is None or span is None else drag
            self._drag.begin(tick.estimate.std.speed_rad_s**2)
            self.speed_rad_s, self._unread_s = known.speed_rad_s, 0.0
            return self.speed_rad_s
        dt_s, driving_A = span
        led_to = ahead.end_rad_s(driving_A, dt_s - ahead.lead_s)
        reading = tick.sample.speed_rad_s
        before, self.speed_rad_s = self.speed_rad_s, led_to
        self._unread_s += dt_s
        if reading is not None and abs(reading - led_to) <= drag.plausible_rad_s(self._unread_s):
            self.speed_rad_s += drag.step(reading - led_to, self._unread_s, mean_sign(before, led_to))
            self._unread_s = 0.0
        return self.speed_rad_s

    def stand(self) -> None:
        """The wheel is taken to stand."""
        self.speed_rad_s = 0.0
        if self._drag is not None:
            self._drag.begin()

    def ahead(self, known: WheelKnown) -> Outlook:
        """What follows from here, by the model."""
        self._ahead = known.outlook(self.speed_rad_s)
        return self._ahead
