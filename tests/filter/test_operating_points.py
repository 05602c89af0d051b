"""What a motion can show, and which parameters may be relied on: by buckets of operating points, with hysteresis."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from rw_ekf.arrays import Float64Array
from rw_ekf.filter import gating
from rw_ekf.filter.belief import DEFAULT_PRIOR, Belief
from rw_ekf.filter.filter_run import FilterRun
from rw_ekf.filter.identifiability import Validity, report
from rw_ekf.filter.operating_points import OperatingPoints
from rw_ekf.model.state import CK13_STATISTICAL
from rw_ekf.records import Estimate, ParameterFlags
from rw_ekf.units import RAD_S_PER_RPM
from tests.filter.replay import Columns, compiled, online
from tests.filter.test_health import changing_wheel
from tests.karnopp import holding_current_A, karnopp
from tests.truth import run_of
from tools.measure.runs import OMEGA_S, constants_for

N = 6000
TIME_S = np.linspace(0.0, 599.9, N)
RNG = np.random.default_rng(8)
MOTIONS: dict[str, tuple[Float64Array, float, ParameterFlags]] = {
    "6000 rpm": (
        np.full(N, holding_current_A(CK13_STATISTICAL, 6000 * RAD_S_PER_RPM)), 6000.0,
        ParameterFlags(False, False, False, False),
    ),
    "6000 rpm, current dithering": (
        holding_current_A(CK13_STATISTICAL, 6000 * RAD_S_PER_RPM) + 0.002 * RNG.standard_normal(N), 6000.0,
        ParameterFlags(False, False, False, False),
    ),
    "coast-down to rest": (np.zeros(N), 2000.0, ParameterFlags(False, True, True, True)),
    "spin-up under one current": (np.full(N, 0.15), 0.0, ParameterFlags(False, True, False, False)),
    "never reversing": (0.12 + 0.05 * np.sin(0.06 * TIME_S), 200.0, ParameterFlags(True, True, True, False)),
    "at rest": (np.zeros(N), 0.0, ParameterFlags(False, False, False, False)),
}  # fmt: skip


def motion(name: str) -> Columns:
    """A simulated run of that motion."""
    current, speed_rpm, _ = MOTIONS[name]
    true = karnopp(CK13_STATISTICAL, TIME_S, current, initial_speed_rad_s=speed_rpm * RAD_S_PER_RPM)
    return Columns(TIME_S, true + RAD_S_PER_RPM * np.random.default_rng(9).standard_normal(N), current)


def points_of(log: Columns, run: FilterRun) -> OperatingPoints:
    """Of a compiled pass."""
    found = OperatingPoints.of_wheel(CK13_STATISTICAL, OMEGA_S)
    used = run.outcome == gating.UPDATED
    found.add_all(log.speed_rad_s[used], np.concatenate([[0.0], log.current_A[:-1]])[used])
    return found


def verdict(run: FilterRun, points: OperatingPoints) -> ParameterFlags:
    """What the replay's document says."""
    reports = report(Belief(run.mean, run.covariance), DEFAULT_PRIOR, points)
    return ParameterFlags(*(item.identifiable for item in reports))


@pytest.mark.parametrize("name", MOTIONS)
def test_a_parameter_is_identifiable_where_the_motion_shows_it(name: str) -> None:
    """One speed shows none, however small its sigmas; a coast-down friction; the rest what it moved through."""
    log = motion(name)
    run = compiled(log, constants_for(), DEFAULT_PRIOR)
    assert verdict(run, points_of(log, run)) == MOTIONS[name][2]


@pytest.mark.parametrize("profile", ["P1", "P2", "S1", "S2", "S3", "S4", "S5"])
def test_the_published_profiles_show_every_parameter(profile: str) -> None:
    """All four, in every one of them, as sigma alone has it."""
    run = run_of(profile, 3)
    log = Columns(run.time_s, run.reading_rad_s, run.current_A)
    filtered = compiled(log, constants_for(), DEFAULT_PRIOR)
    assert all(verdict(filtered, points_of(log, filtered)))


@pytest.mark.parametrize("name", MOTIONS)
def test_points_online_are_those_of_the_log(name: str) -> None:
    """Reading by reading or all at once, in one piece or three: the same buckets."""
    log = motion(name)
    estimator, results = online(log, constants_for(), DEFAULT_PRIOR)
    run = compiled(log, constants_for(), DEFAULT_PRIOR)
    whole = points_of(log, run)
    assert (whole.speeds, whole.drives, whole.creeping, whole.starts) == (
        estimator.points.speeds, estimator.points.drives, estimator.points.creeping, estimator.points.starts
    )  # fmt: skip
    assert results[-1].valid == verdict(run, whole)
    used = run.outcome == gating.UPDATED
    speed, current = log.speed_rad_s[used], np.concatenate([[0.0], log.current_A[:-1]])[used]
    pieces = OperatingPoints.of_wheel(CK13_STATISTICAL, OMEGA_S)
    for part in (slice(0, 1000), slice(1000, 1001), slice(1001, None)):
        pieces.add_all(speed[part], current[part])
    assert (pieces.speeds, pieces.drives, pieces.creeping, pieces.starts) == (
        whole.speeds, whole.drives, whole.creeping, whole.starts
    )  # fmt: skip


def changes(results: list[Estimate], i: int) -> int:
    """How often the flag of a parameter changed."""
    flags = [r.valid[i] for r in results if r.valid is not None]
    return sum(a != b for a, b in pairwise(flags))


def test_validity_does_not_flicker_and_ends_with_a_reset() -> None:
    """Each parameter becomes valid once; after the divergence none is; each becomes valid once more."""
    log, _ = changing_wheel(1, friction=1.5)
    _, results = online(log, constants_for(), DEFAULT_PRIOR)
    at = next(i for i, r in enumerate(results) if r.health is not None)
    assert results[at - 1].valid == ParameterFlags(True, True, True, True)
    assert results[at].valid == ParameterFlags(False, False, False, False)
    assert results[-1].valid == ParameterFlags(True, True, True, True)
    assert [changes(results, i) for i in range(4)] == [3, 3, 3, 3]


def test_what_is_valid_stays_so_between_the_bounds() -> None:
    """Sigma comes down to half of the prior's, wanders to 0.65 of it, then to 0.75: valid, valid, no more."""
    shown = ParameterFlags(True, True, True, True)
    validity = Validity(DEFAULT_PRIOR)
    values, before = tuple(CK13_STATISTICAL), np.array(DEFAULT_PRIOR.parameter_std)
    flags = [validity.step(values, tuple(share * before), shown).motor_gain for share in (0.6, 0.5, 0.65, 0.75, 0.65)]
    assert flags == [False, True, True, False, False]


def test_what_was_known_before_is_valid_from_the_start() -> None:
    """A learned belief is valid before the wheel has moved, and stays so at rest."""
    known = Belief(DEFAULT_PRIOR.mean, 1e-4 * DEFAULT_PRIOR.covariance)
    _, results = online(motion("at rest"), constants_for(), known)
    assert all(r.valid == ParameterFlags(True, True, True, True) for r in results[:10])
    assert results[-1].valid == ParameterFlags(True, True, True, True)


@pytest.mark.parametrize("name", MOTIONS)
def test_a_log_in_parts_shows_what_it_shows_as_a_whole(name: str) -> None:
    """Once a motion has shown all four parameters the rest of it is not counted: it can take none of them back."""
    log = motion(name)
    whole, parts = (OperatingPoints.of_wheel(CK13_STATISTICAL, OMEGA_S) for _ in range(2))
    whole.add_all(log.speed_rad_s, log.current_A)
    shown = []
    for part in np.array_split(np.arange(N), 17):
        parts.add_all(log.speed_rad_s[part], log.current_A[part])
        shown.append(parts.shown)
    assert parts.shown == whole.shown
    assert all(after >= before for one, other in pairwise(shown) for before, after in zip(one, other, strict=True))
