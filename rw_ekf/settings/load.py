"""Reads a configuration file and checks it as a whole: all mistakes at once, each with file:line:column and key.

Paths: what the configuration reads (filter.model, command.log, wheel.protocol where it is a path) is relative to the
configuration file, so that a configuration and its files can be moved together. What it writes (output.directory) is
relative to the working directory, so that a shared configuration does not fill its own directory. wheel.port is not
a path but a name for pyserial, and is left alone.
"""

from __future__ import annotations

import contextlib
import os
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ValidationError

from rw_ekf.checking.findings import validated_sections
from rw_ekf.checking.section import Section
from rw_ekf.checking.wording import shown
from rw_ekf.checking.yaml_loader import YamlDocument, load_yaml
from rw_ekf.errors import ConfigError
from rw_ekf.model.bounds import VALUES, std_fault, value_fault
from rw_ekf.settings.resources import CONFIGURATIONS, is_path, own_or_shipped, protocol_path
from rw_ekf.settings.schema import (
    SECTIONS,
    CommandSection,
    CompensationSection,
    Configuration,
    FilterSection,
    LimitsSection,
    LoopSection,
    WheelSection,
)
from rw_ekf.settings.several_wheels import WHEELS, entries_of, shared_findings

SHAPED_PROFILES = frozenset({"sine", "steps", "random-sines"})  # those that use amplitude_A and bias_A
_PLACE = re.compile(r":(\d+):(\d+): ")
_PACKED = (".zst", ".gz")  # what the first part of a run's log may have become
_PATH_KEYS = (("wheel", "protocol"), ("filter", "model"), ("command", "log"))


def load_configuration(path: str | Path, wheel: str | None = None) -> Configuration:
    """Read, check and resolve the configuration file at `path`, or the shipped one of that name.

    wheel: the name of the one that is meant, where the file has several (`wheels`). Paths of files that are read come
    back absolute. Raises ConfigError with one finding per mistake.
    """
    return one_of_wheels(load_configurations(path), path, wheel)


def load_configurations(path: str | Path) -> tuple[Configuration, ...]:
    """The same for every wheel of the file: one, or as many as stand in its `wheels`. Raises ConfigError."""
    return configurations_from(load_yaml(configuration_path(path)))


def one_of_wheels(configurations: Sequence[Configuration], path: str | Path, wheel: str | None = None) -> Configuration:
    """The wheel of that name, or the only one. Raises ConfigError where there is none, or it is not known which."""
    names = [configuration.wheel.name for configuration in configurations]
    if wheel in names or (wheel is None and len(names) == 1):
        return configurations[0 if wheel is None else names.index(wheel)]
    known = ", ".join(names)
    if wheel is None:
        raise ConfigError(f"{path}: it has {len(names)} wheels; say which one is meant: --wheel NAME, of {known}")
    raise ConfigError(f"{path}: it has no wheel {wheel!r}; known here: {known}")


def configuration_path(name: str | Path) -> Path:
    """Find the configuration that is meant: a file, or the name of a shipped one. Raises ConfigError."""
    return own_or_shipped(name, CONFIGURATIONS)


def configurations_from(document: YamlDocument) -> tuple[Configuration, ...]:
    """Check and resolve a parsed configuration, for each of its wheels. Raises ConfigError as below."""
    return tuple(configuration for _, configuration in wheels_from(document))


def wheels_from(document: YamlDocument) -> list[tuple[YamlDocument, Configuration]]:
    """The same, each with the document that its values stand in. Raises ConfigError with one finding per mistake."""
    if not isinstance(document.data, dict) or WHEELS not in document.data:
        return [(document, configuration_from(document))]
    documents, findings = entries_of(document)
    configurations = []
    for one in documents:
        try:
            configurations.append(configuration_from(one))
        except ConfigError as error:
            findings += error.findings
    if not findings:
        findings = shared_findings(documents, configurations)
    if findings:
        raise ConfigError(sorted(dict.fromkeys(findings), key=_place_order))
    return list(zip(documents, configurations, strict=True))


def configuration_from(document: YamlDocument) -> Configuration:
    """Check and resolve a parsed configuration of one wheel. Raises ConfigError with one finding per mistake."""
    if not isinstance(document.data, dict):
        message = f"the configuration must be a table of sections, found {shown(document.data)}"
        raise ConfigError(f"{document.where()}: {message}; known here: {', '.join(SECTIONS)}")
    if "wheel" not in document.data and {"registers", "family"} & document.data.keys():
        raise ConfigError(
            f"{document.where()}: this is a wire map, no configuration: give the configuration whose wheel.protocol "
            "names it, and what is wrong in the map is told too"
        )
    data = _with_resolved_paths(document)
    sections, findings = validated_sections(document, data, SECTIONS)
    findings += _cross_findings(document, sections)
    if findings:
        raise ConfigError(sorted(findings, key=_place_order))
    return Configuration.model_validate(sections)


def protocols_named(document: YamlDocument) -> list[str]:
    """The wire maps that a configuration names, by name or path, whatever else is wrong in it; those that there are."""
    has_wheels = isinstance(document.data, dict) and WHEELS in document.data
    names = []
    for one in entries_of(document)[0] if has_wheels else [document]:
        section = _with_resolved_paths(one).get("wheel") if isinstance(one.data, dict) else None
        name = section.get("protocol") if isinstance(section, dict) else None
        if isinstance(name, str):
            with contextlib.suppress(ConfigError):
                protocol_path(name)
                names.append(name)
    return list(dict.fromkeys(names))


def configuration_of(data: dict[str, Any], path: Path) -> Configuration:
    """Take the resolved configuration that a run left in its metadata at `path`. Raises ConfigError if it is none."""
    try:
        return Configuration.model_validate(data)
    except ValidationError as error:
        first = error.errors()[0]
        key = ".".join(map(str, first["loc"]))
        raise ConfigError(
            f"{path}: its configuration is not one of this version of rw_ekf ({key}: {first['msg']}): replay "
            "the log with --config"
        ) from None


def resolved_lines(configuration: Configuration, document: YamlDocument) -> str:
    """Give the resolved configuration as YAML text; each line ends in its meaning, and says where a default was taken.

    `document` is the file it came from: what does not stand there is marked `# default`.
    """
    lines: list[str] = []
    for name in SECTIONS:
        lines.append(f"{name}:")
        written = document.data.get(name)
        lines += _section_lines(getattr(configuration, name), written if isinstance(written, dict) else {}, "  ")
    return "\n".join(lines) + "\n"


def _section_lines(section: BaseModel, written: dict[Any, Any], indent: str) -> list[str]:
    lines = []
    for key, info in type(section).model_fields.items():
        value = getattr(section, key)
        origin = "" if key in written else "default: "
        if isinstance(value, BaseModel):
            lines.append(f"{indent}{key}:  # {info.description}")
            lines += _section_lines(value, written.get(key) or {}, indent + "  ")
        else:
            lines.append(f"{indent}{key}: {_yaml_value(value)}  # {origin}{info.description}")
    return lines


def _yaml_value(value: object) -> str:
    """Write a scalar or list of texts as YAML that reads back as the same value."""
    if isinstance(value, tuple):
        return "[" + ", ".join(_yaml_value(item) for item in value) + "]"
    if isinstance(value, str):
        # Double-quoted YAML is a superset of JSON strings, and quotes keep words such as `none` from being guessed at.
        import json

        return json.dumps(value, ensure_ascii=False)
    if isinstance(value, bool):
        return "true" if value else "false"
    return "null" if value is None else repr(value)


def _with_resolved_paths(document: YamlDocument) -> dict[Any, Any]:
    """Copy the document's data, with the paths of input files made absolute."""
    base = Path(document.path).resolve().parent
    data = {name: dict(section) if isinstance(section, dict) else section for name, section in document.data.items()}
    for section, key in _PATH_KEYS:
        table = data.get(section)
        value = table.get(key) if isinstance(table, dict) else None
        if isinstance(value, str) and value and (key != "protocol" or is_path(value)):
            table[key] = str((base / os.path.expanduser(value)).absolute())  # type: ignore[index]
    return data


def _cross_findings(document: YamlDocument, sections: dict[str, Section]) -> list[str]:
    """Findings that concern two keys, or a file that must exist; sections that did not validate are left out."""
    findings: list[str] = []
    wheel, limits, loop = sections.get("wheel"), sections.get("limits"), sections.get("loop")
    filter_section, command = sections.get("filter"), sections.get("command")
    if isinstance(command, CommandSection):
        findings += _command_findings(document, command, limits if isinstance(limits, LimitsSection) else None)
    compensation = sections.get("compensation")
    if isinstance(compensation, CompensationSection) and compensation.scheme is not None:
        if isinstance(command, CommandSection):
            findings += _request_findings(document, compensation, command)
        if isinstance(limits, LimitsSection) and isinstance(loop, LoopSection):
            findings += _compensation_findings(document, compensation, limits, loop)
    if isinstance(loop, LoopSection):
        findings += _timing_findings(document, loop, limits if isinstance(limits, LimitsSection) else None)
    if isinstance(wheel, WheelSection):
        try:
            protocol_path(wheel.protocol)
        except ConfigError as error:
            findings.append(f"{document.where(('wheel', 'protocol'))}: wheel.protocol: {error}")
    if isinstance(filter_section, FilterSection):
        findings += _prior_findings(document, filter_section)
    if isinstance(filter_section, FilterSection) and filter_section.model is not None:
        findings += _missing_file(document, ("filter", "model"), filter_section.model)
    if isinstance(command, CommandSection) and command.log is not None:
        findings += _missing_file(document, ("command", "log"), command.log)
    return findings


def _prior_findings(document: YamlDocument, section: FilterSection) -> list[str]:
    """A prior that no machine can have, or that would overflow; the same bounds as a model's."""
    findings = []
    for name in VALUES if section.prior is not None else ():
        prior = getattr(section.prior, name)
        if prior is None:
            continue
        fault, key = value_fault(name, prior.value, prior.std), "value"
        if fault is None:
            fault, key = std_fault(prior.value, prior.std), "std"
        if fault is not None:
            path = ("filter", "prior", name, key)
            findings.append(f"{document.where(path)}: {'.'.join(path)} {fault}")
    return findings


def _command_findings(document: YamlDocument, command: CommandSection, limits: LimitsSection | None) -> list[str]:
    findings = []
    if command.profile == "log" and command.log is None:
        place = document.where(("command", "profile"))
        findings.append(f"{place}: command.log is required: command.profile is log, so name the log to repeat")
    if command.profile != "log" and command.log is not None:
        place = document.where(("command", "log"))
        findings.append(
            f"{place}: command.log is given but command.profile is {command.profile}: "
            "set the profile to log, or drop the log"
        )
    peak_A = command.amplitude_A + abs(command.bias_A)
    if limits is not None and command.profile in SHAPED_PROFILES and peak_A > limits.current_A:
        findings.append(
            f"{document.where(('command', 'amplitude_A'))}: command.amplitude_A {command.amplitude_A:g} A plus "
            f"|command.bias_A| {abs(command.bias_A):g} A is {peak_A:g} A, beyond limits.current_A "
            f"{limits.current_A:g} A ({document.where(('limits', 'current_A'))}): lower the command or raise the limit"
        )
    return findings


def _request_findings(document: YamlDocument, section: CompensationSection, command: CommandSection) -> list[str]:
    """A request that does not fit what is commanded."""
    written = "command" in document.data  # else the default is meant, which stands nowhere
    at = document.where(("command", "profile") if written else ("compensation", "scheme"))
    found = f"command.profile is {command.profile}"
    if command.profile == "none":
        return [
            f"{document.where(('compensation', 'scheme'))}: compensation.scheme: {found}, which never writes: drop one"
        ]
    findings = []
    if section.request == "socket" and command.profile != "zero":
        findings.append(
            f"{at}: compensation.request is socket, but {found}: set it to zero, and the wheel is asked for nothing "
            "but what comes over the socket; or set compensation.request to profile"
        )
    if section.request == "profile" and command.profile == "log":
        findings.append(f"{at}: compensation.request is profile, but {found}: set compensation.request to log")
    if section.request == "log" and command.profile != "log":
        findings.append(f"{at}: compensation.request is log, but {found}: set it to log, and name command.log")
    if section.request != "socket" and section.socket is not None:
        place = document.where(("compensation", "socket"))
        findings.append(
            f"{place}: compensation.socket is given but compensation.request is {section.request}: drop the socket"
        )
    return findings


def _compensation_findings(
    document: YamlDocument, section: CompensationSection, limits: LimitsSection, loop: LoopSection
) -> list[str]:
    findings = []
    if section.limit_A > limits.current_A:
        findings.append(
            f"{document.where(('compensation', 'limit_A'))}: compensation.limit_A {section.limit_A:g} A is beyond "
            f"limits.current_A {limits.current_A:g} A ({document.where(('limits', 'current_A'))}): lower it"
        )
    period_s = 1.0 / loop.rate_hz
    if section.stale_s <= period_s:
        findings.append(
            f"{document.where(('compensation', 'stale_s'))}: compensation.stale_s {section.stale_s:g} s must exceed "
            f"one loop period, {period_s:g} s at loop.rate_hz {loop.rate_hz:g}: raise it, or every request is stale"
        )
    return findings


def _timing_findings(document: YamlDocument, loop: LoopSection, limits: LimitsSection | None) -> list[str]:
    findings = []
    period_s = 1.0 / loop.rate_hz
    if limits is not None and limits.silence_s <= period_s:
        findings.append(
            f"{document.where(('limits', 'silence_s'))}: limits.silence_s {limits.silence_s:g} s must exceed one loop "
            f"period, {period_s:g} s at loop.rate_hz {loop.rate_hz:g}: raise it, or every cycle counts as silence"
        )
    if loop.reply_timeout_ms >= 1e3 * period_s:
        findings.append(
            f"{document.where(('loop', 'reply_timeout_ms'))}: loop.reply_timeout_ms {loop.reply_timeout_ms:g} must be "
            f"below one loop period, {1e3 * period_s:g} ms at loop.rate_hz {loop.rate_hz:g}: lower it or the rate, "
            "or one lost reply costs the next cycle"
        )
    return findings


def _missing_file(document: YamlDocument, path: tuple[str, str], file: str) -> list[str]:
    # isfile: false also for what no file can be called
    if any(os.path.isfile(f"{file}{packed}") for packed in ("", *_PACKED)):
        return []
    return [f"{document.where(path)}: {path[0]}.{path[1]}: no such file: {file}"]


def _place_order(finding: str) -> tuple[int, int]:
    """Line and column that a finding begins with, so that findings are reported in the order of the file."""
    match = _PLACE.search(finding)
    return (int(match[1]), int(match[2])) if match else (0, 0)
