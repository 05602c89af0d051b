"""Whether the current that flows is the one that was written: telemetry's two currents against the commands.

The command that telemetry reads back must be what was written. The measured current must lie among the currents that
were in force during the last second (an amplifier has a lag), within 10 % and 2 % of the limit: no amplifier is wrong
by more, and one that clips, is off, or serves another master is. Noise averages out: the test is on the mean over ten
readings of how far it lies outside. Either way nobody knows then what drives the wheel, and nothing is learned from it.
"""

from __future__ import annotations

from collections import deque

from rw_ekf.records import IssuedCommand, WheelSample

_LAG_READINGS = 11  # a second at 10 Hz, and the command before it
_MEAN_OF = 10
_GAIN_SHARE = 0.10  # +-30 %: the same events on every log of tests/live/test_lying_current.py
_LIMIT_SHARE = 0.02
_COUNT_A = 2.0e-4  # of a register: a command is read back as its count
_READ_BACKS = 5
_WRONG = 3  # of them: a command that nobody confirmed, or one wild number, is none


class CurrentWatch:
    """Takes each reading and the command that follows it. One of these per run that writes."""

    def __init__(self, limit_A: float) -> None:
        """limit_A: limits.current_A."""
        self.tolerance_A = _LIMIT_SHARE * limit_A
        self._in_force: deque[float] = deque(maxlen=_LAG_READINGS)
        self._known = False
        self._beyond: deque[float] = deque(maxlen=_MEAN_OF)
        self._other: deque[bool] = deque(maxlen=_READ_BACKS)
        self._reported_A = self._instead_of_A = self._measured_A = 0.0

    def commanded(self, command: IssuedCommand) -> None:
        """Note what was written after the reading that was added last."""
        self._known = command.acknowledged
        self._in_force.append(command.current_A)

    def forget(self) -> None:
        """The wheel restarted or the line was lost: what is in force is not known."""
        self._in_force.clear()
        self._beyond.clear()
        self._other.clear()

    def add(self, sample: WheelSample) -> None:
        """Take a reading."""
        if not self._in_force or not self._known:
            return
        if sample.current_command_A is not None:
            off_A = abs(sample.current_command_A - self._in_force[-1])
            self._other.append(off_A > _COUNT_A + 0.5 * self.tolerance_A)
            if self._other[-1]:
                self._reported_A, self._instead_of_A = sample.current_command_A, self._in_force[-1]
        if sample.current_A is not None:
            low, high = min(self._in_force), max(self._in_force)
            within = self.tolerance_A + _GAIN_SHARE * max(abs(low), abs(high))
            off_A = min(_outside(sample.current_A, low, high), _outside(sample.current_A, -high, -low), key=abs)
            self._beyond.append(off_A / within)
            if abs(off_A) > within:
                self._measured_A = sample.current_A

    @property
    def fault(self) -> tuple[str, str] | None:
        """An event and what is wrong, in words; None where the current is as commanded."""
        if not self._in_force:
            return None
        if sum(self._other) >= _WRONG:
            return "command_not_in_force", (
                f"telemetry says that {self._reported_A:.4g} A is commanded, but {self._instead_of_A:.4g} A was "
                "written: another program writes to this wheel, or it does not take what it acknowledges, or the scale "
                "of current_command in the wire map is wrong where it is read or where it is written"
            )
        if abs(sum(self._beyond)) > _MEAN_OF:
            return "current_not_as_commanded", (
                f"{self._measured_A:.4g} A is measured where {self._in_force[-1]:.4g} A is commanded: the amplifier is "
                "off, clips or is weak, or the scale of current in the wire map is wrong; if the field says nothing, "
                "take it out"
            )
        return None


def _outside(value: float, low: float, high: float) -> float:
    """How far a value lies outside, signed. Valid for either sign: a turned one in the wire map is the sign watch's."""
    return value - min(max(value, low), high)
