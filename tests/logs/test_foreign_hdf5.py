"""MATLAB v7.3 and plain HDF5 are read by the rules of v7."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from scipy.io import savemat

import rw_ekf
from rw_ekf.units import RAD_S_PER_RPM
from tests.foreign_logs import (
    Record,
    assert_same,
    assert_says_what_to_install,
    assert_survives_damage,
    read_with,
    refusal,
)

MAP = ("time_s: t", "speed_rad_s: w", "current_A: i")


def double(group: Any, key: str, values: Any, kind: bytes = b"double") -> Any:
    """A variable as MATLAB writes it: dimensions turned round, its class beside it."""
    dataset = group.create_dataset(key, data=np.atleast_2d(values).T)
    dataset.attrs["MATLAB_class"] = np.bytes_(kind)
    return dataset


def struct(parent: Any, key: str) -> Any:
    """A struct as MATLAB writes it."""
    group = parent.create_group(key)
    group.attrs["MATLAB_class"] = np.bytes_(b"struct")
    return group


def as_matlab(path: Path) -> Path:
    """The header that MATLAB puts before HDF5, in the block that is left free for it."""
    data = bytearray(path.read_bytes())
    data[:20] = b"MATLAB 7.3 MAT-file,"
    path.write_bytes(bytes(data))
    return path


def fill(group: Any, record: Record) -> None:
    """The record as three vectors, one of them a row."""
    double(group, "t", record.time_s[:, None])
    double(group, "w", record.speed)
    double(group, "i", record.current[:, None])


def test_vectors_structs_matrices_and_cells(tmp_path: Path) -> None:
    """Each layout that v7 knows is read from v7.3 too, dimensions in MATLAB's order."""
    record, other = Record(1), Record(2)
    path = tmp_path / "a.mat"
    with h5py.File(path, "w", userblock_size=512) as file:
        fill(file, record)
        fill(struct(struct(file, "s"), "inner"), other)
        double(file, "m", np.c_[other.time_s, other.speed, other.current])
        cells = [[record.time_s, record.time_s], [record.speed, other.speed], [record.current, other.current]]
        refs = [[double(file, f"#refs#/{c}{r}", cells[r][c]).ref for r in range(3)] for c in (0, 1)]
        held = file.create_dataset("c", data=np.array(refs, dtype=h5py.ref_dtype), dtype=h5py.ref_dtype)
        held.attrs["MATLAB_class"] = np.bytes_(b"cell")
        double(file, "note", [[104, 105]], b"char")
    as_matlab(path)
    assert_same(read_with(path, *MAP), record)
    inner = ("time_s: inner.t", "speed_rad_s: inner.w", "current_A: inner.i")
    assert_same(read_with(path, "variable: s", *inner), other)
    assert_same(read_with(path, "variable: s/inner", *MAP), other)
    numbers = ("time_s: {column: 0}", "speed_rad_s: {column: 1}", "current_A: {column: 2}")
    assert_same(read_with(path, "variable: m", *numbers), other)
    log = read_with(path, "variable: c", "layout: cells", *numbers)
    assert np.array_equal(log.speed_rad_s, np.r_[record.speed, other.speed])
    assert log.segment.tolist() == [0] * 60 + [1] * 60
    assert "has no variable 'gone'; variables: c, i, m" in refusal(path, "variable: gone", *MAP)


def test_an_array_of_structs_goes_by_its_names(tmp_path: Path) -> None:
    """A recording with X.Data and Y[].Name, Y[].Data is read from v7.3 as from v7."""
    record = Record(3)
    path = tmp_path / "a.mat"
    with h5py.File(path, "w", userblock_size=512) as file:
        rec = struct(file, "rec")
        double(struct(rec, "X"), "Data", record.time_s)
        elements = struct(rec, "Y")
        columns = [("w", record.speed), ("i", record.current)]
        data = [double(file, f"#refs#/d{n}", values).ref for n, (_, values) in enumerate(columns)]
        names = [double(file, f"#refs#/n{n}", [ord(name)], b"char").ref for n, (name, _) in enumerate(columns)]
        for key, references in (("Data", data), ("Name", names)):
            elements.create_dataset(key, data=np.array([references], dtype=h5py.ref_dtype), dtype=h5py.ref_dtype)
    assert_same(read_with(as_matlab(path), "time_s: X.Data", "speed_rad_s: w", "current_A: i"), record)


def test_plain_hdf5(tmp_path: Path) -> None:
    """Without MATLAB's marks a group is a struct, a compound data set a table, and dimensions stay as they are."""
    record = Record(4)
    path = tmp_path / "a.h5"
    rows = np.zeros(60, dtype=[("t", ">f8"), ("w", ">f8"), ("i", ">f8")])
    rows["t"], rows["w"], rows["i"] = record.time_s, record.speed, record.current
    with h5py.File(path, "w") as file:
        file.create_dataset("run/table", data=rows)
        file.create_dataset("run/matrix", data=np.c_[record.time_s, record.speed, record.current])
    assert_same(read_with(path, "variable: run/table", *MAP), record)
    numbers = ("time_s: {column: 0}", "speed_rad_s: {column: 1}", "current_A: {column: 2}")
    assert_same(read_with(path, "variable: run.matrix", *numbers), record)


def test_objects_of_matlab_are_named_with_what_saves_them(tmp_path: Path) -> None:
    """A timetable is refused with the line to type, and left out with a word where there are vectors."""
    path = tmp_path / "a.mat"
    with h5py.File(path, "w", userblock_size=512) as file:
        table = double(file, "tt", [[3707764736, 2, 1, 1, 1, 1]], b"timetable")
        table.attrs["MATLAB_object_decode"] = np.int32(3)
    as_matlab(path)
    assert "'tt' is a timetable object, which only MATLAB can open: there writetimetable(tt" in refusal(path, *MAP)
    record = Record(5)
    with h5py.File(path, "a") as file:
        fill(file, record)
    log = read_with(path, *MAP)
    assert_same(log, record)
    assert "'tt' is a timetable object" in log.warnings[0]
    assert "writetimetable" in refusal(path, "variable: tt", *MAP)


def test_damage_and_a_missing_library(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Neither ends in anything but a LogError, which names v7 as the way out."""
    path = tmp_path / "a.mat"
    with h5py.File(path, "w", userblock_size=512) as file:
        fill(file, Record(6))
    as_matlab(path)
    assert_says_what_to_install(monkeypatch, path, "h5py", "hdf5")
    assert_survives_damage(path, *MAP)


@pytest.mark.parametrize("form", ["struct array", "cell array of structs", "groups"])
def test_runs_in_one_file_are_segments(tmp_path: Path, form: str) -> None:
    """Two runs of different lengths, whichever way a file holds them, are read both; of two wheels neither is dropped
    without a word."""
    records = [Record(1), Record(2, rows=80)]
    held = [{"t_s": r.time_s, "speed_rad_s": r.speed, "i_A": r.current} for r in records]
    for name in ("run", "wheel"):
        path = tmp_path / f"{name}.mat"
        if form == "groups":
            with h5py.File(path, "w") as file:
                for number, fields in enumerate(held):
                    for key, values in fields.items():
                        file[f"{name}_{number}/{key}"] = values
        else:
            array = np.array(held, dtype=object)
            if form == "struct array":
                array = np.empty((1, 2), dtype=[(key, object) for key in held[0]])
                for number, fields in enumerate(held):
                    array[0, number] = tuple(fields.values())
            savemat(path, {name: array})
    log = rw_ekf.read(tmp_path / "run.mat")
    assert np.array_equal(log.speed_rad_s, np.concatenate([r.speed for r in records]))
    assert np.unique(log.segment, return_counts=True)[1].tolist() == [60, 80]
    assert any(
        "of another length and left out" in text for text in rw_ekf.guess_columns(tmp_path / "wheel.mat").warnings
    )


def test_a_list_of_units_is_of_the_fields_of_a_table_of_rows(tmp_path: Path) -> None:
    """A dataset of rows whose attribute `units` has one for each field: none is asked for."""
    record = Record(3)
    rows = np.zeros(60, dtype=[("time", "f8"), ("speed", "f8"), ("current", "f8")])
    rows["time"], rows["speed"], rows["current"] = record.time_s, record.speed, record.current
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["log/telemetry"] = rows
        file["log/telemetry"].attrs["units"] = ["s", "rad/s", "A"]
    assert_same(rw_ekf.read(tmp_path / "a.h5"), record)


def test_attributes_that_scale_are_applied_to_counts_or_asked_about(tmp_path: Path) -> None:
    """A list has one for each column; scale_factor and add_offset are CF's; what is whose no name says is asked."""
    record = Record(4)
    rpm, mA = np.round(record.speed * 300.0), np.round(record.current * 1e3)
    held = np.c_[rpm, mA].astype(np.int32)
    with h5py.File(tmp_path / "list.h5", "w") as file:
        data = file.create_dataset("data", data=held)
        data.attrs.update({"channels": ["speed", "current"], "units": ["rpm", "mA"]})
        data.attrs.update({"scale": [0.25, 0.5], "rate_hz": 4.0})
    log = rw_ekf.read(tmp_path / "list.h5")
    assert np.allclose(log.speed_rad_s, 0.25 * rpm * RAD_S_PER_RPM)
    assert np.allclose(log.current_A, 0.5e-3 * mA)
    with h5py.File(tmp_path / "cf.h5", "w") as file:
        group = file.create_group("run")
        group.attrs["sample_rate"] = 4.0
        for name, unit, values in (("speed", "rpm", rpm), ("current", "mA", mA)):
            group.create_dataset(name, data=values.astype(np.int32)).attrs.update(
                {"units": unit, "scale_factor": 0.25, "add_offset": -20.0}
            )
    log = rw_ekf.read(tmp_path / "cf.h5")
    assert np.allclose(log.speed_rad_s, (0.25 * rpm - 20.0) * RAD_S_PER_RPM)
    assert np.allclose(log.current_A, 1e-3 * (0.25 * mA - 20.0))
    assert np.allclose(log.time_s, record.time_s)
    for of_all in ({"scale": 0.5}, {"scale": [0.25, 0.5, 1.0]}, {"offset": [5.0, 0.0]}):
        with h5py.File(tmp_path / "open.h5", "w") as file:
            data = file.create_dataset("data", data=held)
            data.attrs.update({"channels": ["speed", "current"], "units": ["rpm", "mA"], "rate_hz": 4.0, **of_all})
        found = rw_ekf.guess_columns(tmp_path / "open.h5")
        assert "speed_rpm" in [question.name for question in found.guess.questions], of_all


def test_a_unit_within_a_struct_is_of_its_values(tmp_path: Path) -> None:
    """`omega.data` is in what `omega.unit` says, and the axis of a recording in what `X.Unit` does."""
    record = Record(5)
    channels = {
        "X": {"Data": record.time_s, "Unit": "s"},
        "omega": {"data": record.speed * 60.0, "unit": "deg/s"},
        "Iq": {"data": record.current * 1e3, "unit": "mA"},
    }
    savemat(tmp_path / "a.mat", {"rec": channels})
    log = rw_ekf.read(tmp_path / "a.mat")
    assert np.allclose(log.time_s, record.time_s)
    assert np.allclose(log.speed_rad_s, record.speed * np.pi / 3.0)
    assert np.allclose(log.current_A, record.current)


def test_runs_of_different_factors_are_asked_about(tmp_path: Path) -> None:
    """A recorder that chose its range anew for each run: no factor is taken for all of them."""
    record = Record(6)
    for factors, certain in (((0.25, 0.25), True), ((0.25, 0.5), False)):
        with h5py.File(tmp_path / "a.h5", "w") as file:
            for number, factor in enumerate(factors, 1):
                group = file.create_group(f"run_{number}")
                group["t"], group["current_A"] = record.time_s, record.current
                speed = group.create_dataset("speed", data=np.round(record.speed * 300.0).astype(np.int32))
                speed.attrs.update({"units": "rpm", "scale_factor": factor})
        found = rw_ekf.guess_columns(tmp_path / "a.h5")
        assert found.guess.is_certain == certain, [question.text for question in found.guess.questions]
