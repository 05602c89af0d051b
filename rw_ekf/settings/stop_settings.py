"""What `rw-ekf stop` needs of a configuration: the port, its speed, the wire map; whatever else may be wrong with it.

A current that must be zero cannot wait until a configuration is mended. So here, and nowhere else, a configuration
with mistakes is read as far as it goes: the line from it, everything else that a Configuration has from defaults.
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from rw_ekf.checking.yaml_loader import YamlDocument, load_what_can_be_read
from rw_ekf.errors import ConfigError
from rw_ekf.settings.load import configuration_path, configurations_from
from rw_ekf.settings.resources import is_path
from rw_ekf.settings.schema import Configuration
from rw_ekf.settings.several_wheels import WHEELS

_KEYS = (
    ("wheel", "protocol"), ("wheel", "baud"), ("wheel", "dtr"), ("wheel", "rts"), ("wheel", "address"),
    ("wheel", "echo"), ("wheel", "name"), ("loop", "reply_timeout_ms"),
)  # fmt: skip
_ANY_LIMIT_A = 1.0  # a Configuration has one; nothing but zero is written with this one


@dataclass(frozen=True)
class LineConfiguration:
    """Configurations that are good for writing zero and for nothing else: of every wheel on one line."""

    wheels: tuple[Configuration, ...]
    findings: tuple[str, ...]  # all that is wrong in the file
    doubts: tuple[str, ...]  # what of it concerns the line itself: zero may not arrive with the default taken instead
    names_wheels: bool = False  # whether the file speaks of several wheels


def read_line(path: str | Path) -> LineConfiguration:
    """Read the line's keys of a configuration. Raises ConfigError where it names no port, or two."""
    document, findings, repeated = load_what_can_be_read(configuration_path(path))
    if not findings:
        try:
            return LineConfiguration(configurations_from(document), (), ())
        except ConfigError as error:
            findings = error.findings
    port = _value(document, ("wheel", "port"))
    if repeated & {("wheel",), ("wheel", "port")} or not isinstance(port, str) or not port:
        raise ConfigError(
            [*findings, f"{document.where(('wheel', 'port'))}: wheel.port: stop needs one port, and found none or two"]
        )
    kept: dict[str, dict[str, Any]] = {"wheel": {"port": port}, "limits": {"current_A": _ANY_LIMIT_A}}
    doubts: list[str] = []
    for section, key in _KEYS:
        value = _value(document, (section, key))
        if value is None:
            continue
        trial = kept | {section: kept.get(section, {}) | {key: _resolved(document, key, value)}}
        try:
            Configuration.model_validate(trial)
            clear = not repeated & {(section,), (section, key)}
        except ValidationError:
            clear = False
        if clear:
            kept = trial
        else:
            doubts.append(f"{document.where((section, key))}: {section}.{key} cannot be used; the default was taken")
    wheels = tuple(_with_own(kept, at, entry, document, doubts) for at, entry in _entries(document, doubts)) or (kept,)
    made = tuple(Configuration.model_validate(wheel) for wheel in wheels)
    several = isinstance(document.data, dict) and WHEELS in document.data
    return LineConfiguration(made, tuple(findings), tuple(doubts), several)


def _entries(document: YamlDocument, doubts: list[str]) -> list[tuple[int, dict[Any, Any]]]:
    """Of `wheels`, what can be read, each with its place in the list; what cannot is a doubt."""
    listed = document.data.get(WHEELS) if isinstance(document.data, dict) else None
    if listed is None:
        return []
    if not isinstance(listed, list):
        doubts.append(f"{document.where((WHEELS,))}: {WHEELS} is no list: zero went to the wheel of `wheel` alone")
        return []
    for at, entry in enumerate(listed):
        if not isinstance(entry, dict):
            doubts.append(f"{document.where((WHEELS, at))}: {WHEELS}.{at} is no table: no zero went to that wheel")
    return [(at, entry) for at, entry in enumerate(listed) if isinstance(entry, dict)]


def _with_own(
    kept: dict[str, dict[str, Any]], at: int, entry: dict[Any, Any], document: YamlDocument, doubts: list[str]
) -> dict[str, Any]:
    """The line's keys with those of a wheel's entry in their place, as far as they hold; what does not is a doubt."""
    for key in ("name", "protocol", "address"):
        if key in entry:
            value = entry[key]
            trial = kept | {"wheel": kept["wheel"] | {key: _resolved(document, key, value)}}
            try:
                Configuration.model_validate(trial)
                kept = trial
            except ValidationError:
                place = document.where((WHEELS, at, key))
                doubts.append(f"{place}: {WHEELS}.{at}.{key} cannot be used: zero may not have reached that wheel")
    return kept


def _resolved(document: YamlDocument, key: str, value: Any) -> Any:
    """A path counts from the file's folder."""
    if key == "protocol" and isinstance(value, str) and is_path(value):
        return str((Path(document.path).resolve().parent / os.path.expanduser(value)).absolute())
    return value


def _value(document: YamlDocument, path: tuple[str, str]) -> Any:
    section = document.data.get(path[0]) if isinstance(document.data, dict) else None
    return section.get(path[1]) if isinstance(section, dict) else None
