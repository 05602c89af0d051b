"""The echo of what is sent, as an adapter on two wires has it: taken out of what is heard, and held against it.

Only what comes back as it was sent was alone on the line. An echo that is another, or none, is a collision, a wire that
is open or a sender that does not let go: what follows it is believed to answer nothing.
"""

from __future__ import annotations

from serial import SerialException

_MOST_BYTES = 8192  # that are searched for an echo: many times the longest frame
_MOST_IN_VAIN = 8  # requests running without their echo: no chance meeting of two senders, at ten a second or two


class EchoError(SerialException):
    """What is sent does not come back, again and again: nothing can be heard on such a line."""


class EchoCheck:
    """Bytes sent in, bytes heard in, bytes out that others have sent."""

    def __init__(self) -> None:
        self.lost = 0  # echoes, since it was made
        self._in_vain = 0
        self._sent = b""  # whose echo has not come yet
        self._heard = b""

    @property
    def is_awaited(self) -> bool:
        """Whether the echo of what was sent last has not come yet."""
        return bool(self._sent)

    def note_sent(self, content: bytes) -> None:
        """A request goes out. Raises EchoError where too many before it did not come back."""
        self.judge()
        self._sent = content

    def heard(self, content: bytes) -> bytes:
        """What of the bytes that came is no echo; nothing before the echo is there."""
        if not self._sent:
            return content
        self._heard = (self._heard + content)[-_MOST_BYTES:]
        at = self._heard.find(self._sent)
        if at < 0:
            return b""
        rest = self._heard[:at] + self._heard[at + len(self._sent) :]
        self._sent = self._heard = b""
        self._in_vain = 0
        return rest

    def judge(self) -> None:
        """Nothing is waited for any more: count an echo that has not come. Raises EchoError after too many."""
        if not self._sent:
            return
        came = "something else comes back" if self._heard else "nothing comes back"
        self._sent = self._heard = b""
        self.lost += 1
        self._in_vain += 1
        if self._in_vain >= _MOST_IN_VAIN:
            raise EchoError(
                f"wheel.echo is true, but what is sent does not come back as it was: {came}. Two senders at once, a "
                "broken wire, or an adapter without an echo (then set wheel.echo: false)"
            )
