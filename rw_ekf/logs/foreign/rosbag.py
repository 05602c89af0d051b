"""Bags of ROS: rosbag2 in SQLite (.db3), and the one file of ROS 1."""

from __future__ import annotations

import sqlite3
from pathlib import Path
from typing import Any

from rw_ekf.errors import LogError
from rw_ekf.logs.column_map import ColumnMap
from rw_ekf.logs.foreign.database import of_sqlite
from rw_ekf.logs.foreign.format_library import Library, foreign_format
from rw_ekf.logs.foreign.groups import table_of_groups
from rw_ekf.logs.foreign.ros_messages import Topic
from rw_ekf.logs.foreign.ros_types import Decoder, decoders
from rw_ekf.logs.raw_table import RawTable

_SQLITE = b"SQLite format 3\0"


def _read_2(path: Path, name: str, columns: ColumnMap) -> RawTable:
    """Topics of one .db3 file as groups; those of a type that is not known are left out with a word."""
    # Read-only, and no journal beside it is looked for: a log is never written to.
    connection = sqlite3.connect(f"{path.absolute().as_uri()}?mode=ro&immutable=1", uri=True)
    try:
        if not _names(connection) >= {"topics", "messages"}:
            return of_sqlite(path, name, columns)
        definitions = {}
        if "message_definitions" in _names(connection):
            rows = connection.execute(
                "SELECT topic_type, encoding, encoded_message_definition FROM message_definitions"
            )
            definitions = {kind: text for kind, encoding, text in rows if encoding == "ros2msg"}
        topics = connection.execute("SELECT id, name, type, serialization_format FROM topics").fetchall()
        make = decoders(definitions, "cdr")
        found = {number: (Topic(topic, kind), _made(make, kind, form)) for number, topic, kind, form in topics}
        for number, time_ns, data in connection.execute(
            "SELECT topic_id, timestamp, data FROM messages ORDER BY timestamp"
        ):
            topic, decode = found[number]
            if decode is not None:
                topic.add(time_ns, decode(data))
    finally:
        connection.close()
    unknown = [f"{topic} ({kind})" for number, topic, kind, _ in topics if found[number][1] is None]
    return _table([topic for topic, _ in found.values()], unknown, columns, name)


def _names(connection: sqlite3.Connection) -> set[str]:
    return {row[0] for row in connection.execute("SELECT name FROM sqlite_master WHERE type = 'table'")}


def _made(make: Any, kind: str, form: str) -> Decoder | None:
    try:
        return make(kind) if form == "cdr" else None
    except KeyError:
        return None


def _read_1(path: Path, name: str, columns: ColumnMap) -> RawTable:
    """Topics of a bag of ROS 1 as groups, by the definitions that it holds."""
    from rosbags.rosbag1 import Reader

    with Reader(path) as bag:
        made: dict[str, Decoder] = {}
        topics: dict[str, Topic] = {}
        for connection, time_ns, data in bag.messages():
            kind = connection.msgtype
            if kind not in made:
                made[kind] = decoders({kind: str(connection.msgdef.data)}, "ros1")(kind)
            topics.setdefault(connection.topic, Topic(connection.topic, kind)).add(time_ns, made[kind](data))
    return _table(list(topics.values()), [], columns, name)


def _table(topics: list[Topic], unknown: list[str], columns: ColumnMap, name: str) -> RawTable:
    """Raises LogError if there is nothing but topics of unknown types."""
    topics = [topic for topic in topics if topic.rows]
    left_out = f"{', '.join(unknown)}: no definition of this type is at hand"
    if unknown and not topics:
        raise LogError(f"{name}: {left_out}: record it as MCAP, which holds the definitions")
    table = table_of_groups([topic.group() for topic in topics], columns, name)
    if unknown:
        table.warnings.append(f"{name}: {left_out}, and they were left out")
    return table


FORMAT = foreign_format(
    "a bag of ROS 2",
    lambda head, suffix: head.startswith(_SQLITE),
    "the first bytes of SQLite",
    _read_2,
    Library("ros", ("rosbags.typesys",)),
    "record it as CSV",
)
ROS_1 = foreign_format(
    "a bag of ROS 1",
    lambda head, suffix: head.startswith(b"#ROSBAG V2.0"),
    "the first words '#ROSBAG V2.0'",
    _read_1,
    Library("ros", ("rosbags.rosbag1", "rosbags.typesys")),
    "export its topic as CSV",
)
