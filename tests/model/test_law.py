"""A law without a formula, evaluated: its knots, its mean over a turn, what it adds to a step."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rw_ekf.arrays import Float64Array
from rw_ekf.course.course import Course
from rw_ekf.course.free_run import free_run
from rw_ekf.effects.catalogue import CHANGE, LEARNED
from rw_ekf.filter.constants import filter_constants
from rw_ekf.filter.log_filter import filter_log
from rw_ekf.learning.aged_model import carried_over
from rw_ekf.model.effect import Term
from rw_ekf.model.law import ActsAs, Law, Quantity, arc, law_value, point, sums_of
from rw_ekf.model.state import CK13_STATISTICAL, SPEED
from rw_ekf.wheel.effect_table import EffectSet
from rw_ekf.wheel.interval import Interval, Pieces
from rw_ekf.wheel.model_file import WheelModel, model_from_data
from rw_ekf.wheel.pieces import effect_interval, row_size

K, B, C, S = CK13_STATISTICAL
OMEGA_S = 0.42
STEP_S = 1.0e-4
START = 8.0  # rad/s


def law_of(quantity: Quantity, acts_as: ActsAs, first: float, last: float, values: Float64Array, **more: object) -> Law:
    """A law of these values on even knots."""
    return Law(quantity, acts_as, first, last, (tuple(values.tolist()),), **more)  # type: ignore[arg-type]


def effects_of(*laws: Law) -> EffectSet:
    """Laws in use as they were found."""
    return EffectSet(tuple(Term(LEARNED, (1.0,), (0.01,), law=law) for law in laws))


def test_it_is_straight_between_knots_and_level_beyond() -> None:
    """As numpy's interpolation has it, with its slope; beyond the knots the slope is nothing."""
    values = np.array([1.0, 3.0, -2.0, 0.5])
    knots = np.linspace(2.0, 8.0, 4)
    for at in np.linspace(0.0, 10.0, 101):
        value, slope = law_value(values, sums_of(values), 0, 4, point(4, 2.0, 3.0 / 6.0, float(at), 1.0))
        assert value == pytest.approx(np.interp(at, knots, values))
        inside = 2.0 < at < 8.0 and min(abs(at - knots)) > 0.01
        if inside:
            ahead = np.interp([at - 1e-6, at + 1e-6], knots, values)
            assert slope == pytest.approx((ahead[1] - ahead[0]) / 2.0e-6, rel=1e-6)
        elif not 2.0 <= at <= 8.0:
            assert slope == 0.0


@pytest.mark.parametrize("turned", [1.0e-5, 0.3, -0.3, 5.0, -40.0])
def test_over_an_angle_it_is_its_mean(turned: float) -> None:
    """Of a sine the closed form, forward and back, within a knot and over several turns."""
    knots = np.linspace(0.0, 2.0 * np.pi, 721)
    values = np.sin(3.0 * knots + 0.4)
    for angle in (0.1, 3.0, -7.0, 6.28):
        found, _ = law_value(values, sums_of(values), 0, values.size, arc(values.size, angle, turned))
        ends = np.cos(3.0 * np.array([angle, angle + turned]) + 0.4)
        assert found == pytest.approx((ends[0] - ends[1]) / (3.0 * turned), abs=2.0e-4)


def stepped(course: Course, extra: str) -> Float64Array:
    """Speeds (n,) of a wheel with one law written out, by small explicit steps and none of the package's equations."""
    speed = np.zeros(course.samples)
    omega, angle = float(course.speed_rad_s[0]), 0.0
    speed[0] = omega
    for i in range(course.samples - 1):
        current = float(course.pieces.current_A[course.piece_start[i]])
        volts = float(course.columns[i, 0])
        for _ in range(round(float(course.time_s[i + 1] - course.time_s[i]) / STEP_S)):
            along = math.copysign(1.0, omega)
            drag = 0.05 + 0.002 * abs(omega) if extra == "drag" else 0.0
            torque = 0.1 * math.sin(2.0 * angle) if extra == "angle" else 0.0
            gain = 0.02 * (volts - 28.0) if extra == "gain" else 0.0
            windage = 2.0e-5 * volts / 28.0 * omega * abs(omega) if extra == "windage" else 0.0
            lost = {"loss": 0.01, "lost": min(0.15, abs(current))}.get(extra, 0.0)
            loss = lost * math.copysign(1.0, current)
            bump = math.exp(-((omega / OMEGA_S) ** 2))
            rate = K * (1.0 + gain) * (current - loss) - torque - windage - B * omega
            rate -= along * (C + (S - C) * bump + drag)
            angle += STEP_S * omega
            omega += STEP_S * rate
        speed[i + 1] = omega
    return speed


LAWS = {
    "drag": law_of("speed_size", "drag", 0.0, 200.0, 0.05 + 0.002 * np.linspace(0.0, 200.0, 5)),
    "angle": law_of("angle", "torque", 0.0, 2.0 * np.pi, 0.1 * np.sin(2.0 * np.linspace(0.0, 2.0 * np.pi, 385))),
    "gain": law_of(
        "column", "motor_gain", 20.0, 36.0, 0.02 * (np.linspace(20.0, 36.0, 9) - 28.0), column="bus_voltage_V"
    ),
    "windage": law_of("column", "windage", 0.0, 56.0, np.array([0.0, 4.0e-5]), column="bus_voltage_V"),
    "loss": law_of("time", "current_loss", -1.0, 1.0e4, np.array([0.01, 0.01])),
    "lost": law_of("time", "current_loss", -1.0, 1.0e4, np.array([0.15, 0.15])),  # more than there is, at last
}


@pytest.mark.parametrize("name", LAWS)
def test_a_wheel_with_it_goes_as_small_steps_have_it(name: str) -> None:
    """Drag over speed, torque over angle, gain and windage over a column, a loss of current: within a thousandth."""
    time_s = np.linspace(0.0, 5.9, 60)
    current_A = np.where(time_s < 3.0, 0.2, -0.1)
    volts = np.full((60, 3), np.nan)
    volts[:, 0] = 28.0 + np.sin(time_s)
    course = Course.of(time_s, np.full(60, START), current_A, None, None, np.full(60, 20.0), None, volts)
    truth = stepped(course, name)
    angle = np.concatenate(([0.0], np.cumsum(0.5 * (truth[1:] + truth[:-1]) * 0.1)))
    state = np.array([[START, K, B, C, S, 1.0]])
    ends = free_run(
        course._replace(angle_rad=angle), effects_of(LAWS[name]), filter_constants(OMEGA_S).stribeck, state,
        np.zeros(1, np.int64), np.full(1, 59), keep_path=True,
    ).path_rad_s  # fmt: skip
    moved = np.max(np.abs(truth - stepped(course, "")))
    assert np.max(np.abs(ends - truth)) < 0.01 * moved + 2.0e-4


@pytest.mark.parametrize(("current_A", "shows"), [(0.2, True), (0.1, False), (-0.1, False)])
def test_a_current_that_is_lost_altogether_says_nothing_of_the_loss(current_A: float, shows: bool) -> None:
    """A wheel that gets no torque from a current smaller than its loss is not driven backwards; its slope is zero."""
    effects = effects_of(LAWS["lost"])
    ends, row = [], np.zeros(row_size(effects.table().size))
    for amplitude in (1.0, 1.0 + 1.0e-6):
        x = np.array([START, K, B, C, S, amplitude])
        end = np.zeros(x.size)
        interval = Interval(0.0, 0.1, 20.0, 0.0, 0, 0, 1, (math.nan,) * 3)
        pieces = Pieces([0.0], [0.1], [current_A])
        effect_interval(x, effects.table(), filter_constants(OMEGA_S).stribeck, pieces, interval, True, row, end)
        ends.append(end[SPEED])
    assert row[5] == pytest.approx((ends[1] - ends[0]) / 1.0e-6, abs=1.0e-6)
    assert bool(row[5]) is shows


def test_the_filter_learns_its_amplitude() -> None:
    """A law a quarter too small in the model is scaled up by the readings, within its sigma."""
    time_s = np.linspace(0.0, 119.9, 1200)
    current_A = 0.15 * np.sign(np.sin(2.0 * np.pi * time_s / 40.0)) + 0.05
    course = Course.of(time_s, np.full(1200, 30.0), current_A)
    course = course._replace(columns=np.zeros((1200, 3)))
    speed = stepped(course, "drag") + 0.1 * np.random.default_rng(3).standard_normal(1200)
    values = 0.75 * np.array(LAWS["drag"].functions[0])
    effects = EffectSet((Term(LEARNED, (1.0,), (0.5,), law=law_of("speed_size", "drag", 0.0, 200.0, values)),))
    mean = np.array([30.0, K, B, C, S, 1.0])
    covariance = np.diag(np.square([0.1, 0.01, 1e-5, 1e-4, 1e-3, 0.5]))
    constants = filter_constants(OMEGA_S, speed_noise_rad_s=0.1)
    run = filter_log(course._replace(speed_rad_s=speed), constants, mean, covariance, effects)
    assert run.mean[5] == pytest.approx(4.0 / 3.0, abs=4.0 * math.sqrt(run.covariance[5, 5]))
    assert math.sqrt(run.covariance[5, 5]) < 0.1


def model_with(*terms: Term) -> WheelModel:
    """A model with laws and changes."""
    size = 4 + len(terms)
    return WheelModel(
        CK13_STATISTICAL, tuple(map(tuple, (1e-6 * np.eye(size)).tolist())), OMEGA_S, effects=EffectSet(terms)
    )


def test_a_model_file_brings_it_back() -> None:
    """Values, range, column, amplitude and its sigma; the columns' slots are those of the model."""
    change = Law("time", "motor_gain", 280.0, 280.01, ((0.0, 1.0),), spread=(2.0,))
    model = model_with(
        Term(LEARNED, (1.0,), (0.02,), law=LAWS["gain"]), Term(LEARNED, (0.9,), (0.1,), law=LAWS["drag"]),
        Term(CHANGE, (-0.05,), (0.001,), law=change),
    )  # fmt: skip
    again = model_from_data(model.document(), lambda path: "model.yaml")
    assert again.effects == model.effects
    assert again.effects.columns == ("bus_voltage_V",)


@pytest.mark.parametrize(
    ("spoilt", "words"),
    [
        ({"range": [3.0, 3.0]}, "the last knot must lie beyond the first"),
        ({"quantity": "colour"}, "colour"),
        ({"column": ""}, "names the log's column"),
        ({"values": [1.0]}, "values"),
        ({"std": [1.0, 2.0, 3.0]}, "has 3 numbers"),
    ],
)
def test_a_spoilt_law_is_refused_in_words(spoilt: dict[str, object], words: str) -> None:
    """Each with what was found."""
    document = model_with(Term(LEARNED, (1.0,), (0.02,), law=LAWS["gain"])).document()
    document["effects"][0]["law"] |= spoilt
    with pytest.raises(Exception, match=words):
        model_from_data(document, lambda path: "model.yaml:1:1")
    document["effects"][0].pop("law")
    with pytest.raises(Exception, match="is missing"):
        model_from_data(document, lambda path: "model.yaml:1:1")


def test_a_run_begins_with_what_holds_now() -> None:
    """A change in the record that a model was found in is in force in the next run from its begin."""
    change = Law("time", "torque", 280.0, 280.01, ((0.0, 1.0),), spread=(2.0,))
    kept, notes = carried_over(model_with(Term(CHANGE, (0.05,), (0.001,), law=change)))
    (term,) = kept.effects.terms
    assert term.law is not None
    assert set(term.law.functions[0]) == {1.0}
    assert term.values == (0.05,)
    assert "as it was at the end of its record" in notes[0]
