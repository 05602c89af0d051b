"""Octave's text files are read as its MATLAB files are."""

from __future__ import annotations

from pathlib import Path

import numpy as np

import rw_ekf
from rw_ekf.logs.foreign import octave
from tests.foreign_logs import Record, assert_same, assert_survives_damage, read_with, refusal

# Written by Octave 7.3: save("-text", ...) of one variable of each kind, shortened
KINDS = """# Created by Octave 7.3.0, Sat Nov 28 02:42:23 2026 UTC <lab@bench>
# name: bm
# type: bool matrix
# rows: 1
# columns: 2
 1 0


# name: c
# type: cell
# rows: 2
# columns: 2
# name: <cell-element>
# type: sq_string
# elements: 1
# length: 1
a


# name: <cell-element>
# type: scalar
3



# name: <cell-element>
# type: sq_string
# elements: 1
# length: 4
b °


# name: <cell-element>
# type: matrix
# rows: 1
# columns: 2
 1 2





# name: e
# type: matrix
# rows: 0
# columns: 0


# name: fh
# type: function handle
# octaveroot: /usr
# subtype: simple
sin


# name: k
# type: int32 matrix
# ndims: 2
 1 3
 1
 2
 3


# name: multi
# type: string
# elements: 1
# length: 3
x
y


# name: s
# type: scalar struct
# ndims: 2
 1 1
# length: 2
# name: z
# type: complex matrix
# rows: 1
# columns: 2
 (1,2) (3,0)


# name: w
# type: matrix
# rows: 3
# columns: 1
 1
 NaN
 NA




# name: t
# type: double_range
# base, limit, increment
0 2 0.5


"""


def matrix(name: str, values: np.ndarray) -> str:
    """A matrix as Octave writes it."""
    rows = "".join(" " + " ".join(map(repr, row)) + "\n" for row in values.tolist())
    return f"# name: {name}\n# type: matrix\n# rows: {len(values)}\n# columns: {values.shape[1]}\n{rows}\n\n"


def text(value: str, name: str = "<cell-element>") -> str:
    """A text as Octave writes it, its length in bytes."""
    return f"# name: {name}\n# type: string\n# elements: 1\n# length: {len(value.encode())}\n{value}\n\n\n"


def test_every_kind_has_the_value_that_octave_gave_it() -> None:
    """Texts count bytes, cells stand column by column, a range ends at its limit; what is no number is passed over."""
    content = octave.variables(KINDS.encode("utf-8").decode("latin-1"))
    assert content["bm"].tolist() == [[1.0, 0.0]]
    assert content["c"][:, 0].tolist() == [np.array(["a"]), np.array([[3.0]])]
    assert content["c"][0, 1].tolist() == ["b °"]
    assert content["c"][1, 1].tolist() == [[1.0, 2.0]]
    assert content["k"].tolist() == [[1.0, 2.0, 3.0]]
    assert content["multi"].tolist() == ["x\ny"]
    assert np.array_equal(content["s"]["w"][0, 0], [[1.0], [np.nan], [np.nan]], equal_nan=True)
    assert content["t"].tolist() == [0.0, 0.5, 1.0, 1.5, 2.0]
    assert not {"e", "fh"} & content.keys()


def test_a_matrix_with_its_labels_needs_no_map(tmp_path: Path) -> None:
    """Columns go by the texts of a cell array as long as the matrix is wide, units and all."""
    run = rw_ekf.simulate("steps", duration_s=60.0, seed=5)
    labels = "".join(map(text, ("t [s]", "ω [deg/s]", "i_q [mA]")))
    values = np.c_[run.time_s, np.degrees(run.speed_rad_s), 1e3 * run.current_A]
    (tmp_path / "a.txt").write_text(
        f"{KINDS.splitlines()[0]}\n{text('wheel B, 23 °C', 'comment')}# name: labels\n# type: cell\n# rows: 1\n"
        f"# columns: 3\n{labels}\n{matrix('data', values)}"
    )
    log = rw_ekf.read(tmp_path / "a.txt")
    assert np.array_equal(log.time_s, run.time_s)
    assert np.allclose(log.speed_rad_s, run.speed_rad_s)
    assert np.allclose(log.current_A, run.current_A)


def test_vectors_and_a_range_are_columns(tmp_path: Path) -> None:
    """By their names; a torn or damaged file is refused with a reason, or read as far as it is one."""
    record, path = Record(1), tmp_path / "a.mat"
    assert np.array_equal(record.time_s, 0.25 * np.arange(len(record.time_s)))
    time = f"# name: t\n# type: range\n# base, limit, increment\n0 {float(record.time_s[-1])!r} 0.25\n\n\n"
    path.write_text(
        KINDS.splitlines()[0] + "\n" + time + matrix("w", record.speed[:, None]) + matrix("i", record.current[:, None])
    )
    lines = ("time_s: t", "speed_rad_s: w", "current_A: i")
    assert_same(read_with(path, *lines), record)
    assert_survives_damage(path, *lines, begin=60)
    path.write_text(path.read_text()[:900])
    assert "is a text file of Octave that is damaged" in refusal(path, *lines)
