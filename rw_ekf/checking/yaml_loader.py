"""Strict YAML: every mistake is an error with file:line:column, and every value can be traced to its place.

Differences from plain PyYAML, each of which has bitten someone: a repeated key is an error (PyYAML: the last one wins
silently); `1e-5` is a number (PyYAML: text); only `true` and `false` are booleans (PyYAML: also on, off, yes, no);
`.nan` and `.inf` are refused; dates stay text. Anchors and aliases work; merge keys (`<<`) and tags are refused.
Size, number of values (aliases written out) and depth are bounded, so that no file takes hours or fills the memory.
"""

from __future__ import annotations

import itertools
import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import yaml

from rw_ekf.errors import ConfigError, reason_of
from rw_ekf.plain_file import read_plain

PathTuple = tuple[str | int, ...]

_INTEGER = re.compile(r"[-+]?[0-9]+")
_HEXADECIMAL = re.compile(r"0x[0-9a-fA-F]+")
_FLOAT = re.compile(r"[-+]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][-+]?[0-9]+)?")
_NOT_FINITE = re.compile(r"[-+]?\.(?:inf|Inf|INF|nan|NaN|NAN)")
_CONSTANTS = {"": None, "~": None, "null": None, "true": True, "false": False}
# Far above any real file: a model with twelve effects has 400 values in 10 kB, five levels deep.
_MAX_BYTES = 1_000_000
_MAX_VALUES = 100_000  # of any kind, tables too, counted with aliases written out: twenty lines can stand for 2**20
_MAX_DEPTH = 50
_MAX_DIGITS = 300  # of an integer; longer ones are no numbers anyone means, and Python refuses some of them
_MAX_HEXADECIMAL_DIGITS = 200
_SECTION = re.compile(r"^(?=[A-Za-z_][\w-]*\s*:)", re.MULTILINE)


class _Composer(yaml.SafeLoader):
    """PyYAML's parser without its guesses: a plain scalar keeps the neutral tag, `_Builder` decides what it is."""

    yaml_implicit_resolvers: dict[str, list[tuple[str, re.Pattern[str]]]] = {}  # noqa: RUF012


class _QuickComposer(getattr(yaml, "CSafeLoader", yaml.SafeLoader)):  # type: ignore[misc]
    """The same by libyaml, where PyYAML was built with it: a thirtieth of the time, and no words on what is wrong."""

    yaml_implicit_resolvers: dict[str, list[tuple[str, re.Pattern[str]]]] = {}  # noqa: RUF012


@dataclass(frozen=True)
class YamlDocument:
    """A parsed file: plain data (dict, list, str, int, float, bool, None) and where each value stands."""

    path: str
    data: Any
    _values: dict[PathTuple, tuple[int, int]] = field(default_factory=dict, repr=False)
    _keys: dict[PathTuple, tuple[int, int]] = field(default_factory=dict, repr=False)
    _begins: dict[PathTuple, int] = field(default_factory=dict, repr=False)
    _text: str = field(default="", repr=False)

    def where(self, path: PathTuple = ()) -> str:
        """Give `file:line:column` of the value at `path`; of the nearest parent's key where there is no such value."""
        if path in self._values:
            return self._place(self._values[path])
        return self.where_key(path)

    def where_key(self, path: PathTuple = ()) -> str:
        """Give `file:line:column` of the key (or list item) at `path`, or of its nearest parent's."""
        while path and path not in self._keys:
            path = path[:-1]
        return self._place(self._keys.get(path, (1, 1)))

    def where_within(self, path: PathTuple, text: str, at: int) -> str:
        """Give `file:line:column` of a character, counted from 0, of the text that is the value at `path`.

        It may go over several lines. Of the value as a whole where it is written with escapes.
        """
        place = self._begins.get(path)
        if place is None:
            return self.where(path)
        if self._text.startswith(("|", ">"), place):
            place = max(self._text.find("\n", place), 0)
        elif self._text.startswith(("'", '"'), place):
            place += 1
        for letter in [letter for letter in text[:at] if not letter.isspace()]:
            place = self._past_blanks(place)
            if not self._text.startswith(letter, place):
                return self.where(path)
            place += 1
        if at < len(text):
            place = self._past_blanks(place)
        return self._place((self._text.count("\n", 0, place) + 1, place - self._text.rfind("\n", 0, place)))

    def _past_blanks(self, place: int) -> int:
        while place < len(self._text) and self._text[place].isspace():
            place += 1
        return place

    def _place(self, position: tuple[int, int]) -> str:
        return f"{self.path}:{position[0]}:{position[1]}"


def load_yaml(path: str | Path) -> YamlDocument:
    """Read one strict YAML file.

    Raises ConfigError if the file is missing, unreadable, not UTF-8, empty, not YAML, or breaks one of the rules in
    the module docstring; all broken rules are reported at once.
    """
    return parse_yaml(_read_text(Path(path)), str(path))


def parse_yaml(text: str, name: str) -> YamlDocument:
    """Parse strict YAML text; `name` stands where a file name would in messages. Raises ConfigError."""
    builder, data = _parse(text, name)
    if builder.findings:
        raise ConfigError(builder.findings)
    return YamlDocument(name, data, builder.values, builder.keys, builder.begins, text)


def load_what_can_be_read(path: str | Path) -> tuple[YamlDocument, list[str], frozenset[PathTuple]]:
    """Read of a YAML file with mistakes what can be read: (document, findings, keys that stand there twice).

    Where it is not even YAML, its sections (keys at the beginning of a line) are read one by one, and those that are
    not YAML left out. For `stop`, which must not fail for a mistake in what it does not need. Raises ConfigError where
    the file as a whole cannot be read.
    """
    text, name = _read_text(Path(path)), str(path)
    try:
        builder, data = _parse(text, name)
    except ConfigError as error:
        data, builder = {}, _Builder(name)
        for start, end in _sections(text):
            try:
                part, found = _parse("\n" * text.count("\n", 0, start) + text[start:end], name)
            except ConfigError:
                continue
            if isinstance(found, dict) and isinstance(data, dict):
                builder.repeated |= part.repeated | {(key,) for key in found if key in data}
                data = found | data
                builder.values |= part.values
                builder.keys |= part.keys
                builder.findings += part.findings
        builder.findings[:0] = error.findings
    return YamlDocument(name, data, builder.values, builder.keys), builder.findings, frozenset(builder.repeated)


def _sections(text: str) -> list[tuple[int, int]]:
    """Where each top-level key of a text with block style at the top begins and ends."""
    starts = [match.start() for match in _SECTION.finditer(text)]
    return list(itertools.pairwise([*starts, len(text)]))


def _parse(text: str, name: str) -> tuple[_Builder, Any]:
    """Parse a text: what was built, with findings, and the data. Raises ConfigError where it is no YAML at all."""
    try:
        try:
            node = _composed(_QuickComposer, text)
        except yaml.YAMLError:
            node = _composed(_Composer, text)
    except yaml.MarkedYAMLError as error:
        raise ConfigError(_syntax_finding(name, error)) from None
    except yaml.reader.ReaderError as error:
        line = text.count("\n", 0, error.position) + 1
        column = error.position - (text.rfind("\n", 0, error.position) + 1) + 1
        message = f"a character that YAML does not allow (code {ord(text[error.position])}): remove it"
        raise ConfigError(f"{name}:{line}:{column}: {message}") from None
    except RecursionError:
        raise ConfigError(f"{name}:1:1: lists or tables are nested too deeply") from None
    if node is None:
        raise ConfigError(f"{name}:1:1: the file is empty; nothing is configured")
    builder = _Builder(name)
    return builder, builder.build(node, (), ())


def _composed(parser: type[yaml.SafeLoader], text: str) -> yaml.Node | None:
    """The tree of a text. Raises yaml.YAMLError where it is no YAML, RecursionError where it is too deep."""
    loader = parser(text)
    try:
        return loader.get_single_node()
    finally:
        loader.dispose()


def _read_text(path: Path) -> str:
    """Text of a UTF-8 file (with or without a byte order mark); ConfigError naming it otherwise."""
    try:
        content = read_plain(path, _MAX_BYTES + 1)
        if len(content) > _MAX_BYTES:
            raise ConfigError(f"{path}: longer than {_MAX_BYTES} bytes: this is not a file of settings")
        return content.decode("utf-8-sig").replace("\r\n", "\n").replace("\r", "\n")
    except FileNotFoundError:
        raise ConfigError(f"{path}: no such file") from None
    except IsADirectoryError:
        raise ConfigError(f"{path}: this is a directory, a YAML file is expected") from None
    except UnicodeDecodeError as error:
        line = error.object.count(b"\n", 0, error.start) + 1
        column = error.start - (error.object.rfind(b"\n", 0, error.start) + 1) + 1
        raise ConfigError(f"{path}:{line}:{column}: not UTF-8 text; save the file as UTF-8") from None
    except (OSError, ValueError) as error:
        raise ConfigError(f"{path}: cannot be read ({reason_of(error)})") from None


def _syntax_finding(name: str, error: yaml.MarkedYAMLError) -> str:
    mark = error.problem_mark or error.context_mark
    line, column = (mark.line + 1, mark.column + 1) if mark is not None else (1, 1)
    context = f" ({error.context})" if error.context else ""
    return f"{name}:{line}:{column}: not valid YAML: {error.problem or 'syntax error'}{context}"


class _Builder:
    """Turns the node tree into plain data, keeps positions, collects findings instead of stopping at the first."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.values: dict[PathTuple, tuple[int, int]] = {}
        self.keys: dict[PathTuple, tuple[int, int]] = {(): (1, 1)}
        self.begins: dict[PathTuple, int] = {}
        self.findings: list[str] = []
        self.repeated: set[PathTuple] = set()
        self._count = 0

    def build(self, node: yaml.Node, path: PathTuple, parents: tuple[int, ...]) -> Any:
        """Plain data of `node`; `parents` are the ids of the nodes around it, to notice an alias of itself."""
        if id(node) in parents:
            return self._finding(node, "an alias contains itself")
        self._count += 1
        if self._count > _MAX_VALUES:
            if self._count == _MAX_VALUES + 1:
                self._finding(
                    node, f"more than {_MAX_VALUES} values, with aliases written out: too many for a file of settings"
                )
            return None
        if len(parents) > _MAX_DEPTH:
            return self._finding(node, f"lists or tables are nested more than {_MAX_DEPTH} deep")
        if not isinstance(node, yaml.MappingNode):
            self.values[path] = _position(node)
            self.begins[path] = node.start_mark.index
        if node.tag not in _KNOWN_TAGS:
            return self._finding(node, f"tag {node.tag!r} is not supported: remove it")
        if isinstance(node, yaml.MappingNode):
            return self._mapping(node, path, (*parents, id(node)))
        if isinstance(node, yaml.SequenceNode):
            return self._sequence(node, path, (*parents, id(node)))
        return self._scalar(node)

    def _mapping(self, node: yaml.MappingNode, path: PathTuple, parents: tuple[int, ...]) -> dict[Any, Any]:
        result: dict[Any, Any] = {}
        for key_node, value_node in node.value:
            if self._count > _MAX_VALUES:
                break
            key = self._key(key_node)
            if key is None:
                continue
            if key in result:
                first = self.keys[(*path, key)]
                self.repeated.add((*path, key))
                self._finding(key_node, f"key '{key}' is repeated (first on line {first[0]}): keep one of them")
                continue
            self.keys[(*path, key)] = _position(key_node)
            result[key] = self.build(value_node, (*path, key), parents)
        return result

    def _sequence(self, node: yaml.SequenceNode, path: PathTuple, parents: tuple[int, ...]) -> list[Any]:
        result = []
        for index, item in enumerate(node.value):
            if self._count > _MAX_VALUES:
                break
            self.keys[(*path, index)] = _position(item)
            result.append(self.build(item, (*path, index), parents))
        return result

    def _key(self, node: yaml.Node) -> str | int | None:
        if not isinstance(node, yaml.ScalarNode):
            self._finding(node, "a key must be plain text, not a list or table")
            return None
        if node.value == "<<" and not node.style:
            self._finding(node, "merge keys (<<) are not supported: write the keys out")
            return None
        key = self._scalar(node)
        if isinstance(key, int) and not isinstance(key, bool):
            return key
        return str(node.value)

    def _scalar(self, node: yaml.Node) -> Any:
        text = str(node.value)
        if node.tag == "tag:yaml.org,2002:str" and getattr(node, "style", None):
            return text  # quoted or block text is never a number
        if text in _CONSTANTS:
            return _CONSTANTS[text]
        if _INTEGER.fullmatch(text):
            return int(text) if len(text) <= _MAX_DIGITS else self._finding(node, "a number with too many digits")
        if _HEXADECIMAL.fullmatch(text):
            short = len(text) <= _MAX_HEXADECIMAL_DIGITS
            return int(text, 16) if short else self._finding(node, "a number with too many digits")
        if _FLOAT.fullmatch(text):
            value = float(text)
            return value if abs(value) != float("inf") else self._finding(node, f"{text} is too large for a number")
        if _NOT_FINITE.fullmatch(text):
            return self._finding(node, f"{text} is not a finite number: write a finite one, or null")
        return text

    def _finding(self, node: yaml.Node, message: str) -> None:
        line, column = _position(node)
        self.findings.append(f"{self.name}:{line}:{column}: {message}")


_KNOWN_TAGS = frozenset(f"tag:yaml.org,2002:{kind}" for kind in ("str", "map", "seq"))


def _position(node: yaml.Node) -> tuple[int, int]:
    """Line and column of a node, counted from 1."""
    return node.start_mark.line + 1, node.start_mark.column + 1
