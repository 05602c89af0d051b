"""TDMS and LVM, as LabVIEW writes them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from nptdms import ChannelObject, TdmsWriter

import rw_ekf
from tests.foreign_logs import (
    Record,
    assert_same,
    assert_says_what_to_install,
    assert_survives_damage,
    read_with,
    refusal,
)

LVM_HEAD = (
    "LabVIEW Measurement\t\nWriter_Version\t2\nReader_Version\t2\nSeparator\tTab\nDecimal_Separator\t{point}\n"
    "Multi_Headings\tYes\nX_Columns\t{columns}\nTime_Pref\tRelative\nDate\t2024/05/01\nTime\t12:00:00.5\n"
    "***End_of_Header***\t\n\t\n"
)
LVM_BLOCK = (
    "Channels\t2\t\t\nSamples\t{rows}\t{rows}\t\nDate\t2024/05/01\t2024/05/01\t\nX_Dimension\tTime\tTime\t\n"
    "X0\t{begin}\t{begin}\t\nDelta_X\t0.25\t0.25\t\n***End_of_Header***\t\t\t\nX_Value\tw\ti\tComment\n"
)
MAP = ("time_s: X_Value", "speed_rad_s: w", "current_A: i")


def lvm(record: Record, columns: str = "One", point: str = ".", blocks: int = 2, anew: bool = False) -> str:
    """The text of a record in blocks, whose times go on or begin anew."""
    text = LVM_HEAD.format(point=point, columns=columns)
    for block in range(blocks):
        part = slice(block * 60 // blocks, (block + 1) * 60 // blocks)
        time_s = record.time_s[part] - (record.time_s[part][0] if anew else 0.0)
        text += LVM_BLOCK.format(rows=60 // blocks, begin=time_s[0])
        for row, (t, w, i) in enumerate(zip(time_s, record.speed[part], record.current[part], strict=True)):
            cells = ["" if columns == "No" else repr(float(t)), repr(float(w)), repr(float(i))]
            text += "\t".join(cells).replace(".", point) + ("\tbegun" if row == 0 else "") + "\n"
        text += "\n"
    return text


def save(path: Path, record: Record, waveform: bool) -> Path:
    """A fast group with or without a waveform's step, and a slow one with a channel of time stamps."""
    begun = np.datetime64("2024-05-01T12:00:00", "us")
    step = {"wf_increment": 0.25, "wf_start_offset": 0.0, "wf_start_time": begun} if waveform else {}
    stamps = begun + (1 + np.arange(10)) * np.timedelta64(1, "s")
    with TdmsWriter(path) as writer:
        channels = [ChannelObject("fast", "w", record.speed, step), ChannelObject("fast", "i", record.current, step)]
        if not waveform:
            channels.append(ChannelObject("fast", "Time", record.time_s))
        writer.write_segment(channels)
        writer.write_segment([ChannelObject("slow", "at", stamps), ChannelObject("slow", "T", np.arange(10.0))])
    return path


@pytest.mark.parametrize("waveform", [True, False])
def test_tdms_round_trip(tmp_path: Path, waveform: bool) -> None:
    """Time comes from the waveform's step or from the channel of that name, and groups are joined."""
    record = Record(1)
    path = save(tmp_path / "a.tdms", record, waveform)
    log = read_with(path, "speed_rad_s: fast.w", "current_A: fast.i", "temperature_degC: slow.T")
    assert_same(log, record)
    late = 4 if waveform else 0  # only a waveform has a date, by which the groups can be put beside each other
    assert np.isnan(log.channels["temperature_degC"][:late]).all()
    assert log.channels["temperature_degC"][late : late + 5].tolist() == [0, 0, 0, 0, 1]
    assert_same(read_with(path, "variable: fast", "speed_rad_s: w", "current_A: i"), record)


def test_tdms_channels_of_two_rates_in_one_group(tmp_path: Path) -> None:
    """They are taken apart, and joined like groups."""
    record = Record(2)
    path = tmp_path / "a.tdms"
    fast, slow = {"wf_increment": 0.25}, {"wf_increment": 0.5}
    with TdmsWriter(path) as writer:
        writer.write_segment([
            ChannelObject("g", "w", record.speed, fast),
            ChannelObject("g", "i", record.current, fast),
            ChannelObject("g", "T", np.arange(30.0), slow),
        ])  # fmt: skip
    log = read_with(path, "speed_rad_s: g/w.w", "current_A: g/w.i", "temperature_degC: g/T.T")
    assert_same(log, record)
    assert log.channels["temperature_degC"].tolist() == np.repeat(np.arange(30.0), 2).tolist()


def test_tdms_damage_and_a_missing_library(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Neither ends in anything but a LogError."""
    path = save(tmp_path / "a.tdms", Record(3), waveform=True)
    assert_says_what_to_install(monkeypatch, path, "nptdms", "tdms")
    assert_survives_damage(path, "speed_rad_s: fast.w", "current_A: fast.i")


@pytest.mark.parametrize("columns", ["One", "No"])
@pytest.mark.parametrize("point", [".", ","])
def test_lvm_blocks_are_one_log(tmp_path: Path, columns: str, point: str) -> None:
    """Two headers, a remark, a decimal comma and times that are only a step are no obstacle."""
    record = Record(4)
    path = tmp_path / "a.lvm"
    path.write_text(lvm(record, columns, point))
    log = read_with(path, *MAP)
    assert_same(log, record)
    assert set(log.segment) == {0}


def test_lvm_times_that_begin_anew_are_segments(tmp_path: Path) -> None:
    """Each block is then a segment of its own."""
    path = tmp_path / "a.lvm"
    path.write_text(lvm(Record(5), anew=True))
    log = read_with(path, *MAP)
    assert log.segment.tolist() == [0] * 30 + [1] * 30
    assert log.time_s[30] == 0.0


def test_lvm_mistakes_have_their_line(tmp_path: Path) -> None:
    """A text among numbers, other columns, no rows: each is said; damage ends in nothing but a LogError."""
    path = tmp_path / "a.lvm"
    whole = lvm(Record(6))
    row = whole.splitlines()[25]
    time, _, current = row.split("\t")
    path.write_text(whole.replace(row, f"{time}\toops\t{current}"))
    assert "line 26, column 'w': 'oops' is not a number" in refusal(path, *MAP)
    path.write_text("\tspeed\t".join(whole.rsplit("\tw\t", 1)))
    assert "a block has other columns (X_Value, speed, i) than the first" in refusal(path, *MAP)
    path.write_text(whole[: whole.rindex("***End_of_Header***")].split("X_Value")[0])
    assert "has a header but no rows" in refusal(path, *MAP)
    path.write_text(whole)
    assert_survives_damage(path, *MAP)


def test_a_property_that_scales_a_channel_is_asked_about(tmp_path: Path) -> None:
    """What somebody wrote beside a channel, `scale = 0.1`, is heard; LabVIEW's own scales are applied, and are not."""
    record = Record(2)
    for key, wanted in (("scale", True), ("NI_Scale_Note", False)):
        stated = {"wf_increment": 0.25, "unit_string": "rpm", key: 0.1}
        with TdmsWriter(tmp_path / "a.tdms") as writer:
            current = ChannelObject("g", "current", record.current, {"wf_increment": 0.25, "unit_string": "A"})
            writer.write_segment([ChannelObject("g", "speed", np.round(record.speed * 300.0), stated), current])
        found = rw_ekf.guess_columns(tmp_path / "a.tdms")
        assert any("scale: 0.1" in question.text for question in found.guess.questions) == wanted


def test_lvm_units_stand_above_their_columns(tmp_path: Path) -> None:
    """Where each channel has times of its own, a unit is that of the column below it, and of no other."""
    record = Record(5)
    head = LVM_HEAD.format(point=",", columns="Multi") + "Channels\t3\nY_Unit_Label\trpm\t\tV\t\tA\t\n"
    text = head + "***End_of_Header***\t\nX_Value\tTacho\tX_Value\tBoard\tX_Value\tStromzange\tComment\n"
    for t, w, i in zip(record.time_s, record.speed, record.current, strict=True):
        text += "\t".join(f"{float(number)!r}" for number in (t, w, t, 5.0, t, i)).replace(".", ",") + "\n"
    (tmp_path / "a.lvm").write_text(text)
    found = rw_ekf.guess_columns(tmp_path / "a.lvm").guess.mapping()
    assert found["speed_rpm"] == {"column": "Tacho"}
    assert found["current_A"] == {"column": "Stromzange"}
