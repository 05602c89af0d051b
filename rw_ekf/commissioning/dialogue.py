"""What a commissioning says to a person and asks of one; the verb has a terminal's, a test its own."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Protocol

from rw_ekf.errors import RwEkfError


class Stopped(Exception):  # noqa: N818 - an outcome, not an error
    """A signal requested the end."""


class RefusedError(RwEkfError):
    """The wheel, or what is known of it, does not allow to continue; what was found so far is kept."""


class Dialogue(Protocol):
    """Whoever sits in front of it."""

    def say(self, step: str, text: str) -> None:
        """Tell a finding, in one line."""
        ...

    def number(self, question: str, suggested: float) -> float | None:
        """Ask for a number above zero; None: nobody is there to be asked."""
        ...

    def choose(self, question: str, names: Sequence[str]) -> int | None:
        """Ask for one of several; None: nobody is there to be asked."""
        ...

    def agree(self, question: str) -> bool | None:
        """Ask for a yes; None: nobody is there to be asked."""
        ...

    def tachometer(self, question: str) -> Callable[[], float | str | None] | None:
        """Ask for a true speed [rpm] while the wheel turns. None: nobody is there.

        What is returned puts the question when it is called first; it gives that number, "" where a person leaves it
        open, or None as long as nothing has been answered.
        """
        ...
