"""What an option of a command and an argument of the library may be: one sentence refuses it in both."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Literal

from rw_ekf.errors import BadInputError

FitMethod = Literal["least-squares", "deterministic"]
SplitKind = Literal["blocks", "halves"]
MOST_SEEDS = 1000  # of a bench


def chosen(name: str, given: object, choices: Sequence[str]) -> None:
    """Raise BadInputError, with the words of the command line, unless a value is one of the choices."""
    if not isinstance(given, str) or given not in choices:
        raise BadInputError(f"{name}: invalid choice: {given!r} (choose from {', '.join(map(repr, choices))})")


def whole_number(given: object, most: int) -> int:
    """A number from 1 on, or digits. Raises ValueError with the words of the command line."""
    text = str(given)
    if isinstance(given, bool) or not text.isdigit() or not 1 <= int(text) <= most:
        raise ValueError(f"{given!r} is no whole number from 1 to {most}")
    return int(text)


def names_of(what: str, given: str | Iterable[str] | None) -> list[str]:
    """Names in a list, where one alone may be given as it is. Raises BadInputError for what is no name."""
    try:
        names = [given] if isinstance(given, str) else list(given or ())
    except TypeError:
        names = [given]  # type: ignore[list-item]
    wrong = next((name for name in names if not isinstance(name, str)), None)
    if wrong is not None:
        raise BadInputError(f"{what}: names are wanted, in a list; found {type(wrong).__name__} {wrong!r}")
    return names
