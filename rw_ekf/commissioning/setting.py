"""The configuration of a wheel that is being commissioned: for each step, and as the commented file it leaves."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from rw_ekf.checking.yaml_loader import YamlDocument
from rw_ekf.commissioning.progress import Progress
from rw_ekf.errors import ConfigError
from rw_ekf.logs.atomic import write_text
from rw_ekf.settings.load import configuration_from, load_configuration
from rw_ekf.settings.schema import Configuration
from rw_ekf.units import rpm_from_rad_s

CONFIGURATION_FILE = "wheel.yaml"
SLEW_PER_LIMIT = 12.5  # from zero to the largest current in 80 ms: as the shipped example's limits have it
_LEAST_TIMEOUT_MS = 40.0
_REPLIES = 3.0  # times what a reply took beyond its bytes, behind the time that a whole sample takes with them
_SILENCE_S, _SILENT_PERIODS = 0.5, 2.0  # the configuration's own, or so many periods of a slow loop: one may be missed
_RATES_HZ = (10.0, 5.0, 4.0, 2.0, 1.0)
_READS_A_PERIOD = 2.2  # the loop waits half a period for a sample
_PRIOR_SHARE = 0.3  # standard deviation of what a small move shows, of itself


def sections_of(progress: Progress) -> dict[str, dict[str, Any]]:
    """What is known by now, as the sections of a configuration."""
    found, limits, still, sign = (progress[step] for step in ("find", "limits", "still", "sign"))
    protocol = found["protocol"] if sign is None else sign["protocol"]
    wheel = {"port": found["port"], "name": "wheel", "protocol": protocol}
    if found["baud"] is not None:
        wheel["baud"] = found["baud"]
    kept = {name: limits[name] for name in ("current_A", "speed_rpm", "temperature_degC") if limits[name] is not None}
    rate_hz = rate_for(found["read_ms"])
    reply_ms = (still or found)["reply_ms"] or 0.0  # none where nothing is requested, as on a bus
    timeout_ms = max(_LEAST_TIMEOUT_MS, found["read_ms"] + _REPLIES * reply_ms)
    kept["slew_A_per_s"] = SLEW_PER_LIMIT * limits["current_A"]
    if _SILENCE_S * rate_hz < _SILENT_PERIODS:
        kept["silence_s"] = _SILENT_PERIODS / rate_hz
    sections: dict[str, dict[str, Any]] = {
        "wheel": wheel,
        "limits": kept,
        "loop": {"rate_hz": rate_hz, "reply_timeout_ms": round(min(timeout_ms, 0.5e3 / rate_hz), 1)},
        "command": {"profile": "zero"},
    }
    if still is not None:
        ratio = 1.0 if sign is None else sign["speed_ratio"]
        sections["filter"] = {"speed_noise_rpm": max(_short(rpm_from_rad_s(still["noise_rad_s"]) * ratio), 1.0e-6)}
    if sign is not None:
        sections["filter"]["prior"] = {
            name: {"value": _short(sign[name]), "std": _short(_PRIOR_SHARE * sign[name])}
            for name in ("motor_gain", "coulomb", "static")
        }
    return sections


def rate_for(read_ms: float) -> float:
    """The rate of the loop: 10 Hz, or as much as leaves a sample most of half a period on a slow line."""
    return next((rate for rate in _RATES_HZ if _READS_A_PERIOD * read_ms < 1e3 / rate), _RATES_HZ[-1])


def configuration_of(progress: Progress) -> Configuration:
    """The configuration by which the next step drives the wheel. Raises ConfigError."""
    return configuration_from(YamlDocument(str(progress.directory / CONFIGURATION_FILE), sections_of(progress)))


def write_configuration(progress: Progress, model: str | None = None) -> Path:
    """Write wheel.yaml, with what each key stands on. Raises ConfigError where it would be none, BadInputError."""
    path = progress.directory / CONFIGURATION_FILE
    text = _text(progress, model)
    if progress["model"] is None and model is None and path.exists() and not _is_unfinished(path):
        path.replace(path.with_suffix(".before.yaml"))  # a service may stand on it
    write_text(path, text)
    load_configuration(path)
    return path


def _is_unfinished(path: Path) -> bool:
    """Whether a configuration is one of a commissioning under way: it names no model."""
    try:
        return load_configuration(path).filter.model is None
    except ConfigError:
        return False


def _text(progress: Progress, model: str | None) -> str:
    found, limits, still, sign = (progress[step] for step in ("find", "limits", "still", "sign"))
    reply_ms, read_ms = (None, found["read_ms"]) if still is None else (still["reply_ms"], still["read_ms"])
    sections = sections_of(progress)
    sections["wheel"]["protocol"] = _beside(progress, sections["wheel"]["protocol"])
    if model is not None:
        sections["filter"] = {"speed_noise_rpm": sections["filter"]["speed_noise_rpm"], "model": model}
    about = {
        "wheel.port": "where it answered",
        "wheel.protocol": "as it was found" if sign is None else sign["map_text"],
        "limits": f"what may never be exceeded, as {limits['by']} gave it",
        "limits.slew_A_per_s": "from zero to the limit in 80 ms",
        "limits.silence_s": "two periods of the loop",
        "loop.reply_timeout_ms": f"a reply takes {reply_ms:.3g} ms beyond its bytes" if reply_ms else None,
        "loop.rate_hz": f"a sample takes {read_ms:.3g} ms",
        "filter.speed_noise_rpm": "of readings at rest",
        "filter.model": "from the identification",
        "filter.prior": "from the small move; a model takes its place",
        "command": "a run that holds zero: choose what the wheel shall do (docs/configuration.md)",
    }
    identity = found["identity"] or {}
    who = f" with serial number {identity['serial_number']}" if identity.get("serial_number") is not None else ""
    lines = [
        f"# Written by `rw-ekf commission` for the wheel{who}. What was measured, and how: report.html beside this."
        if sign is not None
        else f"# Not finished: which way a current turns the wheel{who} is not known. It is there for `rw-ekf stop`."
    ]
    for section, keys in sections.items():
        lines += ["", f"{section}:{_comment(about.get(section))}"]
        for key, value in keys.items():
            lines.append(f"  {key}: {json.dumps(value, ensure_ascii=False)}{_comment(about.get(f'{section}.{key}'))}")
    return "\n".join(lines) + "\n"


def _beside(progress: Progress, protocol: str) -> str:
    """A path as the file in the output directory names it: one that is in there by its name."""
    path = Path(protocol)
    if path.suffix not in (".yaml", ".yml") and "/" not in protocol:
        return protocol
    if path.absolute().parent == progress.directory.absolute():
        return path.name
    return str(path.absolute())


def _comment(text: str | None) -> str:
    return "" if text is None else f"  # {' '.join(text.split())}"


def _short(value: float) -> float:
    return float(f"{value:.6g}")
