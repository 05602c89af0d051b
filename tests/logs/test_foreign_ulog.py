"""ULog files are read."""

from __future__ import annotations

import struct
from pathlib import Path

import pytest

from tests.foreign_logs import Record, assert_same, assert_says_what_to_install, assert_survives_damage, read_with


def message(kind: bytes, body: bytes) -> bytes:
    """One message of the format: size, kind, body."""
    return struct.pack("<HB", len(body), kind[0]) + body


def save(path: Path, record: Record) -> Path:
    """A topic of speed and current, and one of temperatures by two sensors, byte by byte (the library cannot)."""
    data = b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 0)
    data += message(b"B", bytes(40))
    data += message(b"F", b"wheel:uint64_t timestamp;double w;double i;")
    data += message(b"F", b"heat:uint64_t timestamp;float T;")
    for number, (multi, name) in enumerate(((0, b"wheel"), (0, b"heat"), (1, b"heat"))):
        data += message(b"A", struct.pack("<BH", multi, number) + name)
    for row in range(60):
        values = (int(record.time_s[row] * 1e6), record.speed[row], record.current[row])
        data += message(b"D", struct.pack("<HQdd", 0, *values))
        if row % 4 == 0:
            for number in (1, 2):
                data += message(b"D", struct.pack("<HQf", number, values[0], 10.0 * number + row))
    data += message(b"O", struct.pack("<H", 40))
    path.write_bytes(data)
    return path


def test_round_trip(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Topics are joined, several of one name go by their number, and lost rows are said."""
    record = Record(1)
    path = save(tmp_path / "a.ulg", record)
    log = read_with(path, "speed_rad_s: wheel.w", "current_A: wheel.i", "temperature_degC: 'heat[1].T'")
    assert_same(log, record)
    assert log.channels["temperature_degC"][:5].tolist() == [20, 20, 20, 20, 24]
    assert "1 dropouts of 40 ms" in log.warnings[1]
    assert_same(read_with(path, "variable: wheel", "speed_rad_s: w", "current_A: i"), record)
    assert capsys.readouterr().out == ""


def test_damage_and_a_missing_library(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Neither ends in anything but a LogError, and the library prints nothing."""
    path = save(tmp_path / "a.ulg", Record(2))
    assert_says_what_to_install(monkeypatch, path, "pyulog", "ulog")
    assert_survives_damage(path, "speed_rad_s: wheel.w", "current_A: wheel.i")
    assert capsys.readouterr() == ("", "")
