"""MCAP, with messages of JSON or ROS."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from rw_ekf.errors import LogError
from rw_ekf.logs.column_map import ColumnMap
from rw_ekf.logs.foreign.format_library import Library, foreign_format, require
from rw_ekf.logs.foreign.groups import table_of_groups
from rw_ekf.logs.foreign.ros_messages import Topic
from rw_ekf.logs.foreign.ros_types import Decoder, Wire, decoders
from rw_ekf.logs.raw_table import RawTable

_KIND = "an MCAP file"
_ROS: dict[tuple[str, str], Wire] = {("cdr", "ros2msg"): "cdr", ("ros1", "ros1msg"): "ros1"}
_LARGEST = 2**31  # bytes of one record


def _read(path: Path, name: str, columns: ColumnMap) -> RawTable:
    """Topics as groups. A file that is cut off is read up to there, with a warning.

    Raises LogError if no topic is of a kind that can be decoded.
    """
    reader = _Reader(name)
    torn = reader.read(path)
    if torn is not None and not reader.topics:
        raise torn
    if reader.left_out and not reader.topics:
        raise LogError(f"{name}: holds nothing but {reader.stated()}: JSON and ROS messages can be read")
    table = table_of_groups([topic.group() for topic in reader.topics.values()], columns, name)
    if torn is not None:
        table.warnings.append(f"{name}: is damaged or cut off ({torn}): what stands before that was read")
    if reader.left_out:
        table.warnings.append(f"{name}: {reader.stated()} cannot be decoded and were left out")
    return table


class _Reader:
    """Gathers the messages of a file, topic by topic."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.topics: dict[str, Topic] = {}
        self.left_out: dict[str, str] = {}  # topic -> encoding
        self._schemas: dict[int, Any] = {}
        self._channels: dict[int, Any] = {}
        self._decoders: dict[int, Decoder | None] = {}

    def read(self, path: Path) -> Exception | None:
        """Read to the end, or to what cannot be read, which is returned. Raises LogError for a missing library."""
        from mcap.records import Channel, Message, Schema
        from mcap.stream_reader import StreamReader

        with path.open("rb") as stream:
            try:
                for record in StreamReader(stream, validate_crcs=True, record_size_limit=_LARGEST).records:
                    if isinstance(record, Schema):
                        self._schemas[record.id] = record
                    elif isinstance(record, Channel):
                        self._channels[record.id] = record
                    elif isinstance(record, Message):
                        self._add(record)
            except LogError:
                raise
            except Exception as error:  # noqa: BLE001 - whatever the damage leads to
                return error
        return None

    def stated(self) -> str:
        """Topics that cannot be decoded."""
        return ", ".join(f"{topic} ({encoding or 'no encoding'})" for topic, encoding in self.left_out.items())

    def _add(self, record: Any) -> None:
        channel = self._channels[record.channel_id]
        if record.channel_id not in self._decoders:
            self._decoders[record.channel_id] = self._decoder(channel)
        decode = self._decoders[record.channel_id]
        if decode is None:
            self.left_out[channel.topic] = channel.message_encoding
            return
        if channel.topic not in self.topics:
            schema = self._schemas.get(channel.schema_id)
            kind = "" if schema is None else schema.name
            self.topics[channel.topic] = Topic(channel.topic, kind, _descriptions(schema))
        self.topics[channel.topic].add(record.log_time, decode(record.data))

    def _decoder(self, channel: Any) -> Decoder | None:
        """What decodes a channel's messages; None if nothing does."""
        if channel.message_encoding == "json":
            return json.loads
        schema = self._schemas.get(channel.schema_id)
        wire = _ROS.get((channel.message_encoding, "" if schema is None else schema.encoding))
        if wire is None or schema is None:
            return None
        require("rosbags.typesys", "ros", self.name, f"{_KIND} of ROS messages")
        kind = schema.name if "/msg/" in schema.name else schema.name.replace("/", "/msg/")
        return decoders({kind: schema.data.decode("utf-8")}, wire)(kind)


def _descriptions(schema: Any) -> dict[str, str]:
    """What a JSON schema says of its values, by path."""
    if schema is None or schema.encoding != "jsonschema":
        return {}
    try:
        return dict(_described(json.loads(schema.data), ""))
    except (ValueError, AttributeError, RecursionError):
        return {}


def _described(schema: Any, path: str) -> Iterator[tuple[str, str]]:
    for key, inner in schema.get("properties", {}).items():
        text = " ".join(str(inner[word]) for word in ("title", "description", "unit", "units") if word in inner)
        if text:
            yield f"{path}{key}", text
        yield from _described(inner, f"{path}{key}.")


FORMAT = foreign_format(
    _KIND,
    lambda head, suffix: head.startswith(b"\x89MCAP"),
    "the first bytes '\\x89MCAP'",
    _read,
    Library("ros", ("mcap",)),
    "export it as CSV",
)
