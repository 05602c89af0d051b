"""The lines of the request socket: a torque comes in, a line of JSON goes out once a turn (no sockets here).

In:   {"torque_Nm": 1.2e-3}     torque ON THE WHEEL: above zero it turns the wheel forward, and the body backward
Out:  docs/compensation-on-the-wheel.md#the-protocol
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from typing import Any, NoReturn

from rw_ekf.json_output import finite

MOST_LINE_BYTES = 4096
MOST_LINES = 8  # that are looked at, from the newest back, until one is a request


class LineBuffer:
    """Whole lines of what a client sends in pieces; of one without an end no more is kept than a request may have."""

    def __init__(self) -> None:
        self._rest = b""
        self._cut = False  # the beginning of `_rest` is lost

    def take(self, chunk: bytes) -> list[bytes]:
        """The newest whole lines of what was sent, oldest first, as many as anyone will look at."""
        whole = self._rest + chunk
        *lines, rest = whole.rsplit(b"\n", MOST_LINES + 1)
        if len(lines) > MOST_LINES or (self._cut and lines):
            del lines[0]  # all that is older, or a line whose beginning is lost
        self._cut = len(rest) > MOST_LINE_BYTES or (self._cut and len(rest) == len(whole))
        self._rest = b"" if self._cut else rest
        return lines


def torque_of(line: bytes) -> float:
    """The torque [N m] that a line requests. Raises ValueError, one sentence, where it requests none."""
    if len(line) > MOST_LINE_BYTES:
        raise ValueError(f"a line of {len(line)} bytes is no request: {MOST_LINE_BYTES} at most")
    try:
        request = json.loads(line, parse_constant=_refuse)
        torque = request["torque_Nm"] if isinstance(request, dict) else None
        if isinstance(torque, bool) or not isinstance(torque, int | float) or not math.isfinite(torque):
            raise ValueError("no finite number")
        return float(torque)
    except (ValueError, KeyError, OverflowError, RecursionError):
        raise ValueError('no request: a line is {"torque_Nm": NUMBER}, finite, and a newline') from None


def newest_torque(lines: list[bytes]) -> tuple[float | None, list[str]]:
    """The torque [N m] of the newest line that requests one, None where none does; what was wrong with newer ones."""
    wrong: list[str] = []
    for line in reversed(lines):
        if not line.strip():
            continue
        try:
            return torque_of(line), wrong
        except ValueError as error:
            wrong.append(str(error))
    return None, wrong


def line_of(answer: Mapping[str, Any]) -> bytes:
    """A line that reports a turn; what is not a number is null."""
    return json.dumps(finite(answer), allow_nan=False).encode() + b"\n"


class FadingRequest:
    """The last request, for as long as it is fresh; then it fades to zero, because the requester has gone."""

    def __init__(self, stale_s: float, fade_s: float) -> None:
        self._stale_s = stale_s
        self._fade_s = fade_s
        self._value = 0.0
        self._since_s: float | None = None

    def take(self, value: float, now_s: float) -> None:
        """A new one."""
        self._value, self._since_s = value, now_s

    def at(self, now_s: float) -> float:
        """What of it holds now."""
        age_s = self.age_s(now_s)
        if age_s is None:
            return 0.0
        late_s = age_s - self._stale_s
        return self._value if late_s <= 0.0 else self._value * max(0.0, 1.0 - late_s / self._fade_s)

    def age_s(self, now_s: float) -> float | None:
        """How old it is [s]; None before the first."""
        return None if self._since_s is None else now_s - self._since_s

    def is_fresh(self, now_s: float) -> bool:
        """Whether it is younger than stale_s."""
        age_s = self.age_s(now_s)
        return age_s is not None and age_s <= self._stale_s


def _refuse(name: str) -> NoReturn:
    raise ValueError(name)
