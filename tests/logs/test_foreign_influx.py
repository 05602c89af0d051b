"""Exports of InfluxDB are read."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.foreign_logs import Record, assert_same, assert_survives_damage, read_with, refusal

MAP = ("speed_rad_s: w", "current_A: i")
BEGIN_NS = 1_700_000_000_000_000_000


def expected(record: Record) -> Record:
    """The record as it was measured from that second on."""
    record.time_s = 1_700_000_000.0 + record.time_s
    return record


def points(record: Record, unit_ns: int = 1) -> list[str]:
    """A line for each row, times in a unit of so many nanoseconds."""
    times = (BEGIN_NS + (1e9 * record.time_s).astype(np.int64)) // unit_ns
    rows = zip(times.tolist(), record.speed.tolist(), record.current.tolist(), strict=True)
    return [f'wheel,unit=a\\ b w={w!r},i={i!r},on=true,n=3i,note="a, \\"b\\" c=d" {t}' for t, w, i in rows]


@pytest.mark.parametrize("unit_ns", [1, 1000, 1_000_000])
def test_the_line_protocol(tmp_path: Path, unit_ns: int) -> None:
    """Tags, texts, truth, whole numbers and comments are understood, and times by their size."""
    record = Record(1)
    path = tmp_path / "a.txt"
    path.write_text("# DML\nCREATE DATABASE x\n" + "\n".join(points(record, unit_ns)) + "\n")
    log = read_with(path, *MAP)
    assert_same(log, expected(record))
    assert log.other["on"].to_pylist()[0] == 1.0
    assert log.other["n"].to_pylist()[0] == 3.0


def test_a_line_for_each_field_and_several_series(tmp_path: Path) -> None:
    """Fields of one time are one row, whatever the order; series of other tags are groups of their own."""
    record = Record(2)
    lines = [line.replace("wheel,unit=a\\ b", "wheel,id=1").split(",on=")[0] for line in points(record)]
    times = [line.split()[-1] for line in points(record)]
    fields = [line.split(" ")[1].split(",") for line in lines]
    text = [f"wheel,id=1 {pair[0]} {t}" for pair, t in zip(fields, times, strict=True)][::-1]
    text += [f"wheel,id=1 {pair[1]} {t}" for pair, t in zip(fields, times, strict=True)]
    text += [f"wheel,id=2 w=0 {t}" for t in times[:9]]
    path = tmp_path / "a.lp"
    path.write_text("\n".join(text))
    log = read_with(path, "variable: 'wheel,id=1'", *MAP)
    assert_same(log, expected(record))
    assert "it holds 2 groups (wheel,id=1, wheel,id=2)" in refusal(path, "variable: wheel", *MAP)


def test_lines_without_times(tmp_path: Path) -> None:
    """Each is a row, to which the map gives the rate."""
    record = Record(3)
    path = tmp_path / "a.lp"
    path.write_text("\n".join(line.rsplit(" ", 1)[0] for line in points(record)))
    assert_same(read_with(path, "rate_hz: 4", *MAP), record)


def annotated(record: Record, wide: bool) -> str:
    """Annotated CSV: a table for each field, or one with a column for each."""
    stamps = [str(np.datetime64(BEGIN_NS + int(1e9 * t), "ns")).rstrip("0").rstrip(".") + "Z" for t in record.time_s]
    if wide:
        head = "#datatype,string,long,dateTime:RFC3339,double,double,string\n,result,table,_time,w,i,id\n"
        rows = zip(stamps, record.speed.tolist(), record.current.tolist(), strict=True)
        return head + "".join(f",_r,0,{t},{w!r},{i!r},x\n" for t, w, i in rows)
    text = ""
    for number, (field, values) in enumerate((("w", record.speed), ("i", record.current))):
        text += (
            "#group,false,false,false,false,true,true\n#datatype,string,long,dateTime:RFC3339,double,string,string\n"
        )
        text += "#default,_result,,,,,\n,result,table,_time,_value,_field,_measurement\n"
        text += "".join(f",,{number},{t},{v!r},{field},wheel\n" for t, v in zip(stamps, values.tolist(), strict=True))
        text += "\n"
    return text


@pytest.mark.parametrize("wide", [True, False])
def test_annotated_csv(tmp_path: Path, wide: bool) -> None:
    """A table for each field is turned into rows; one with a column for each is read as it is."""
    record = Record(4)
    path = tmp_path / "a.csv"
    path.write_text(annotated(record, wide))
    assert_same(read_with(path, *MAP), expected(record))


def test_a_heading_is_no_point(tmp_path: Path) -> None:
    """A CSV log below a line like `sample rate=100` is CSV."""
    path = tmp_path / "a.csv"
    path.write_text("sample rate=100\ntime_s,w,i\n0,1,2\n1,1,2\n")
    assert len(read_with(path, "skip_rows: 1", *MAP)) == 2


def test_mistakes_and_damage(tmp_path: Path) -> None:
    """A line that is no point and a time that is none have their place; damage ends in nothing but a LogError."""
    path = tmp_path / "a.lp"
    lines = points(Record(5))
    path.write_text("\n".join([*lines[:5], "what is this", *lines[5:]]))
    assert "line 6: is no point of the line protocol" in refusal(path, *MAP)
    path.write_text("\n".join(lines))
    assert_survives_damage(path, *MAP)
    path = tmp_path / "a.csv"
    text = annotated(Record(5), wide=True)
    path.write_text(text.replace("2023-11-14T22:13:21Z", "yesterday"))
    assert "record 7: Invalid isoformat string: 'yesterday'" in refusal(path, *MAP)
    path.write_text(text)
    assert_survives_damage(path, *MAP)
