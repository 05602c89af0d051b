"""A model fitted to all of a log that is too long to be held, part by part."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest

from rw_ekf.arrays import Float64Array
from rw_ekf.diagnosis import long_log_fit
from rw_ekf.diagnosis.long_log_diagnosis import wandering
from rw_ekf.diagnosis.long_log_fit import fitted_to_all
from rw_ekf.diagnosis.prepare.preparation import Prepared, prepare
from rw_ekf.diagnosis.prepare.source import source_of
from rw_ekf.effects.catalogue import CATALOGUE
from rw_ekf.logs import long_log, parquet_table
from rw_ekf.logs.excerpt import read_log_or_excerpt
from rw_ekf.logs.long_log import LongLog
from rw_ekf.logs.tables import write_table
from rw_ekf.model.effect import Term
from rw_ekf.model.state import CK13_STATISTICAL
from tests.commands.logs import plant_columns

RUNS = 16
TRUE = np.array(CK13_STATISTICAL)


@dataclass(eq=False, frozen=True)
class Long:
    """A log of which an eighth is looked at."""

    prepared: Prepared
    whole: LongLog


def write_runs(path: Path, runs: list[dict[str, Float64Array]]) -> Path:
    """Runs behind one another, each a segment."""
    columns = {name: np.concatenate([run[name] for run in runs]) for name in runs[0]}
    columns["segment"] = np.repeat(np.arange(float(len(runs))), [run["time_s"].size for run in runs])
    write_table(path, columns)
    return path


@pytest.fixture
def small_parts(monkeypatch: pytest.MonkeyPatch) -> None:
    """Logs are long above 6,000 rows, and are read in parts of one run each."""
    monkeypatch.setattr(long_log, "LONG_ROWS", 6_000)
    monkeypatch.setattr(parquet_table, "_ROWS_AT_ONCE", 3_000)


@pytest.fixture
def long(tmp_path: Path, small_parts: None) -> Long:
    """Runs of one wheel by the driver's plant."""
    runs = [plant_columns("identification", seed=seed) for seed in range(1, RUNS + 1)]
    log = read_log_or_excerpt(write_runs(tmp_path / "log.parquet", runs))
    assert log.whole is not None
    return Long(prepare(source_of([log]), None, None, "blocks"), log.whole)


@pytest.mark.slow
def test_numbers_of_all_parts_are_the_wheels_and_known_better_than_by_the_stretches(long: Long) -> None:
    """All four within four sigma of the plant's, and sigmas smaller as the root of the readings is."""
    base = long.prepared.base
    found = fitted_to_all(base, base, long.prepared, long.whole)
    assert found is not None
    assert found.parts == RUNS
    off = (found.fit.model.vector - TRUE) / found.fit.std
    assert np.all(np.abs(off) < 4.0), off
    share = np.sqrt(long.prepared.kept.sum() / len(long.whole))
    assert np.all(found.fit.std[:3] < 1.5 * share * base.std[:3])
    assert found.fit.std[3] == pytest.approx(base.std[3])  # a ramp passes it between the same two steps each time
    assert np.all(found.scatter < 2.0)


@pytest.mark.slow
def test_where_it_ends_does_not_hang_on_where_it_begins(long: Long) -> None:
    """From numbers five sigma off the same are found, to a tenth of their sigma."""
    base = long.prepared.base
    found = fitted_to_all(base, base, long.prepared, long.whole)
    elsewhere = replace(base, model=base.model.with_vector(base.model.vector + 5.0 * base.std * [1.0, -1.0, 1.0, 1.0]))
    other = fitted_to_all(elsewhere, elsewhere, long.prepared, long.whole)
    assert found is not None
    assert other is not None
    assert np.all(np.abs(found.fit.model.vector - other.fit.model.vector) < 0.1 * found.fit.std)


@pytest.mark.slow
def test_a_wheel_that_changes_between_parts_is_told_and_its_sigmas_are_wider(tmp_path: Path, small_parts: None) -> None:
    """Every second run with a drag that the others have not: the parts differ, the sigmas are their scatter's."""
    runs = [
        plant_columns("identification", ["quadratic_drag:coefficient_1_rad=2e-6"] * (seed % 2), seed=seed)
        for seed in range(1, RUNS + 1)
    ]
    log = read_log_or_excerpt(write_runs(tmp_path / "log.parquet", runs))
    prepared = prepare(source_of([log]), None, None, "blocks")
    assert log.whole is not None
    found = fitted_to_all(prepared.base, prepared.base, prepared, log.whole)
    assert found is not None
    assert found.scatter.max() > 3.0
    assert "the wheel was not the same all the time" in wandering(found)[0]


@pytest.mark.slow
def test_parts_without_a_reading_are_passed_over(tmp_path: Path, small_parts: None) -> None:
    """Three runs whose tachometer was off, and one that has five readings: the others' numbers are the wheel's."""
    runs = [plant_columns("identification", seed=seed) for seed in range(1, RUNS + 1)]
    for number, kept in ((6, 0), (7, 0), (8, 0), (10, 5)):
        runs[number]["speed_rad_s"][kept:] = np.nan
    log = read_log_or_excerpt(write_runs(tmp_path / "log.parquet", runs))
    prepared = prepare(source_of([log]), None, None, "blocks")
    assert log.whole is not None
    found = fitted_to_all(prepared.base, prepared.base, prepared, log.whole)
    assert found is not None
    assert found.parts == RUNS - 3
    assert np.all(np.abs(found.fit.model.vector - TRUE) < 4.0 * found.fit.std)


def test_what_a_part_alone_cannot_say_is_left_as_it_was(long: Long, monkeypatch: pytest.MonkeyPatch) -> None:
    """A bristle, a lag, a drift by the log's own clock: the log is not even read."""
    monkeypatch.setattr(long_log_fit, "_sums", None)
    base = long.prepared.base
    for name in ("presliding_hysteresis", "actuator_lag", "coulomb_drift", "torque_ripple"):
        effect = CATALOGUE[name]
        term = Term.of(effect, (21.0, 0.0, 0.0), 0.01) if effect.angular else Term.of(effect, value=0.01)
        fit = replace(base, model=base.model.with_terms(term))
        assert fitted_to_all(fit, fit, long.prepared, long.whole) is None
