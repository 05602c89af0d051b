"""CAN logs are decoded with the database that the map names."""

from __future__ import annotations

from pathlib import Path

import can
import cantools
import numpy as np
import pytest

from tests.foreign_logs import (
    Record,
    assert_says_what_to_install,
    assert_survives_damage,
    read_with,
    refusal,
)

DBC = """VERSION ""
NS_ :
BS_:
BU_: ECU
BO_ 256 Motion: 8 ECU
 SG_ w : 0|32@1- (0.001,0) [0|0] "rad/s" ECU
 SG_ i : 32|32@1- (0.001,0) [0|0] "A" ECU
BO_ 2566844672 Heat: 2 ECU
 SG_ T : 0|16@1- (0.1,0) [0|0] "degC" ECU
VAL_ 256 i 0 "off" ;
"""
MAP = ("dbc: wheel.dbc", "speed_rad_s: w", "current_A: i", "variable: Motion")


def save(path: Path, record: Record) -> Path:
    """Frames of both messages, one of a third, and one that carries nothing, by the library's own writer."""
    path.with_name("wheel.dbc").write_text(DBC)
    base = cantools.database.load_string(DBC, "dbc")
    record.speed, record.current = record.speed.round(3), record.current.round(3)
    with can.Logger(path) as log:
        for row, time in enumerate(record.time_s):
            data = base.encode_message("Motion", {"w": record.speed[row], "i": record.current[row]})
            log.on_message_received(can.Message(1.0 + time, 0x100, is_extended_id=False, data=data))
            if row % 20 == 0:
                heat = base.encode_message("Heat", {"T": 20.0 + row})
                identifier = base.get_message_by_name("Heat").frame_id
                log.on_message_received(can.Message(1.0 + time, identifier, is_extended_id=True, data=heat))
        log.on_message_received(can.Message(1.0 + time, 0x7FF, is_extended_id=False, data=b"\1"))
        log.on_message_received(can.Message(1.0 + time, 0x100, is_extended_id=False, is_remote_frame=True))
    return path


@pytest.mark.parametrize("suffix", [".asc", ".blf", ".log", ".trc"])
def test_round_trip(tmp_path: Path, suffix: str) -> None:
    """Signals are in their units, messages are joined, frames of no message are counted."""
    record = Record(1)
    path = save(tmp_path / f"a{suffix}", record)
    log = read_with(path, *MAP)
    assert np.allclose(np.diff(log.time_s), 0.25, atol=1e-6)
    record.time_s = log.time_s
    assert_same_to_a_thousandth(log.speed_rad_s, record.speed)
    assert_same_to_a_thousandth(log.current_A, record.current)
    assert any("1 frames (ids 0x7FF) are not in" in text for text in log.warnings)
    joined = read_with(path, MAP[0], "speed_rad_s: Motion.w", "current_A: Motion.i", "temperature_degC: Heat.T")
    assert joined.channels["temperature_degC"][::20].tolist() == [20, 40, 60]


def assert_same_to_a_thousandth(found: np.ndarray, meant: np.ndarray) -> None:
    """A frame holds whole thousandths."""
    assert np.array_equal((1000 * found).round(), (1000 * meant).round())
    assert np.allclose(found, meant, atol=1e-12)


def test_what_is_missing_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """No database, one that is not there, is none, or has other frames; and a library that is not installed."""
    path = save(tmp_path / "a.log", Record(2))
    (tmp_path / "wheel.dbc").unlink()
    assert "name it in the column map (`dbc: wheel.dbc`)" in refusal(path, *MAP[1:])
    assert "gone.dbc: no such file (`dbc`" in refusal(path, "dbc: gone.dbc", *MAP[1:])
    (tmp_path / "bad.dbc").write_text("this is no database")
    assert "is a CAN database that is damaged" in refusal(path, "dbc: bad.dbc", *MAP[1:])
    (tmp_path / "other.dbc").write_text(DBC.replace(" 256 ", " 512 ").replace("2566844672", "2566844673"))
    assert "none of its frames (ids 0x100, 0x18FEF100, 0x7FF) is in" in refusal(path, "dbc: other.dbc", *MAP[1:])
    assert_says_what_to_install(monkeypatch, path, "cantools", "can")


def test_of_the_databases_beside_a_log_the_one_that_knows_its_ids_is_taken(tmp_path: Path) -> None:
    """And said; where two know as many, neither is. One that is damaged is passed over."""
    path = save(tmp_path / "a.log", Record(4))
    (tmp_path / "bad.dbc").write_text("this is no database")
    (tmp_path / "other.dbc").write_text(DBC.replace(" 256 ", " 512 "))
    log = read_with(path, *MAP[1:])
    assert log.speed_rad_s[0] == pytest.approx(Record(4).speed[0], abs=1e-3)
    assert any("decoded by" in text and "wheel.dbc" in text for text in log.warnings)
    (tmp_path / "again.dbc").write_text(DBC)
    assert "beside it are again.dbc, bad.dbc, other.dbc, wheel.dbc" in refusal(path, *MAP[1:])


@pytest.mark.slow
@pytest.mark.parametrize("suffix", [".asc", ".blf", ".log"])
def test_damage(tmp_path: Path, suffix: str) -> None:
    """Ends in nothing but a LogError."""
    assert_survives_damage(save(tmp_path / f"a{suffix}", Record(3)), *MAP)
