"""The one interface of all compensations, and how one becomes a controller of the loop."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from rw_ekf.control.compensation.known import WheelKnown
from rw_ekf.records import Tick

Request = Callable[[Tick], float]  # the wheel's acceleration that is requested after a tick [rad/s^2]
Knowledge = Callable[[Tick], WheelKnown]


class Compensation(Protocol):
    """Turns the acceleration requested of a wheel into a current. One of these per run: it may remember."""

    def current_A(self, tick: Tick, request_rad_s2: float, known: WheelKnown) -> float:
        """The current [A] to request after this tick's sample, for an acceleration of the wheel [rad/s^2]."""
        ...


class CompensatedController:
    """A `Controller` of the loop: Tick -> current."""

    def __init__(self, request: Request, compensation: Compensation, knowledge: Knowledge) -> None:
        self._request = request
        self._compensation = compensation
        self._knowledge = knowledge

    def __call__(self, tick: Tick) -> float:
        """Return the current [A] to request after this tick's sample."""
        return self._compensation.current_A(tick, self._request(tick), self._knowledge(tick))
