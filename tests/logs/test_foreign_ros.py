"""MCAP and the bags of ROS are read, by topic."""

from __future__ import annotations

import json
import sqlite3
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.writer import CompressionType, Writer
from rosbags import rosbag1, rosbag2
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from tests.foreign_logs import (
    Record,
    assert_same,
    assert_says_what_to_install,
    assert_survives_damage,
    read_with,
    refusal,
)

STATE = "sensor_msgs/msg/JointState"
MAP = ("variable: /joints", "speed_rad_s: velocity", "current_A: effort")
CUSTOM = "float64 w\nfloat64 i\nfloat64[3] axis\nstring note\n"


def nanoseconds(record: Record) -> list[int]:
    """The record's times."""
    return [int(time * 1e9) for time in record.time_s]


def joint_state(store: Any, record: Record, row: int, names: tuple[str, ...] = ("wheel",)) -> Any:
    """A JointState of one joint or several alike, stamped a second late."""
    time, header = store.types["builtin_interfaces/msg/Time"], store.types["std_msgs/msg/Header"]
    stamp_ns = 1_000_000_000 + nanoseconds(record)[row]
    ros_1 = {"seq": row} if "seq" in header.__dataclass_fields__ else {}
    head = header(stamp=time(sec=stamp_ns // 10**9, nanosec=stamp_ns % 10**9), frame_id="", **ros_1)
    n = len(names)
    return store.types[STATE](
        header=head,
        name=list(names),
        position=np.zeros(n),
        velocity=np.full(n, record.speed[row]),
        effort=np.full(n, record.current[row]),
    )


def save_json(path: Path, record: Record, compression: CompressionType = CompressionType.ZSTD) -> Path:
    """An MCAP file of JSON messages, with a slow topic of a number in a list, and one of an unknown encoding."""
    with path.open("wb") as stream:
        writer = Writer(stream, compression=compression, chunk_size=2000)
        writer.start()
        schema = writer.register_schema("Wheel", "jsonschema", b"{}")
        fast = writer.register_channel("/wheel", "json", schema)
        slow = writer.register_channel("/heat", "json", schema)
        other = writer.register_channel("/picture", "protobuf", schema)
        for row, time in enumerate(nanoseconds(record)):
            state = {"w": record.speed[row], "drive": {"i": record.current[row]}, "ok": True, "note": "x"}
            writer.add_message(fast, time, json.dumps(state).encode(), time)
            if row % 10 == 0:
                writer.add_message(slow, time, json.dumps({"T": [20.0 + row, None]}).encode(), time)
        writer.add_message(other, time, b"\0", time)
        writer.finish()
    return path


@pytest.mark.parametrize("compression", list(CompressionType))
def test_mcap_of_json(tmp_path: Path, compression: CompressionType) -> None:
    """Fields go by their path, topics are joined, and what cannot be decoded is said."""
    record = Record(1)
    path = save_json(tmp_path / "a.mcap", record, compression)
    log = read_with(path, "speed_rad_s: /wheel.w", "current_A: /wheel.drive.i", "temperature_degC: '/heat.T[0]'")
    assert_same(log, record)
    assert log.channels["temperature_degC"][::10].tolist() == [20, 30, 40, 50, 60, 70]
    assert "/picture (protobuf) cannot be decoded" in log.warnings[1]
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) * 2 // 3])
    log = read_with(path, "variable: /wheel", "speed_rad_s: w", "current_A: drive.i")
    assert 10 < len(log) < 60
    assert "is damaged or cut off" in log.warnings[0]
    assert np.array_equal(log.speed_rad_s, record.speed[: len(log)])


def test_mcap_of_ros_2(tmp_path: Path) -> None:
    """A JointState and a type of the log's own are decoded by the definitions in the file; stamps are their times."""
    record = Record(2)
    store = get_typestore(Stores.ROS2_HUMBLE)
    store.register(get_types_from_msg(CUSTOM, "mine/msg/Wheel"))
    path = tmp_path / "a.mcap"
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start()
        kinds = {}
        for topic, kind in (("/joints", STATE), ("/two", STATE), ("/mine", "mine/msg/Wheel")):
            text = store.generate_msgdef(kind, ros_version=2)[0]
            schema = writer.register_schema(kind, "ros2msg", text.encode())
            kinds[topic] = writer.register_channel(topic, "cdr", schema)
        for row, time in enumerate(nanoseconds(record)):
            own = store.types["mine/msg/Wheel"](
                w=record.speed[row], i=record.current[row], axis=np.arange(3.0), note="x"
            )
            state, two = joint_state(store, record, row), joint_state(store, record, row, ("a", "b"))
            for topic, message, kind in (
                ("/joints", state, STATE),
                ("/two", two, STATE),
                ("/mine", own, "mine/msg/Wheel"),
            ):
                writer.add_message(kinds[topic], time, bytes(store.serialize_cdr(message, kind)), time)
        writer.finish()
    log = read_with(path, "variable: /mine", "speed_rad_s: w", "current_A: i")
    assert_same(log, record)
    assert log.other["axis[2]"].to_pylist()[0] == 2.0
    record.time_s = 1.0 + record.time_s
    assert_same(read_with(path, *MAP), record)
    assert_same(read_with(path, "variable: /two", "speed_rad_s: velocity.b", "current_A: effort.a"), record)


def save_bag(directory: Path, record: Record, unknown: bool = False) -> Path:
    """A rosbag2 with one file, as the recorder names it."""
    store = get_typestore(Stores.ROS2_HUMBLE)
    with rosbag2.Writer(directory, version=8) as bag:
        connection = bag.add_connection("/joints", STATE, typestore=store)
        for row, time in enumerate(nanoseconds(record)):
            bag.write(connection, time, store.serialize_cdr(joint_state(store, record, row), STATE))
    path = next(directory.glob("*.db3"))
    if unknown:
        with sqlite3.connect(path) as base:
            base.execute("UPDATE topics SET type = 'mine/msg/Wheel'")
        base.close()
    return path


def test_rosbag_2(tmp_path: Path) -> None:
    """Standard types need no definition; the file is not written to; one of an unknown type is refused."""
    record = Record(3)
    path = save_bag(tmp_path / "bag", record)
    before = path.read_bytes()
    log = read_with(path, *MAP)
    record.time_s = 1.0 + record.time_s
    assert_same(log, record)
    assert path.read_bytes() == before
    path.with_name("bag_1.db3").write_bytes(before)
    assert "is one of 2 files of a bag: " in read_with(path, *MAP).warnings[-1]
    path.with_name("bag_1.db3").unlink()
    assert_same(read_with(path.parent, *MAP), record)
    unknown = save_bag(tmp_path / "unknown", record, unknown=True)
    assert "/joints (mine/msg/Wheel): no definition of this type is at hand" in refusal(unknown, *MAP)
    with sqlite3.connect(tmp_path / "a.db") as base:
        base.execute("CREATE TABLE t (x)")
    base.close()
    assert "holds no table with rows" in refusal(tmp_path / "a.db", *MAP)


@pytest.mark.slow
def test_rosbag_1(tmp_path: Path) -> None:
    """A bag of ROS 1 is decoded by the definitions that it holds."""
    record = Record(4)
    store = get_typestore(Stores.ROS1_NOETIC)
    path = tmp_path / "a.bag"
    with rosbag1.Writer(path) as bag:
        connection = bag.add_connection("/joints", STATE, typestore=store)
        for row, time in enumerate(nanoseconds(record)):
            bag.write(connection, time, store.serialize_ros1(joint_state(store, record, row), STATE))
    log = read_with(path, *MAP)
    record.time_s = 1.0 + record.time_s
    assert_same(log, record)
    assert "has no '/gone'" in refusal(path, "variable: /gone", *MAP[1:])
    assert_survives_damage(path, *MAP)


@pytest.mark.slow
def test_damage_and_a_missing_library(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Neither ends in anything but a LogError."""
    path = save_json(tmp_path / "a.mcap", Record(5))
    assert_says_what_to_install(monkeypatch, path, "mcap", "ros")
    assert_survives_damage(path, "speed_rad_s: /wheel.w", "current_A: /wheel.drive.i")
    path = save_bag(tmp_path / "bag", Record(5))
    assert_says_what_to_install(monkeypatch, path, "rosbags.typesys", "ros")
    assert_survives_damage(path, *MAP)
