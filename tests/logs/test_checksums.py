"""A run's files carry checksums: what is flipped, cut, edited or lost in them is named; nothing changes in silence."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from rw_ekf.errors import LogError
from rw_ekf.logs.checksums import changed, sums_path
from rw_ekf.logs.part_compression import pack, packed_path
from rw_ekf.logs.parts import part_path
from rw_ekf.logs.reader import read_log
from rw_ekf.logs.writer import SampleWriter
from rw_ekf.records import IssuedCommand, WheelSample
from tools.measure.flipped_bits import flip_often, made_run

PART_ROWS = 400


@pytest.fixture
def run(tmp_path: Path) -> Path:
    """A run of 1600 rows in four parts, a checksum for every fifty rows, the first three compressed."""
    first = tmp_path / "run.csv"
    for number in range(1, 5):
        with SampleWriter(part_path(first, number)) as writer:
            for i in range(PART_ROWS * (number - 1), PART_ROWS * number):
                writer.write(WheelSample(0.1 * i, 50.0 + np.sin(0.1 * i)), IssuedCommand(1e-4 * i))
                if i % 50 == 49:
                    writer.sync()
    for number in (1, 2, 3):
        pack(part_path(first, number))
    return first


def spoil(part: Path, how: str) -> None:
    """Do to a compressed part what disks and people do."""
    content = part.read_bytes()
    if how == "gone":
        part.unlink()
    else:
        spoilt = {
            "cut": content[: len(content) // 2], "head": content[:20], "empty": b"",
            "zeroed": content[:2000] + bytes(len(content) - 2000), "crossed": content[:2000] + content[4000:],
        }  # fmt: skip
        part.write_bytes(spoilt[how])


@pytest.mark.parametrize("how", ["cut", "head", "empty", "zeroed", "crossed", "gone"])
@pytest.mark.parametrize("number", [1, 2, 3])
def test_what_a_spoilt_part_loses_is_said_and_ends_a_segment(run: Path, how: str, number: int) -> None:
    """The part and the rows lost are named, those that are read are right, and behind the gap is a new segment."""
    whole = read_log(run)
    assert whole.warnings == ()
    spoil(packed_path(part_path(run, number)), how)
    found = read_log(run)
    lost = len(whole) - len(found)
    assert 0 < lost <= PART_ROWS
    named = [
        text for text in found.warnings if f"part {number}" in text or packed_path(part_path(run, number)).name in text
    ]
    assert any(str(lost) in text for text in named)
    kept = np.isin(whole.time_s, found.time_s)
    assert np.array_equal(whole.speed_rad_s[kept], found.speed_rad_s)
    begins = number > 1 or found.time_s[0] == whole.time_s[0]
    assert found.segment[-1] == begins
    assert (np.diff(found.time_s) > 0.15).sum() == begins


def test_the_last_part_is_known_to_be_missing(run: Path) -> None:
    """By the checksums, although no number is left out."""
    part_path(run, 4).unlink()
    assert read_log(run).warnings == (f"{run}: part 4 of the run is not there: what it held is missing (400 rows)",)


@pytest.mark.parametrize("alone", [False, True])
def test_no_flipped_bit_changes_a_number_in_silence(tmp_path: Path, alone: bool) -> None:
    """Two hundred bits in parts, estimates, checksums and YAML of a run; a hundred in parts without the checksums."""
    counts, silent = flip_often(made_run(tmp_path, 300.0), 100 if alone else 200, 7, alone=alone)
    assert silent == []
    assert sum(number for (_, what), number in counts.items() if what in ("warning", "error")) > 90


def test_a_log_that_somebody_edits_reads_with_the_lines_named(run: Path) -> None:
    """A number changed by hand in a plain part: read as it stands; without checksums there is none to differ from."""
    last = part_path(run, 4)
    before = last.read_text(encoding="utf-8")
    for old, new, named in ((",0.1", ",0.2", "102 to 151"), (",0.1", ",0.17", "102 to 401")):
        lines = before.splitlines()
        lines[120] = lines[120].replace(old, new, 1)
        last.write_text("\n".join(lines) + "\n", encoding="utf-8")
        found = read_log(run)
        assert len(found) == 4 * PART_ROWS
        (stated,) = found.warnings
        assert f"run.part004.csv: lines {named} are not as they were written" in stated
    sums_path(run).unlink()
    assert read_log(run).warnings == ()


def test_a_renamed_run_keeps_its_checksums(run: Path) -> None:
    """All files of a run under another stem: the same checks."""
    for path in list(run.parent.iterdir()):
        path.rename(path.with_name(path.name.replace("run", "lab 7.b")))
    moved = run.with_name("lab 7.b.csv")
    assert read_log(moved).warnings == ()
    packed_path(part_path(moved, 2)).write_bytes(b"")
    assert "(400 rows)" in read_log(moved).warnings[0]


def test_zeros_at_the_head_of_a_log_are_said_for_what_they_are(tmp_path: Path) -> None:
    """What copytruncate made of a log of older versions: an error that says so, and what to do."""
    path = tmp_path / "run.csv"
    path.write_bytes(bytes(5000) + b"12.5,1.0,0.1,,0,0,,,,,\n" * 20)
    with pytest.raises(LogError, match=r"begins with zero bytes.*copytruncate"):
        read_log(path)


def test_a_file_without_checksums_is_not_as_if_changed(tmp_path: Path) -> None:
    """Foreign YAML files, and those of older runs, are no matter for a word."""
    path = tmp_path / "run.model.yaml"
    path.write_text("a: 1\n", encoding="utf-8")
    assert changed(path) is None
