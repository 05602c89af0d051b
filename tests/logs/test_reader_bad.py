"""Logs that cannot be used: each gets one sentence with file and place, as LogError, which is exit status 2."""

from __future__ import annotations

import random
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from scipy.io import savemat

from rw_ekf.errors import BadInputError, LogError
from rw_ekf.logs.reader import read_log

HEADER = "time_s,speed_rad_s,current_A\n"


def message(path: Path) -> str:
    with pytest.raises(LogError) as caught:
        read_log(path)
    text = str(caught.value)
    assert text.startswith(f"{path}: ")
    assert "\n" not in text
    assert caught.value.exit_status == 2
    return text.removeprefix(f"{path}: ")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", ["the file is empty"]),
        ("\n  \n", ["the file is empty"]),
        (HEADER, ["has a header but no rows"]),
        (HEADER + "0,1", ["has a header but no rows", "line 2"]),
        ("0,1,2\n1,1,2\n", ["column time_s is missing", "no header row"]),
        ("time_s,speed_rad_s\n0,1\n", ["current_command_A or current_A is missing", "--columns"]),
        ("time_s,current_A\n0,1\n", ["speed_rad_s or speed_rpm is missing", "columns: time_s, current_A"]),
        ("t,speed_rad_s,current_A\n0,1,2\n", ["column time_s is missing", "--columns"]),
        ("time_S,speed_rad_s,current_A\n0,1,2\n", ["did you mean 'time_S'?"]),
        ("time_s,speed_rad_s,current_A,speed_rad_s\n0,1,2,3\n", ["'speed_rad_s' appears 2 times", "columns 1, 3"]),
        (HEADER + "0,1,2\n1,abc,2\n2,x,3\n", ["line 3, column 'speed_rad_s': 'abc' is not a number"]),
        (HEADER + "0,1,2\n\n1,1,0x10\n2,1,1\n", ["line 4, column 'current_A': '0x10' is not a number"]),
        (HEADER + "0,1,2\n1,1_0,2\n2,1,1\n", ["line 3, column 'speed_rad_s': '1_0'"]),
        (HEADER + "0,1,2\n1,inf,2\n", ["line 3, column 'speed_rad_s': inf is not a finite number"]),
        (HEADER + "0,1,2\n1,1,-Infinity\n", ["line 3, column 'current_A': -inf"]),
        (HEADER + "inf,1,2\n1,1,1\n", ["line 2, column 'time_s': inf"]),
        (HEADER + "0,1,2\nnan,1,2\n2,1,1\n", ["line 3, column 'time_s'", "every row needs its time"]),
        (HEADER + "0,1,2\n,1,2\n2,1,1\n", ["line 3, column 'time_s'"]),
        (HEADER + "0,1,2\n1,1\n2,1,1\n", ["line 3: 2 fields where the header has 3"]),
        (HEADER + "0,1,2\n1,1,2,3\n2,1,1\n", ["line 3: 4 fields where the header has 3"]),
        (HEADER + "0,1,2\n1,1,2,3\n", ["line 3: 4 fields where the header has 3"]),
        (HEADER + '0,1,2\n1,"2\n3,4,5\n', ["line 3: a quote is opened and never closed"]),
        (HEADER + "0,1,\n1,1,\n", ["column 'current_A' is empty throughout", "{constant: 0.0}"]),
        (HEADER + "0,1,2\n0,1,2\n1,1,2\n", ["1 of 3 rows (33.3 %)", "first at line 3", "segment"]),
        ("time_s,speed_rad_s,current_A,segment\n0,1,2,\n", ["line 2, column 'segment'"]),
        ("time_s,speed_rad_s,current_command_A,command_delay_s\n0,1,2,0\n1,1,2,-0.1\n", ["line 3", "-0.1 is negative"]),
        (HEADER + "0,1,2\n1,1,2024-01-01\n2,1,1\n", ["line 3, column 'current_A': '2024-01-01'"]),
    ],
)
def test_bad_csv(tmp_path: Path, text: str, words: list[str]) -> None:
    """Proves that each fault is named with its line and column, whichever reader met it."""
    path = tmp_path / "log.csv"
    path.write_text(text)
    found = message(path)
    for part in words:
        assert part in found


def test_the_line_is_right_deep_in_a_large_file(tmp_path: Path) -> None:
    """Proves that the place of a fault does not depend on the blocks of the fast reader."""
    lines = [f"{index},{index * 0.5!r},1.25" for index in range(100_000)]
    lines[77_777] = "77777,oops,1"
    path = tmp_path / "log.csv"
    path.write_text(HEADER + "\n".join(lines) + "\n")
    assert message(path).startswith("line 77779, column 'speed_rad_s': 'oops'")
    lines[77_777] = "77777,inf,1"
    path.write_text(HEADER + "\n".join(lines) + "\n")
    assert message(path).startswith("line 77779, column 'speed_rad_s': inf")


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("a.csv", b"\x7fELF\x02\x01\x01\x00\x00\x00\x00", "binary"),
        ("a.csv", b"\x89PNG\r\n\x1a\n\x00\x00", "not UTF-8"),
        ("a.csv", HEADER.encode() + b"0,1,2\n1,\xff,2\n2,1,1\n", "line 3: not UTF-8"),
        ("a.csv", "time_s,speed_rad_s\n".encode("utf-16"), "UTF-16"),
        ("a.csv", b"\x1f\x8b\x08\x00abc", "gzip"),
        ("a.csv", b"PK\x03\x04abc", "spreadsheet"),
        ("a.txt", b"\n<!DOCTYPE HTML>\n<table>", "web page"),
        ("a.xml", b"\xef\xbb\xbf<?xml version='1.0'?>\n<log/>", "pandas.read_xml"),
        ("a.pkl", b"\x80\x04\x95\x00abc", "pickle"),
        ("a.pdf", b"%PDF-1.7\n%", "PDF"),
        ("a.csv", b"PAR1 and then nothing", "damaged or incomplete Parquet"),
        ("a.parquet", HEADER.encode() + b"0,1,2\n", "is no Parquet file"),
        ("a.mat", HEADER.encode() + b"0,1,2\n", "is no MATLAB file"),
        ("a.mat", b"\x89HDF\r\n\x1a\n rest", "save(..., '-v7')"),
        ("a.mat", b"MATLAB 7.3 MAT-file, Platform: x" + b" " * 500, "save(..., '-v7')"),
        ("a.mat", b"MATLAB 5.0 MAT-file, cut", "damaged MATLAB file"),
    ],
)
def test_files_that_are_something_else(tmp_path: Path, name: str, content: bytes, words: str) -> None:
    """Proves that content, not the suffix, is believed, and that what it is instead is said."""
    path = tmp_path / name
    path.write_bytes(content)
    assert words in message(path)


def test_files_that_cannot_be_opened(tmp_path: Path) -> None:
    """Proves that a missing file and a directory are named."""
    assert "no such file" in message(tmp_path / "none.csv")
    assert "directory" in message(tmp_path)


def test_a_parquet_column_that_is_no_number(tmp_path: Path) -> None:
    """Proves that text or timestamps where a number belongs are named with their type."""
    import pyarrow as pa
    from pyarrow import parquet

    path = tmp_path / "a.parquet"
    stamps = pa.array([0, 1], type=pa.timestamp("us"))
    parquet.write_table(pa.table({"time_s": [1.0, 2.0], "speed_rad_s": stamps, "current_A": [1.0, 2.0]}), path)
    assert "column 'speed_rad_s' holds timestamp[us], not numbers" in message(path)
    numbers = pa.array([], type=pa.float64())
    parquet.write_table(pa.table({"time_s": numbers}), path)
    assert "no rows" in message(path)


def test_a_parquet_log_names_rows(tmp_path: Path) -> None:
    """Proves that infinity in Parquet is found and placed by row."""
    import pyarrow as pa
    from pyarrow import parquet

    path = tmp_path / "a.parquet"
    parquet.write_table(pa.table({"time_s": [0.0, 1.0], "speed_rad_s": [1.0, np.inf], "current_A": [1.0, 2.0]}), path)
    assert message(path).startswith("row 2, column 'speed_rad_s': inf")


def test_a_matlab_file_without_vectors(tmp_path: Path) -> None:
    """Proves that a .mat that holds no record says what to name."""
    path = tmp_path / "a.mat"
    savemat(path, {"note": "hello"})
    assert "holds no numeric vectors" in message(path)


@settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    body=st.binary(max_size=60)
    | st.text(alphabet='0123456789.,-+e"\n\r nanif;x\x00', max_size=80).map(lambda text: text.encode()),
    name=st.sampled_from(["f.csv", "f.parquet", "f.mat"]),
    lead=st.sampled_from([b"", HEADER.encode(), b"PAR1", b"MATLAB 5.0 MAT-file" + b" " * 105 + b"\x00\x01IM"]),
)
def test_no_file_causes_a_traceback(tmp_path: Path, body: bytes, name: str, lead: bytes) -> None:
    """Proves that whatever a file holds, the outcome is a log or a BadInputError with the file's name."""
    path = tmp_path / name
    path.write_bytes(lead + body)
    try:
        log = read_log(path)
    except BadInputError as error:
        found = str(error)
        assert found.startswith(str(path)), found
        return
    assert np.isfinite(log.current_A).all()
    assert np.isfinite(log.time_s).all()
    assert (np.diff(log.time_s)[np.diff(log.segment) == 0] > 0).all()


@pytest.mark.parametrize("compressed", [False, True])
def test_a_damaged_matlab_file_does_not_end_the_process(tmp_path: Path, compressed: bool) -> None:
    """Proves that flipped and missing bytes are refused before scipy's C code meets them, and whole files are read."""
    draws = random.Random(11)
    path = tmp_path / "a.mat"
    cells = np.empty((2, 1), dtype=object)
    cells[:, 0] = [np.arange(3.0), "text"]
    record = {
        "time_s": np.arange(3.0),
        "speed_rad_s": np.ones(3),
        "current_A": np.arange(3),
        "s": {"a": 1.0},
        "c": cells,
    }
    savemat(path, record, do_compression=compressed)
    whole = path.read_bytes()
    assert len(read_log(path)) == 3
    for _ in range(300):
        damaged = bytearray(whole)
        for _ in range(draws.randint(1, 4)):
            damaged[draws.randrange(128, len(damaged))] = draws.randrange(256)
        path.write_bytes(bytes(damaged[: draws.choice([len(damaged), draws.randrange(200, len(damaged))])]))
        try:
            read_log(path)
        except LogError as error:
            found = str(error)
            assert found.startswith(str(path))
