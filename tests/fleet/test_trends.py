"""Courses, siblings and remaining time against simulated truth; bands hold what they say they hold."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from rw_ekf.arrays import Float64Array
from rw_ekf.errors import BadInputError
from rw_ekf.fleet.course_fit import ANY_WALK, CourseFit, Points, fit_course, walks_of_fleet
from rw_ekf.fleet.daily import WheelDays
from rw_ekf.fleet.fleet_page import page_of
from rw_ekf.fleet.points import course_of, far_off
from rw_ekf.fleet.remaining import Limit, limits_of, remaining
from rw_ekf.fleet.result_rows import own_share
from rw_ekf.fleet.siblings import siblings_of
from rw_ekf.fleet.simulation import FleetShape
from rw_ekf.fleet.trend_document import Trends
from rw_ekf.fleet.trend_findings import finding_kinds, sentences
from rw_ekf.fleet.wheel_trends import trends_of
from rw_ekf.one_thread import one_thread
from tools.measure.fleet import daily_estimates


@pytest.fixture(autouse=True)
def _one_thread() -> Any:
    """As `trends` has it."""
    with one_thread():
        yield


def points(value: Float64Array, std: float, years: float = 1.0, warmth_K: Float64Array | None = None) -> Points:
    n = value.size
    return Points(np.linspace(0.0, years, n), value, np.full(n, std**2), np.ones(n), np.zeros(n), years, warmth_K)


def wheel_days(value: Float64Array, std: float, temperature_degC: float | Float64Array = 20.0) -> WheelDays:
    n = value.size
    numbers = dict.fromkeys(("motor_gain", "viscous", "coulomb", "static"), value)
    days = tuple(str(np.datetime64("2026-01-01") + np.timedelta64(i, "D")) for i in range(n))
    warmth = np.broadcast_to(np.asarray(temperature_degC, dtype=np.float64), n).copy()
    stds = {name: np.full(n, std) for name in numbers}
    return WheelDays(
        "W", 20454.0 + np.arange(n, dtype=np.float64), days, ("",) * n, np.ones(n, bool), ("ok",) * n, numbers, stds,
        warmth, np.ones(n), np.ones(n), np.zeros(n), np.zeros(n, bool), np.zeros(n, bool), np.full(n, np.nan), {},
    )  # fmt: skip


def test_a_line_in_white_noise_is_least_squares() -> None:
    """Rate and level of a quiet course are those of numpy's polyfit, and the band is hardly wider than its own."""
    rng = np.random.default_rng(1)
    value = 0.6 + 0.05 * np.linspace(0.0, 1.0, 60) + 0.002 * rng.standard_normal(60)
    fit = fit_course(points(value, 0.002), np.eye(10)[0])  # no walk at all
    (slope, _), covariance = np.polyfit(np.linspace(0.0, 1.0, 60), value, 1, cov="unscaled")
    assert fit.rate == pytest.approx(slope, abs=1e-6)
    assert 0.002 * np.sqrt(covariance[0, 0]) <= fit.rate_std < 1.6 * 0.002 * np.sqrt(covariance[0, 0])
    assert fit.steps == ()


@pytest.mark.slow
@pytest.mark.parametrize("walk", [0.0, 0.006])
def test_the_band_of_a_rate_holds_what_it_says(walk: float) -> None:
    """Of 200 wheels that wander, or do not, some nineteen in twenty rates lie in their 95 % bands, which are narrow."""
    rng = np.random.default_rng(2)
    n = 60
    values = [
        0.6 + walk * np.cumsum(rng.standard_normal(n)) / np.sqrt(n) + 0.002 * rng.standard_normal(n) for _ in range(200)
    ]
    walks = walks_of_fleet(np.array([fit_course(points(value, 0.001)).walks for value in values]))
    fits = [fit_course(points(value, 0.001), walks) for value in values]
    inside = sum(abs(fit.rate) < 1.96 * fit.rate_std for fit in fits)
    assert inside >= 0.905 * 200  # a binomial of .95 is below that once in 500
    assert np.median([fit.rate_std for fit in fits]) < 2.0 * np.std([fit.rate for fit in fits])


def test_a_season_is_taken_out() -> None:
    """A friction that follows the temperature over half a year, which a line alone would take for ageing."""
    rng = np.random.default_rng(3)
    warmth = 10.0 * np.linspace(-1.0, 1.0, 60) + 2.0 * rng.standard_normal(60)
    value = 0.6 * (1.0 - 0.01 * warmth) + 0.001 * rng.standard_normal(60)
    fit = fit_course(points(value, 0.001, 0.5, warmth))
    assert fit.per_K == pytest.approx(-0.006, abs=4.0 * (fit.per_K_std or 0.0))
    assert abs(fit.rate) < 4.0 * fit.rate_std < 0.05
    assert abs(fit_course(points(value, 0.001, 0.5)).rate) > 0.2


def test_a_step_is_found_on_its_day() -> None:
    """Of a year of days, in spans of several: the very day, its size, and the rate beside it."""
    rng = np.random.default_rng(4)
    value = 0.6 + 0.002 * rng.standard_normal(365)
    value[200:] += 0.05
    course = course_of(wheel_days(value, 0.002), "coulomb", None)
    assert course is not None
    (step,) = course.fit.steps
    assert course.starts[step.before + 1] == 200
    assert step.size == pytest.approx(0.05, abs=4.0 * step.std)
    assert step.std < 0.002
    assert abs(course.fit.rate) < 4.0 * course.fit.rate_std


def test_noise_has_no_steps() -> None:
    """Of fifty quiet courses and fifty that wander none, and none, has a step."""
    rng = np.random.default_rng(5)
    quiet = [fit_course(points(0.6 + 0.002 * rng.standard_normal(40), 0.001)) for _ in range(50)]
    walking = [fit_course(points(0.6 + 0.002 * np.cumsum(rng.standard_normal(40)), 0.001), ANY_WALK) for _ in range(50)]
    assert sum(len(fit.steps) for fit in quiet) <= 1
    assert sum(len(fit.steps) for fit in walking) <= 1


def test_a_day_that_is_far_off_is_left_out_and_a_step_is_not() -> None:
    """One day with a spike goes; the days after a step stay."""
    rng = np.random.default_rng(6)
    value = 0.6 + 0.001 * rng.standard_normal(60)
    value[30:] += 0.05
    value[10] += 0.1
    assert np.flatnonzero(far_off(value, np.full(60, 0.001), np.arange(60.0))[1]).tolist() == [10]


@pytest.mark.parametrize("share", [0.05, 0.16, -0.3])
@pytest.mark.parametrize("at", [0, -1])
def test_one_odd_day_at_an_end_is_no_step(share: float, at: int) -> None:
    """The first or the newest day is off: left out, and the newest said; two that are off alike are a step's first."""
    rng = np.random.default_rng(16)
    for n in (30, 60, 120):
        value = 0.6 * (1.0 + 0.003 * rng.standard_normal(n))
        value[at] *= 1.0 + share
        days = wheel_days(value, 0.0005)
        (wheel,) = trends_of([days], {}).wheels
        trend = wheel.parameters["coulomb"]
        assert trend.fit.steps == ()
        assert trend.course.known.far_off.tolist() == [at % n]
        assert trend.course.known.far_by[0] == pytest.approx(share, abs=0.015)
        assert any(f"{100.0 * trend.course.known.far_by[0]:+.3g} % off" in text for text in sentences(wheel)) == (
            at < 0
        )
        value[-2:] = 0.6 * (1.0 + share)
        course = course_of(wheel_days(value, 0.0005), "coulomb", None)
        assert course is not None
        if at < 0:
            (step,) = course.fit.steps
            assert course.known.rows[course.starts[step.before + 1]] == n - 2
            assert step.size == pytest.approx(0.6 * share, abs=4.0 * step.std)


def test_a_course_that_rises_fast_has_no_odd_days_at_its_ends() -> None:
    """A wheel that ages by two scatters a day, straight: no day of it is far off what is around it."""
    rng = np.random.default_rng(17)
    value = 0.6 + 0.004 * np.arange(40) + 0.002 * rng.standard_normal(40)
    assert not far_off(value, np.full(40, 0.001), np.arange(40.0))[1].any()


@pytest.mark.parametrize("tail", [(5, 10, 15), (3, 6, 12, 24), (1, 2, 4, 7, 11), (2, 4, 6, 8, 10)])
@pytest.mark.parametrize("n", [40, 200])
def test_a_wheel_that_fails_by_more_each_day_is_not_taken_for_odd_days(tail: tuple[int, ...], n: int) -> None:
    """Its last days are off by ever more per cents: all of them stay, and what they do is said."""
    value = 0.6 * (1.0 + 0.001 * np.random.default_rng(1).standard_normal(n))
    value[-len(tail) :] *= 1.0 + 0.01 * np.array(tail)
    wheel = trends_of([wheel_days(value, 0.0005)], {}).wheels[0]
    assert wheel.parameters["coulomb"].course.known.far_off.size == 0
    assert [text for text in sentences(wheel) if text.startswith("coulomb stepped")]


def test_a_day_beyond_a_long_gap_is_not_judged_by_those_before_it() -> None:
    """A straight course with weeks without logs, in a store or between campaigns: no day of it is odd."""
    rng = np.random.default_rng(1)
    for at in (np.r_[0:12, 100], np.r_[0:5, 60:65, 120:125, 180], np.r_[0, 90:102]):
        value = 0.6 * (1.0 + 0.0005 * at) * (1.0 + 0.0003 * rng.standard_normal(at.size))
        assert not far_off(value, np.full(at.size, 0.0002), at.astype(np.float64))[1].any()


def test_a_cold_day_is_not_an_odd_one_where_the_temperature_is_logged() -> None:
    """The newest day is 20 K colder, a kelvin does 1 %: it stays; off by as much without a reason it does not."""
    rng = np.random.default_rng(2)
    warmth = 5.0 * np.sin(np.arange(40.0)) + np.where(np.arange(40) == 39, -20.0, 0.0)
    value = 0.6 * (1.0 - 0.01 * warmth) * (1.0 + 0.001 * rng.standard_normal(40))
    cold = trends_of([wheel_days(value, 0.0005, 20.0 + warmth)], {}).wheels[0]
    assert cold.parameters["coulomb"].course.known.far_off.size == 0
    odd = trends_of([wheel_days(value, 0.0005, 20.0 + warmth * (np.arange(40) < 39))], {}).wheels[0]
    assert odd.parameters["coulomb"].course.known.far_off.tolist() == [39]


@pytest.mark.parametrize("n", [5, 8, 14])
def test_no_limit_is_near_of_which_a_few_days_know_no_rate(n: int) -> None:
    """Forty healthy wheels with a week or two of days: none is said to reach +10 %; one that wears by 3 % a day is."""
    rng = np.random.default_rng(18)
    for _ in range(40):
        value = 0.6 * (1.0 + 0.003 * rng.standard_normal(n))
        wheel = trends_of([wheel_days(value, 0.0005)], limits_of(["coulomb=+10%"])).wheels[0]
        assert not [text for text in sentences(wheel) if "limit" in text]
    value = 0.6 * (1.0 + 0.03 * np.arange(n) + 0.003 * rng.standard_normal(n))
    worn = trends_of([wheel_days(value, 0.0005)], limits_of(["coulomb=+50%"])).wheels[0]
    assert [text for text in sentences(worn) if "limit" in text]


def test_logs_that_are_of_no_use_are_said() -> None:
    """Readings rejected, a column misread, a filter reset, ten times the noise: each from its day to the newest."""
    healthy = wheel_days(0.6 + 0.001 * np.random.default_rng(19).standard_normal(40), 0.001)
    late = np.arange(40) >= 30
    nothing = {name: np.where(late, np.nan, value) for name, value in healthy.values.items()}
    for changed, word in (
        (replace(healthy, rejected_share=np.where(late, 0.4, 0.0)), "are rejected"),
        (replace(healthy, misread=late), "misread"),
        (replace(healthy, values=nothing), "was reset"),
        (replace(healthy, innovation_rpm=np.where(late, 10.0, 1.0)), "innovations are"),
    ):
        (found,) = [text for text in sentences(trends_of([changed], {}).wheels[0]) if word in text]
        assert found.startswith("on its newest 10 days, since 2026-01-31, ")
        over = replace(changed, rejected_share=changed.rejected_share * late[::-1], misread=late[::-1])
        assert not [text for text in sentences(trends_of([over], {}).wheels[0]) if "misread" in text]
    assert sentences(trends_of([healthy], {}).wheels[0]) == []


def test_what_is_not_known_is_said() -> None:
    """Four days, few wheels, no temperature: no number says that all is well."""
    value = 0.6 + 0.001 * np.random.default_rng(20).standard_normal(40)
    text = Trends("f", trends_of([wheel_days(value, 0.001), wheel_days(value[:4], 0.001)], {}), {}).text()
    assert "no trend, step or limit is known of 1 of 2 wheels (W): no parameter is known on 5 of their days" in text
    assert "no wheel is held against its siblings" in text
    assert "temperature is taken out of 0 of 4 courses" in text


def test_what_a_log_says_alone_is_the_filter_s_gain() -> None:
    """Two Gaussians multiplied and taken apart again; from the start of all, what the log would have given alone."""
    rng = np.random.default_rng(7)

    def covariance() -> Float64Array:
        root = rng.standard_normal((4, 4))
        return np.asarray(root @ root.T + 0.1 * np.eye(4))

    before, log = (rng.standard_normal(4), covariance()), (rng.standard_normal(4), 0.01 * covariance())
    origin = (rng.standard_normal(4), 100.0 * covariance())

    def product(one: Any, other: Any) -> tuple[Float64Array, Float64Array]:
        joint = np.linalg.inv(np.linalg.inv(one[1]) + np.linalg.inv(other[1]))
        return joint @ (np.linalg.solve(one[1], one[0]) + np.linalg.solve(other[1], other[0])), joint

    found, expected = own_share(before, product(before, log), origin), product(origin, log)
    assert found[0] == pytest.approx(expected[0], rel=1e-6, abs=1e-9)
    assert found[1] == pytest.approx(expected[1], rel=1e-6, abs=1e-9)


def test_a_wheel_unlike_its_siblings_is_told() -> None:
    """One of thirty lies ten spreads off: told, hardly drawn to the rest, whose mean and spread stay theirs."""
    rng = np.random.default_rng(8)
    value = 1.0 + 0.05 * rng.standard_normal(30)
    value[7] = 1.6
    found = siblings_of(value, np.full(30, 0.01), 0.001)
    assert found is not None
    assert np.flatnonzero(found.unlike > 0.5).tolist() == [7]
    assert found.mean == pytest.approx(1.0, abs=0.04)
    assert found.spread == pytest.approx(0.05, rel=0.5)
    assert found.shrunk[7] > 1.55
    assert siblings_of(value[:4], np.full(4, 0.01), 0.001) is None


def test_a_wheel_that_is_hardly_known_is_drawn_to_its_siblings() -> None:
    """By the share that its own error and their spread say: a textbook normal with a normal prior."""
    rng = np.random.default_rng(9)
    std = np.full(40, 0.01)
    std[0] = 0.1
    value = 1.0 + 0.05 * rng.standard_normal(40)
    found = siblings_of(value, std, 0.001)
    assert found is not None
    pull = found.spread**2 / (found.spread**2 + 0.1**2)
    assert found.shrunk[0] == pytest.approx(found.mean + pull * (value[0] - found.mean))
    assert found.shrunk_std[0] < 0.06


def course(rate: float, rate_std: float, walk: float = 0.0) -> CourseFit:
    return CourseFit(0.6, 0.001, 0.6, rate, rate_std, None, None, 0.001, walk, (), np.zeros(1), np.zeros(10))


def test_remaining_time_is_the_distance_over_the_rate() -> None:
    """Without a walk; infinity where it goes the other way; nothing where it is there already."""
    found = remaining(course(0.03, 0.003), 0.9)
    assert found.years_50 == pytest.approx(10.0, rel=0.02)
    assert found.years_05 == pytest.approx(0.3 / (0.03 + 1.645 * 0.003), rel=0.03)
    assert found.years_95 == pytest.approx(0.3 / (0.03 - 1.645 * 0.003), rel=0.03)
    assert remaining(course(-0.03, 0.001), 0.9).years_05 == np.inf
    assert remaining(course(-0.03, 0.001), 0.3).years_50 == pytest.approx(10.0, rel=0.02)
    assert remaining(replace(course(0.03, 0.001), level=0.95), 0.9).years_50 == 0.0


def test_remaining_time_of_a_walk_is_that_of_simulated_walks() -> None:
    """Quantiles of the first passage against a thousand walks taken step by step."""
    found = remaining(replace(course(0.05, 0.0, 0.05), level_std=0.0), 0.7)
    rng = np.random.default_rng(10)
    steps = 0.05 * 0.002 + 0.05 * np.sqrt(0.002) * rng.standard_normal((1000, 10_000))
    over = np.cumsum(steps, axis=1) > 0.1
    first = np.where(over.any(axis=1), 0.002 * over.argmax(axis=1), np.inf)
    ours = found.years_05, found.years_50, found.years_95
    for one, other in zip(ours, np.quantile(first, (0.05, 0.5, 0.95)), strict=True):
        assert one == pytest.approx(other, rel=0.15)


@pytest.mark.slow
@pytest.mark.parametrize("walk", [0.0, 0.03])
def test_level_rate_and_remaining_time_hold_what_they_say(walk: float) -> None:
    """Of a hundred simulated wheels that wear by 5 to 40 % a year, and wander or do not, after a year of days.

    Level and rate miss by their own sigmas, and the limit is reached within nine in ten of the bands of nine in ten.
    """
    rng = np.random.default_rng(12)
    days, after = 365, 15_000
    wheels, courses, rates = [], [], []
    for number in range(100):
        rate = rng.uniform(0.05, 0.4)
        wander = walk * np.cumsum(rng.standard_normal(days + after)) / np.sqrt(365.25)
        true = 0.6 * (1.0 + rate * np.arange(days + after) / 365.25 + wander)
        seen = true[:days] + 0.003 * rng.standard_normal(days)
        days_of_wheel = wheel_days(seen, 0.002)
        unknown = {name: np.full(days, np.nan) for name in days_of_wheel.values if name != "coulomb"}  # else four alike
        wheels.append(replace(days_of_wheel, wheel=f"W{number:03d}", values={**days_of_wheel.values, **unknown}))
        courses.append(true)
        rates.append(0.6 * rate)
    off: list[list[float]] = [[], []]
    early = late = 0
    for wheel, true, rate in zip(trends_of(wheels, limits_of(["coulomb=+50%"])).wheels, courses, rates, strict=True):
        trend = wheel.parameters["coulomb"]
        assert trend.remaining is not None
        off[0].append((trend.fit.level - true[days - 1]) / trend.fit.level_std)
        off[1].append((trend.fit.rate - rate) / trend.fit.rate_std)
        reached = float(np.argmax(true[days:] >= trend.remaining.limit) + 1) / 365.25
        early += reached < trend.remaining.years_05
        late += reached > trend.remaining.years_95
    for misses in off:
        assert 0.4 < np.sqrt(np.mean(np.square(misses))) < 1.3
        assert abs(np.mean(misses)) < 0.4
    assert early <= 12  # a binomial of .05 is above that once in 500
    assert late <= 12


def test_a_level_has_its_day() -> None:
    """Where the newest logs failed, and where the newest say nothing of one parameter: document, text and page."""
    rng = np.random.default_rng(13)
    days = wheel_days(0.6 + 0.001 * rng.standard_normal(20), 0.001)
    failed = np.arange(20) >= 17
    status = tuple("failed: torn" if torn else "ok" for torn in failed)
    stds = {name: np.where(failed, np.nan, std) for name, std in days.stds.items()}
    stds["static"][10:] = 1.0
    torn = replace(days, ok=~failed, status=status, stds=stds)
    reported = Trends("fleet", trends_of([replace(days, wheel="A"), replace(torn, wheel="B")], {}), {})
    by_wheel = {each["wheel"]: each for each in reported.document()["wheels"]}
    assert {each["level_day"] for each in by_wheel["A"]["parameters"].values()} == {by_wheel["A"]["last_day"]}
    levels = {name: each["level_day"] for name, each in by_wheel["B"]["parameters"].items()}
    assert levels == {**dict.fromkeys(levels, "2026-01-17"), "static": "2026-01-10"}
    stated = "3 of its 20 logs failed, the newest among them: what is told of it is of 2026-01-17 at the latest"
    assert f"B: {stated}" in reported.text()
    page = page_of(reported)
    assert stated in page
    assert "on 2026-01-17, " in page
    assert "on 2026-01-10, " in page


def test_limits_are_typed_as_values_or_shares() -> None:
    """Anything else is named."""
    assert limits_of(["coulomb=0.9", "viscous=+50%"]) == {
        "coulomb": Limit("coulomb", 0.9), "viscous": Limit("viscous", None, 0.5)
    }  # fmt: skip
    assert Limit("coulomb", None, -0.1).of(0.6) == pytest.approx(0.54)
    for text in ("coulomb", "friction=1", "coulomb=a", "coulomb=+50"):
        with pytest.raises(BadInputError, match="NAME=VALUE"):
            limits_of([text])


@pytest.mark.slow
def test_one_ageing_wheel_in_a_fleet_is_found_and_no_other() -> None:
    """Coulomb friction +0.5 % a month over a year, one wheel of forty, with seasons; the rest is let alone."""
    shape = FleetShape(40, 365, seed=11, ageing_share=0.0, failing_share=0.0)
    wheels = [daily_estimates(shape, number, 0.5 if number == 5 else 0.0) for number in range(40)]
    found = trends_of(wheels, {})
    kinds = [{(kind, name) for kind, name, _ in finding_kinds(wheel)} for wheel in found.wheels]
    assert {("ages", "coulomb"), ("unlike", "coulomb")} <= kinds[5]
    assert not any(kinds[number] for number in range(40) if number != 5)
    rate, std = found.wheels[5].parameters["coulomb"].relative_rate
    assert rate == pytest.approx(0.06, abs=4.0 * std)
