"""Whether telemetry tells the opposite of every current that is written, so that none counts as taken."""

from __future__ import annotations

from rw_ekf.driver import OPPOSITE
from rw_ekf.records import IssuedCommand

_FOR_CERTAIN = 5  # commands running


class OppositeTold:
    """Counts commands that telemetry told with the other sign; one that it bears out begins anew."""

    def __init__(self) -> None:
        self._running = 0

    def add(self, issued: IssuedCommand | None) -> None:
        """Take what became of a command; a zero has no sign."""
        if issued is not None and issued.reason == OPPOSITE:
            self._running += 1
        elif issued is not None and issued.acknowledged and issued.current_A != 0.0:
            self._running = 0

    @property
    def is_certain(self) -> bool:
        """Whether it has been so for long enough."""
        return self._running >= _FOR_CERTAIN

    @staticmethod
    def text(place: str) -> str:
        """For a person. place: where the scale of what is written stands."""
        return (
            "every current that is commanded is told by telemetry with the opposite sign, so that none counts as "
            "taken: in the wire map the scale of current_command where it is written has the other sign than that "
            f"of the current that is read. Turn the sign of one of the two; what is written stands in {place}"
        )
