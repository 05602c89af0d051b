"""A log in parts is the log: joined, compressed, torn, read while it is compressed."""

from __future__ import annotations

import gzip
import os
import shutil
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest

from rw_ekf.errors import BadInputError, EmptyLogError, LogError
from rw_ekf.logs import reader
from rw_ekf.logs.formats import format_of
from rw_ekf.logs.log_format import LogFormat
from rw_ekf.logs.metadata import metadata_path
from rw_ekf.logs.part_compression import pack, packed_path
from rw_ekf.logs.parts import PartName, part_path, parts_of
from rw_ekf.logs.reader import read_log
from rw_ekf.logs.wheel_log import WheelLog
from rw_ekf.logs.writer import SampleWriter
from rw_ekf.records import IssuedCommand, WheelSample


def write(path: Path, rows: range, *, segment: int = 0) -> None:
    """Rows of a wheel, some without a speed, some without a current: it is held, over the end of a part too."""
    with SampleWriter(path) as writer:
        for i in rows:
            speed = None if i % 7 == 3 else 1.0 / (i + 1)
            command = None if i % 5 == 0 else IssuedCommand(0.01 * i, 0.002 * (i % 3))
            writer.write(WheelSample(0.1 * i, speed, segment=segment + (i > 33)), command)


def same(one: WheelLog, two: WheelLog) -> bool:
    """Whether two logs hold the same numbers in every array."""
    arrays = ("time_s", "speed_rad_s", "current_A", "command_delay_s", "segment")
    pairs = [(getattr(one, name), getattr(two, name)) for name in arrays]
    pairs += [(values, two.channels[name]) for name, values in one.channels.items()]
    return all(np.array_equal(a, b, equal_nan=True) for a, b in pairs)


@pytest.fixture
def whole(tmp_path: Path) -> WheelLog:
    """Fifty rows in one file."""
    write(tmp_path / "whole.csv", range(50))
    return read_log(tmp_path / "whole.csv")


@pytest.fixture
def run(tmp_path: Path) -> Path:
    """The same rows in four parts, the last of them begun and no more."""
    first = tmp_path / "run.csv"
    for number, rows in enumerate((range(20), range(20, 31), range(31, 50), range(0)), start=1):
        write(part_path(first, number), rows)
    return first


def test_the_names_of_parts_are_taken_apart() -> None:
    """Run, number, kind and form come out of a name; what can be no part of a run gives none."""
    assert PartName.of("a.b.csv") == PartName("a.b", 1, False, ".csv")
    assert PartName.of("a.part012.estimates.csv.zst") == PartName("a", 12, True, ".csv.zst")
    assert PartName.of("a.part1000.parquet") == PartName("a", 1000, False, ".parquet")
    assert PartName.of("a.mat") is None
    assert part_path(Path("x/a.estimates.csv"), 2) == Path("x/a.part002.estimates.csv")
    assert part_path(Path("x/a.csv"), 1) == Path("x/a.csv")
    assert metadata_path("x/a.part002.csv.zst") == metadata_path("x/a.csv") == Path("x/a.meta.yaml")


def test_parts_read_as_the_unrotated_log(run: Path, whole: WheelLog) -> None:
    """Speeds, held currents, delays and segments are those of one file, and a part begun and no more does no harm."""
    joined = read_log(run)
    assert same(joined, whole)
    assert joined.name == str(run)
    assert joined.warnings == tuple(text.replace("whole.csv", "run.csv") for text in whole.warnings)
    assert len(read_log(part_path(run, 2))) == 11


def test_parts_in_every_form_read_as_the_unrotated_log(run: Path, whole: WheelLog) -> None:
    """zstd, gzip and Parquet in one run, the first part's plain file gone: STEM.csv still names them all."""
    pack(run)
    second, third = part_path(run, 2), part_path(run, 3)
    with gzip.open(f"{second}.gz", "wb") as stream:
        stream.write(second.read_bytes())
    second.unlink()
    read_log(third).save(third.with_suffix(".parquet"))
    third.unlink()
    assert not run.exists()
    joined = read_log(run)
    for name in ("time_s", "speed_rad_s", "current_A", "segment"):
        assert np.array_equal(getattr(joined, name), getattr(whole, name), equal_nan=True)


def test_a_part_both_plain_and_compressed_counts_once(run: Path, whole: WheelLog) -> None:
    """A crash between the compressed file and the removal of the plain one doubles nothing."""
    copy = run.with_name("copy")
    shutil.copy(run, copy)
    pack(run)
    shutil.copy(copy, run)
    assert same(read_log(run), whole)


def test_a_part_alone_and_parts_that_are_missing_are_said(run: Path) -> None:
    """Naming one compressed part reads that part and says there are others; a lost one is named."""
    pack(run)
    alone = read_log(packed_path(run))
    assert len(alone) == 20
    assert "is part 1 of 4 of a run" in alone.warnings[0]
    part_path(run, 2).unlink()
    joined = read_log(run)
    assert len(joined) == 39
    assert f"{run}: part 2 of the run is not there: what it held is missing" in joined.warnings


def test_a_compressed_log_cut_anywhere_reads_to_the_last_whole_line(tmp_path: Path) -> None:
    """Both packings, cut at many places: whole rows and a warning, or one sentence where not a line is left."""
    plain = tmp_path / "log.csv"
    write(plain, range(20_000))
    rows = read_log(plain)
    for packing, ending in (("gzip", "gz"), ("zstd", "zst")):
        path = tmp_path / f"cut.csv.{ending}"
        with pa.output_stream(str(path), compression=packing) as stream:
            stream.write(plain.read_bytes())
        packed = path.read_bytes()
        read = []
        for share in (0.001, 0.3, 0.6, 0.9, 0.999):
            path.write_bytes(packed[: int(share * len(packed))])
            if share < 0.01:
                with pytest.raises(EmptyLogError, match="damaged or incomplete"):
                    read_log(path)
                continue
            found = read_log(path)
            assert "damaged or incomplete compressed file" in found.warnings[0]
            n = len(found)
            assert np.array_equal(found.speed_rad_s, rows.speed_rad_s[:n], equal_nan=True)
            read.append(n)
        assert read == sorted(read)
        assert read[-1] > 0.9 * len(rows)


def test_an_error_in_a_part_names_the_part_and_its_line(run: Path) -> None:
    """Text where a number belongs, in a compressed part and in a plain one; and parts with other columns."""
    second = part_path(run, 2)
    lines = second.read_text().splitlines()
    second.write_text("\n".join([*lines[:3], lines[3].replace(",", ",oops", 1), *lines[4:]]) + "\n")
    with pytest.raises(LogError, match=r"run\.part002\.csv: line 4, column 'speed_rad_s'"):
        read_log(run)
    pack(second)
    with pytest.raises(LogError, match=r"run\.part002\.csv\.zst: line 4, column 'speed_rad_s'"):
        read_log(run)
    packed_path(second).unlink()
    second.write_text("time_s,speed_rpm,current_A\n2.0,1,0\n")
    with pytest.raises(LogError, match="has other columns"):
        read_log(run)


def test_packing_keeps_the_plain_part_unless_the_packed_one_is_whole(tmp_path: Path) -> None:
    """A name that is taken, or a place without room, leaves the plain part and no file beside it."""
    part = tmp_path / "run.csv"
    write(part, range(50))
    packed_path(part).write_bytes(b"someone's")
    with pytest.raises(BadInputError, match="is not overwritten"):
        pack(part)
    assert part.exists()
    assert packed_path(part).read_bytes() == b"someone's"
    packed_path(part).unlink()
    with pytest.raises(BadInputError, match=r"none\.csv"):
        pack(tmp_path / "none.csv")
    assert [path.name for path in tmp_path.iterdir()] == ["run.csv"]
    pack(part)
    assert [path.name for path in tmp_path.iterdir()] == ["run.csv.zst"]
    assert parts_of(part).files == (packed_path(part),)


def test_a_part_whose_name_is_no_utf_8_is_packed_like_any_other(tmp_path: Path) -> None:
    """A folder, or a wheel, with a name of another encoding: the packed part takes the plain one's place."""
    part = tmp_path / os.fsdecode(b"gr\xf6sse.csv")
    write(part, range(50))
    pack(part)
    assert list(tmp_path.iterdir()) == [packed_path(part)]
    assert len(read_log(part)) == 50


def test_a_part_that_is_compressed_while_it_is_read_is_read(
    run: Path, whole: WheelLog, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The daemon replaces the second part just after the reader has looked what kind of file it is."""
    second, kind_of = part_path(run, 2), format_of

    def replaced_meanwhile(path: Path, name: str) -> LogFormat:
        kind = kind_of(path, name)
        if path == second:
            pack(second)
        return kind

    monkeypatch.setattr(reader, "format_of", replaced_meanwhile)
    assert same(read_log(run), whole)
    assert not second.exists()
