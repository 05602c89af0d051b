"""Igor Pro's text files are read on the axes that their commands give."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import rw_ekf
from rw_ekf.units import RAD_S_PER_RPM
from tests.foreign_logs import Record, assert_same, assert_survives_damage, read_with, refusal


def _wave(name: str, values: np.ndarray, flags: str = "/D") -> str:
    return "\n".join([f"WAVES{flags}\t{name}", "BEGIN", *(f"\t{value!r}" for value in values.tolist()), "END", ""])


@pytest.mark.parametrize("end", ["\r", "\n", "\r\n"])
@pytest.mark.parametrize("scale", ["/P x 0,0.1", "/P x 0,100", "/I x 0,59.9", " x 0,60"])
def test_waves_and_their_units_need_no_map(tmp_path: Path, end: str, scale: str) -> None:
    """Two waves in one block, or one each, with a step, a last value or the end of the axis."""
    run = rw_ekf.simulate("steps", duration_s=60.0, seed=5)
    speed, unit = run.speed_rad_s / RAD_S_PER_RPM, "ms" if ",100" in scale else "s"
    assert len(run) == 600
    pairs = "\n".join(f" {w!r}\t{c!r}" for w, c in zip(speed.tolist(), run.current_A.tolist(), strict=True))
    texts = 'WAVES/T/N=(2) labels\nBEGIN\n"a"\n"b"\nEND\nWAVES/D/N=(2,2) m\nBEGIN\n1 2\n3 4\nEND\n'
    block = f"WAVES/O/D wheelSpeed, 'motor current'\nBEGIN\n{pairs}\nEND\n"
    apart = _wave("wheelSpeed", speed) + _wave("'motor current'", run.current_A)
    names = "wheelSpeed", "'motor current'"
    tail = "".join(
        f'X SetScale{scale},"{unit}", {wave}; SetScale y 0,0,"{of}", {wave}\n'
        for wave, of in zip(names, ("rpm", "A"), strict=True)
    )
    for body in (texts + block, apart):
        path = tmp_path / "a.itx"
        path.write_bytes(f"IGOR\nX // wheel B\n{body}{tail}".replace("\n", end).encode())
        log = rw_ekf.read(path)
        assert log.time_s == pytest.approx(run.time_s - run.time_s[0], abs=1e-9)
        assert log.speed_rad_s == pytest.approx(run.speed_rad_s, abs=1e-9, nan_ok=True)
        assert log.current_A == pytest.approx(run.current_A, abs=1e-12)


def test_waves_without_an_axis_are_columns(tmp_path: Path) -> None:
    """By their names, the time a wave too; a damaged file is refused with a reason, or read as far as it is one."""
    record, path = Record(1), tmp_path / "a.itx"
    path.write_text("IGOR\n" + _wave("t", record.time_s) + _wave("w", record.speed) + _wave("i", record.current))
    lines = ("time_s: t", "speed_rad_s: w", "current_A: i")
    assert_same(read_with(path, *lines), record)
    assert_survives_damage(path, *lines, begin=10)
    path.write_text(path.read_text()[:-10])
    assert "no END behind it" in refusal(path, *lines)
    path.write_text("IGOR\nWAVES a, b\nBEGIN\n1 2\n3\nEND\n")
    assert "has not 2 numbers" in refusal(path, *lines)


def test_waves_of_other_axes_are_groups(tmp_path: Path) -> None:
    """A current at twice the rate is put on one clock with the speed, and that is said."""
    t = 0.1 * np.arange(100)
    body = _wave("speed", np.cos(t)) + _wave("current", np.repeat(np.sin(t), 2))
    (tmp_path / "a.itx").write_text(
        f'IGOR\n{body}X SetScale/P x 0,0.1,"s", speed; SetScale d 0,0,"rad/s", speed\n'
        'X SetScale/P x 0,0.05,"s", current; SetScale d 0,0,"A", current; Note current, "LEM, of the motor"\n'
    )
    log = rw_ekf.read(tmp_path / "a.itx")
    assert any("were put on the times of" in text for text in log.warnings)
    assert log.current_A == pytest.approx(np.repeat(np.sin(t), 2))
