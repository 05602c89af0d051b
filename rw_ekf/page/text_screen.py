"""A run as one screen of text: state, link, parameters with their sigmas, and the last minute as a line of blocks."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from rw_ekf.logs.metadata import after_start
from rw_ekf.model.state import STATE_UNITS
from rw_ekf.units import RAD_S_PER_RPM

_SIGMAS_95 = 1.96
_BLOCKS = "▁▂▃▄▅▆▇█"


def picture_of(published: tuple[dict[str, Any] | None, str], width: int) -> str:
    """The screen, lines of at most `width` characters, for what a run publishes and where it does."""
    document, place = published
    if document is None:
        return f"no run of this configuration has left {place}"[: 2 * width]
    state, std, link = (document.get(key) or {} for key in ("state", "std", "link"))
    recent = document.get("recent") or {}
    shown = document.get("run_state") if document.get("alive") else "ended" if document.get("ended_utc") else "dead"
    shown = f"no news, was {shown}" if document.get("stale") else shown
    label = min(28, width // 3)
    began = document.get("since_utc") if document.get("alive") else document.get("ended_utc") or document.get("utc")
    since, after = str(began or "")[11:19], after_start(document.get("began_utc"), began)
    lines = [
        f"{document.get('wheel')} on {document.get('port')}   {shown}{f' since {since} UTC{after}' if since else ''}",
        f"{document.get('reason') or ''}",
        f"line {link.get('state')}: {_short(link.get('reply_ms'))} ms a reply, {link.get('timeouts', 0)} silent, "
        f"{link.get('damaged', 0)} damaged, {link.get('stale', 0)} late, {link.get('reconnects', 0)} reconnections",
        "",
        f"{'speed':<{label}}{_number(state.get('speed_rad_s'), std.get('speed_rad_s'), 1.0 / RAD_S_PER_RPM)} rpm",
        f"{'current, commanded'[:label]:<{label}}{_short(document.get('current_command_A')):>12} A",
        *(
            f"{name.replace('_', ' ')[:label]:<{label}}{_number(value, std.get(name))} {STATE_UNITS.get(name, '')}"
            for name, value in state.items()
            if name != "speed_rad_s"
        ),
        "",
    ]
    room = max(10, width - 14)
    for title, key in (("speed", "speed_rad_s"), ("innovation", "innovation_rad_s"), ("current", "current_command_A")):
        if recent.get(key):
            lines.append(f"{title:<12}{sparkline(recent[key], room, _band(recent) if title == 'innovation' else None)}")
    alarms = [str(alarm.get("text")) for alarm in document.get("alarms") or []]
    lines += ["", *(f"ALARM {text}" for text in alarms)] if alarms else []
    return "\n".join(line[:width].rstrip() for line in lines)


def sparkline(values: Sequence[float | None], room: int, within: float | None = None) -> str:
    """Values as blocks of eighths between their extremes, the mean of those that share a place; blank where none is.

    within: a bound on both sides, so that one that is far beyond leaves the others legible; its place is a `!`.
    """
    bound = math.inf if within is None else within
    known = [value for value in values if value is not None and abs(value) <= bound]
    if not known:
        return ""
    low, high = min(known), max(known)
    places = min(room, len(values))
    found = []
    for place in range(places):
        share = values[place * len(values) // places : (place + 1) * len(values) // places]
        if any(value is not None and abs(value) > bound for value in share):
            found.append("!")
            continue
        held = [value for value in share if value is not None]
        level = (sum(held) / len(held) - low) / (high - low) if held and high > low else 0.0
        found.append(_BLOCKS[min(7, int(8.0 * level))] if held else " ")
    return "".join(found)


def _band(recent: dict[str, Any]) -> float | None:
    """Twice the 95 % band of the innovation, as last reported; None where it was not."""
    known = [std for std in recent.get("innovation_std_rad_s") or () if std]
    return 2.0 * _SIGMAS_95 * float(known[-1]) if known else None


def _number(value: Any, std: Any, factor: float = 1.0) -> str:
    return f"{_short(value, factor):>12} +- {_short(std, factor):<10}"


def _short(value: Any, factor: float = 1.0) -> str:
    return "-" if not isinstance(value, int | float) or not math.isfinite(value) else f"{factor * value:.4g}"
