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
from rw_ekf.settings.load import configuration_from, configuration_path
from rw_ekf.settings.resources import is_path
from rw_ekf.settings.schema import Configuration

_KEYS = (("wheel", "protocol"), ("wheel", "baud"), ("wheel", "dtr"), ("wheel", "rts"), ("loop", "reply_timeout_ms"))
_ANY_LIMIT_A = 1.0  # a Configuration has one; nothing but zero is written with this one


@dataclass(frozen=True)
class LineConfiguration:
    """A configuration that is good for writing zero and for nothing else."""

    configuration: Configuration
    findings: tuple[str, ...]  # all that is wrong in the file
    doubts: tuple[str, ...]  # what of it concerns the line itself: zero may not arrive with the default taken instead


def read_line(path: str | Path) -> LineConfiguration:
    """Read the line's keys of a configuration. Raises ConfigError where it names no port, or two."""
    document, findings, repeated = load_what_can_be_read(configuration_path(path))
    if not findings:
        try:
            return LineConfiguration(configuration_from(document), (), ())
        except ConfigError as error:
            findings = error.findings
    port = _value(document, ("wheel", "port"))
    if repeated & {("wheel",), ("wheel", "port")} or not isinstance(port, str) or not port:
        raise ConfigError(
            [*findings, f"{document.where(('wheel', 'port'))}: wheel.port: stop needs one port, and found none or two"]
        )
    kept: dict[str, dict[str, Any]] = {"wheel": {"port": port}, "limits": {"current_A": _ANY_LIMIT_A}}
    doubts = []
    for section, key in _KEYS:
        value = _value(document, (section, key))
        if value is None:
            continue
        if key == "protocol" and isinstance(value, str) and is_path(value):
            value = str((Path(document.path).resolve().parent / os.path.expanduser(value)).absolute())
        trial = kept | {section: kept.get(section, {}) | {key: value}}
        try:
            Configuration.model_validate(trial)
            clear = not repeated & {(section,), (section, key)}
        except ValidationError:
            clear = False
        if clear:
            kept = trial
        else:
            doubts.append(f"{document.where((section, key))}: {section}.{key} cannot be used; the default was taken")
    return LineConfiguration(Configuration.model_validate(kept), tuple(findings), tuple(doubts))


def _value(document: YamlDocument, path: tuple[str, str]) -> Any:
    section = document.data.get(path[0]) if isinstance(document.data, dict) else None
    return section.get(path[1]) if isinstance(section, dict) else None
