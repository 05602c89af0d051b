"""Words that all messages about a user's file share."""

from __future__ import annotations

import difflib
from collections.abc import Iterable

_MOST_SHOWN = 60  # characters of a value: a log given for a configuration is one long text


def suggestion(word: object, known: Iterable[str]) -> str:
    """Advice after an unknown name: the nearest known one, or all of them."""
    names = [str(name) for name in known]
    near = difflib.get_close_matches(str(word), names, n=1, cutoff=0.6)
    return f"did you mean '{near[0]}'?" if near else f"known here: {', '.join(names)}"


def shown(value: object) -> str:
    """Show a value the way its author wrote it in YAML."""
    if value is None:
        return "null"
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, dict):
        return "a table of keys"
    if isinstance(value, list | tuple):
        return "a list"
    if isinstance(value, int) and abs(value) >= 10**_MOST_SHOWN:
        return f"a number of more than {_MOST_SHOWN} digits"
    if isinstance(value, str) and len(value) > _MOST_SHOWN:
        return f"a text of {len(value)} characters that begins {value[:_MOST_SHOWN]!r}"
    return f"the text {value!r}" if isinstance(value, str) else f"{value}"
