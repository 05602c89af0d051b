"""JSON documents, as text and on standard output. JSON has no NaN: it is written as null."""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Mapping
from datetime import date, time, timedelta
from decimal import Decimal
from typing import Any


def print_json(document: Mapping[str, Any]) -> None:
    """Write one document to standard output, and nothing else."""
    sys.stdout.write(json_text(document))
    sys.stdout.flush()


def json_text(document: Mapping[str, Any]) -> str:
    """The document as it is printed and written, indented, with a newline at its end."""
    return json.dumps(finite(document), indent=2, allow_nan=False) + "\n"


def finite(value: Any) -> Any:
    """Return a copy in which every NaN or infinity is None, dates are texts, and durations seconds."""
    if isinstance(value, Mapping):
        return {key: finite(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [finite(item) for item in value]
    if isinstance(value, float | Decimal):
        return float(value) if math.isfinite(value) else None
    if isinstance(value, timedelta):
        return value.total_seconds()
    if isinstance(value, bytes):
        return value.decode(errors="replace")
    return value.isoformat() if isinstance(value, date | time) else value
