"""What a wheel's driver needs of its line, whatever is spoken on it and whatever carries it."""

from __future__ import annotations

from typing import NamedTuple, Protocol

from rw_ekf.drivers.line.serial_port import PortSettings
from rw_ekf.errors import DriverError
from rw_ekf.records import LinkCounters


class Exchange(NamedTuple):
    """One request and what came of it. Times are of the host's monotonic clock."""

    data: bytes | None  # of the reply; None: no valid reply came in time
    received_by_wheel_s: float  # when the request's last byte reached the wheel, from send time and baud
    replied_s: float  # when the reply's last byte was here, or the wait ended


class Line(Protocol):
    """An open line. Raises DriverError when it fails; a missing reply is not an error."""

    name: str  # "serial+/dev/ttyUSB0"
    settings: PortSettings
    counters: LinkCounters
    restarts: int  # of the wheel, that this end had to see to
    news: tuple[str, str] | None  # an event of the link and its sentence, until it is reported
    reply_timeout_s: float

    @property
    def in_turns(self) -> bool:
        """Whether others speak on the line too, so that nobody is waited for twice in a turn."""
        ...

    @property
    def may_ask(self) -> bool:
        """Whether its turn is not over."""
        ...

    @property
    def answers(self) -> bool:
        """Whether the wheel does, since the line was opened."""
        ...

    def unanswered(self, waited_s: float) -> DriverError:
        """What to say where it never did."""
        ...

    def note_restart(self) -> None:
        """The wheel has restarted, as its clock says."""
        ...

    def request(self, register_id: int, data: bytes, reply_bytes: int, timeout_s: float | None = None) -> Exchange:
        """Read or write a register."""
        ...

    def close(self) -> None:
        """Release it. Safe to call twice."""
        ...
