"""The rivals of a diagnosis: they find what is there, dry friction holds, and the tool skips without records."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from rw_ekf.arrays import BoolArray, Float64Array
from rw_ekf.model.state import FrictionParameters
from tests.karnopp import karnopp
from tools.proof.measured import RECORDS, main
from tools.proof.measured_table import table
from tools.proof.rival_changes import Blocks
from tools.proof.rival_run import GRID, Driven, Friction, run
from tools.proof.rival_terms import Rows
from tools.proof.rivals import Rival, fitted_rivals

TRUTH = FrictionParameters(15.0, 0.05, 0.6, 0.6)


def blocks_of(time_s: Float64Array, speed: Float64Array, drive: Float64Array) -> tuple[Blocks, BoolArray]:
    """Four blocks, every other one to fit, begun from what was read."""
    none = np.zeros(time_s.size)
    rows = Rows(time_s, speed, drive, none, np.zeros(time_s.size, np.int64), None, None)
    block = np.arange(time_s.size) * 4 // time_s.size
    return Blocks(rows, block % 2 == 0, np.diff(block, prepend=-1) != 0, speed), block % 2 == 1


def steps(n: int, seed: int) -> Float64Array:
    """Currents held for 20 samples, (n,)."""
    random = np.random.default_rng(seed)
    return np.repeat(random.uniform(-0.3, 0.3, n // 20 + 1), 20)[:n]


@pytest.fixture(scope="module")
def rivals() -> tuple[list[Rival], Blocks, BoolArray]:
    """Of a wheel that is what the plain model says, its commands a row late; noise of 0.05 rad/s.

    Pairs of blocks have the same commands, so that no rival is asked about speeds that it was not shown.
    """
    time_s = 0.1 * np.arange(2000, dtype=np.float64)
    drive = np.concatenate([np.tile(steps(500, seed), 2) for seed in (1, 5)])
    late = np.concatenate((drive[:1], drive[:-1]))
    speed = karnopp(TRUTH, time_s, late) + 0.05 * np.random.default_rng(2).standard_normal(time_s.size)
    blocks, heldout = blocks_of(time_s, speed, drive)
    return fitted_rivals(blocks), blocks, heldout


@pytest.mark.slow
def test_least_squares_recovers_the_truth(rivals: tuple[list[Rival], Blocks, BoolArray]) -> None:
    plain = rivals[0][0]
    gain, viscous, coulomb, _ = plain.coefficients
    assert plain.late_rows == 1
    assert gain == pytest.approx(TRUTH.motor_gain, rel=0.01)
    assert -viscous == pytest.approx(TRUTH.viscous, rel=0.05)
    assert -coulomb == pytest.approx(TRUTH.coulomb, rel=0.05)


@pytest.mark.slow
def test_every_rival_predicts_to_a_few_times_the_noise(rivals: tuple[list[Rival], Blocks, BoolArray]) -> None:
    fitted, blocks, heldout = rivals
    assert [rival.name for rival in fitted] == ["least squares", "spline over speed", "sparse regression"]
    for rival in fitted:
        assert rival.missed_rad_s(blocks, heldout) < 4.0 * 0.05


@pytest.mark.slow
def test_a_sparse_regression_leaves_out_what_is_not_there() -> None:
    """Of a wheel with windage: that term stays, and the error is a fraction of plain least squares'."""
    time_s = 0.1 * np.arange(1600, dtype=np.float64)
    drive = steps(time_s.size, 3) + 0.2
    speed = np.zeros(time_s.size)
    for i in range(time_s.size - 1):
        omega = speed[i]
        for _ in range(20):
            omega += 0.005 * (15.0 * drive[i] - 0.02 * omega - 0.4 * np.sign(omega) - 1.0e-3 * omega * abs(omega))
        speed[i + 1] = omega
    speed += 0.05 * np.random.default_rng(4).standard_normal(time_s.size)
    blocks, heldout = blocks_of(time_s, speed, drive)
    plain, _, sparse = fitted_rivals(blocks)
    kept = {name for name, value in zip(sparse.terms.names, sparse.coefficients, strict=True) if value != 0.0}
    assert {"I", "omega|omega|"} <= kept or {"I", "omega^3"} <= kept
    assert not {"t", "I|I|"} & kept
    assert sparse.missed_rad_s(blocks, heldout) < 0.5 * plain.missed_rad_s(blocks, heldout)


def test_dry_friction_stops_and_holds() -> None:
    """A wheel that is let go comes to rest, stays there under less than break-away, and leaves under more."""
    n = 300
    e = np.concatenate((np.zeros(100), np.full(100, 0.9), np.full(100, 1.5)))
    step = np.full(n, 0.1)
    none = np.zeros(n)
    friction = Friction(20.0, np.ones(GRID), np.ones(GRID))
    begins = np.arange(n) == 0
    path = run(Driven(step, none, e, e, none, none), friction, begins, np.full(n, 5.0))
    assert path[50] == pytest.approx(0.0, abs=1e-6)
    assert not path[52:201].any()
    assert path[-1] == pytest.approx(0.5 * 9.9, rel=0.01)


def test_a_delay_within_a_row_is_the_log_s(tmp_path: Path) -> None:
    """What takes force in the midst of an interval counts from there."""
    drive = np.array([0.0, 1.0, 1.0, 1.0])
    rows = Rows(np.arange(4.0), np.zeros(4), drive, np.full(4, 0.25), np.zeros(4, np.int64), None, None)
    blocks = Blocks(rows, np.ones(4, dtype=bool), np.arange(4) == 0, np.zeros(4))
    from tools.proof.rival_terms import plain_terms

    path = Rival("", plain_terms(1.0), np.array([2.0, 0.0, 0.0, 0.0]), 0, 10.0, "").run(blocks, blocks.fit)
    assert path.tolist() == pytest.approx([0.0, 0.0, 1.5, 3.5])


def test_without_the_records_the_tool_says_so(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--data", str(tmp_path / "gone"), "--out", str(tmp_path / "out")]) == 0
    assert capsys.readouterr().out.startswith("Skipped: the measured records are not here")
    assert not (tmp_path / "out").exists()


def test_every_record_has_a_shipped_map() -> None:
    from rw_ekf.settings.resources import config_resource

    for record in RECORDS:
        assert config_resource(f"columns-{record.columns}").is_file()


def test_the_table_marks_what_loses() -> None:
    figures = {"one_step_rms_rad_s": 1.0, "horizon_1s_rms_rad_s": 2.0, "free_run_rms_rad_s": 3.0, "nis_mean": 1.0}
    item = {
        "record": "a", "verdict": {"kind": "effect", "effects": ["offset_torque"]}, "before": figures,
        "after": figures | {"horizon_1s_rms_rad_s": 1.5}, "cpu_s": 3.0, "ours_free_run_rad_s": 2.5,
        "rivals": [{"free_run_rad_s": value} for value in (3.0, 2.4, 2.6)], "ours_over_best": 2.5 / 2.4, "holds": True,
    }  # fmt: skip
    lost = item | {"record": "b", "ours_over_best": 1.06, "holds": False}
    text = table([item, lost, item | {"record": "c", "ours_over_best": None, "holds": None}])
    assert "| a | effect: offset_torque | 1 | 2 -> 1.5 | 3 -> 2.5 | 1 | 3 | 2.4 | 2.6 | 1.04 yes | 3 |" in text
    assert "1.06 no" in text
    assert text.endswith("Lost to no rival by more than 5 %: 1 of 2. Not judged: c.")
