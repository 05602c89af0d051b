"""Several wheels on one line: `wheels` of a configuration, one entry a wheel, written out as a configuration for each.

An entry has the wheel's name, whatever else of `wheel` is its own (address, protocol, inertia, ...), and whatever
differs from the sections of the file (`limits: {current_A: 0.2}`). The line and the loop are one for all.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from typing import Any

from rw_ekf.checking.wording import shown, suggestion
from rw_ekf.checking.yaml_loader import PathTuple, YamlDocument
from rw_ekf.plain_file import file_part
from rw_ekf.settings.schema import SECTIONS, Configuration, WheelSection

WHEELS = "wheels"
_OF_THE_LINE = ("port", "baud", "dtr", "rts", "echo")  # keys of `wheel` that no entry may have
_OWN_SECTIONS = tuple(name for name in SECTIONS if name not in ("wheel", "loop"))
_OWN_KEYS = tuple(key for key in WheelSection.model_fields if key not in _OF_THE_LINE)
_HOST = re.compile(r"(\w+://)?(\[[0-9a-fA-F:.]+\]|[\w.-]+)(:\d+(?:/.*)?)")  # as the schema has HOST:PORT
_SAME_HOST = {"localhost": "127.0.0.1", "[::1]": "127.0.0.1", "0.0.0.0": "", "[::]": ""}  # where a socket listens
# Places that two runs at once cannot share: (section, key).
_OWN_PLACES = (("output", "prometheus"), ("output", "plotjuggler"), ("output", "mqtt"), ("compensation", "socket"))


class WheelDocument(YamlDocument):
    """A configuration file as one wheel of it has it: what its entry says stands in place of what the sections say."""

    @classmethod
    def of(cls, document: YamlDocument, index: int) -> WheelDocument:
        """The wheel of an entry that is a table."""
        entry: dict[Any, Any] = document.data[WHEELS][index]
        data = {key: value for key, value in document.data.items() if key != WHEELS}
        own = {key: value for key, value in entry.items() if key in _OWN_KEYS}  # others are found wrong elsewhere
        data["wheel"] = _merged(data.get("wheel"), own)
        for name in _OWN_SECTIONS:
            if name in entry:
                data[name] = _merged(data.get(name), entry[name])
        made = cls(document.path, data, document._values, document._keys, document._begins, document._text)
        object.__setattr__(made, "_entry", (entry, index))
        return made

    def where(self, path: PathTuple = ()) -> str:
        """Where the value at a path stands, in the wheel's entry or in the section."""
        return super().where(self._own(path))

    def where_key(self, path: PathTuple = ()) -> str:
        """Where the key at a path stands."""
        return super().where_key(self._own(path))

    def _own(self, path: PathTuple) -> PathTuple:
        entry, index = self._entry  # type: ignore[attr-defined]
        if len(path) > 1 and path[0] == "wheel" and path[1] in entry and path[1] in _OWN_KEYS:
            return (WHEELS, index, *path[1:])
        if path and path[0] in _OWN_SECTIONS and path[0] in entry:
            section = entry[path[0]]
            if len(path) == 1 or not isinstance(section, dict) or path[1] in section:
                return (WHEELS, index, *path)
        return path


def _merged(section: Any, own: Any) -> Any:
    """A section with a wheel's own keys over it; what is no table stands, to be found wrong."""
    if own is None:
        return section
    if not isinstance(own, dict) or not (section is None or isinstance(section, dict)):
        return own
    return {**(section or {}), **own}


def entries_of(document: YamlDocument) -> tuple[list[WheelDocument], list[str]]:
    """A document for each entry of `wheels`, and what is wrong with the entries as such."""
    listed = document.data[WHEELS]
    if not isinstance(listed, list) or not listed:
        text = f"must be a list of wheels, each with a name, found {shown(listed)}"
        return [], [f"{document.where((WHEELS,))}: {WHEELS} {text}"]
    findings: list[str] = []
    names: set[Any] = set()
    for index, entry in enumerate(listed):
        at = f"{WHEELS}.{index}"
        if not isinstance(entry, dict):
            findings.append(
                f"{document.where((WHEELS, index))}: {at} must be a table with a name, found {shown(entry)}"
            )
            continue
        findings += _faults_of(document, entry, index)
        name = entry.get("name")
        if name is None:
            findings.append(
                f"{document.where_key((WHEELS, index))}: {at}.name is required: what reports and logs call this wheel"
            )
        elif isinstance(name, str) and name in names:
            place = document.where((WHEELS, index, "name"))
            findings.append(f"{place}: {at}.name {name!r} is the name of a wheel above: give each its own")
        if isinstance(name, str):
            names.add(name)
    made = [WheelDocument.of(document, index) for index, entry in enumerate(listed) if isinstance(entry, dict)]
    return made, findings


def _faults_of(document: YamlDocument, entry: dict[Any, Any], index: int) -> Iterator[str]:
    """Keys that no entry has."""
    for key in entry:
        place, name = document.where_key((WHEELS, index, key)), f"{WHEELS}.{index}.{key}"
        if key in _OF_THE_LINE:
            yield f"{place}: {name}: all wheels are on one line: give it in the section wheel"
        elif key == "loop":
            yield f"{place}: {name}: one loop reads all wheels: give it in the section loop"
        elif key not in _OWN_KEYS and key not in _OWN_SECTIONS:
            yield f"{place}: unknown key {name}; {suggestion(key, (*_OWN_KEYS, *_OWN_SECTIONS))}"


def _is_one_place(one: str, other: str) -> bool:
    """Whether two paths, or two of HOST:PORT with what stands around it, are one: `localhost` is 127.0.0.1."""
    (before, hosts, after), (its_before, its_hosts, its_after) = _place(one), _place(other)
    if (before, after) != (its_before, its_after):
        return False
    return hosts == its_hosts or "" in (hosts, its_hosts)


def _place(text: str) -> tuple[str, str, str]:
    """What stands before a host, the host ("": every one of this computer), and its port with what stands behind."""
    match = _HOST.fullmatch(text)
    if match is None:
        return "", "path", os.path.abspath(text)
    before, host, after = match.groups()
    return before or "", _SAME_HOST.get(host.lower(), host.lower()), after


def shared_findings(documents: list[WheelDocument], configurations: list[Configuration]) -> list[str]:
    """What wheels may not have in common, and what a line for several needs."""
    findings = []
    for section, key in _OWN_PLACES:
        taken: dict[str, str] = {}  # place: whose
        for document, configuration in zip(documents, configurations, strict=True):
            value = getattr(getattr(configuration, section), key)
            name = configuration.wheel.name
            if value is None:
                continue
            other = next((taken[place] for place in taken if _is_one_place(place, value)), None)
            if other is not None:
                findings.append(
                    f"{document.where((section, key))}: {section}.{key} {value!r} is that of {other} "
                    f"and of {name}: give each its own, as {WHEELS}: [{{name: {name}, {section}: {{{key}: ...}}}}]"
                )
            else:
                taken[value] = name
    stems: dict[str, str] = {}
    for document, configuration in zip(documents, configurations, strict=True):
        name = configuration.wheel.name
        other = stems.setdefault(file_part(name).lower(), name)
        if other != name:
            findings.append(
                f"{document.where(('wheel', 'name'))}: wheel.name {name!r} gives the same file names as {other!r}: "
                "what they learn and publish would be each other's; give another name"
            )
    loop = configurations[0].loop
    if len(configurations) > 1 and 2e-3 * loop.reply_timeout_ms * loop.rate_hz >= 1.0:
        place = documents[0].where(("loop", "reply_timeout_ms"))
        findings.append(
            f"{place}: loop.reply_timeout_ms {loop.reply_timeout_ms:g} must be below half a loop period, "
            f"{500.0 / loop.rate_hz:g} ms at loop.rate_hz {loop.rate_hz:g}: a wheel that does not answer takes so much "
            "of it from the others"
        )
    return findings
