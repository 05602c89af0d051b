"""The budget of a diagnosis: what is counted, what is left out for it, and that it is said."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from rw_ekf.diagnosis.hypotheses.candidates import powers
from rw_ekf.diagnosis.log_diagnosis import diagnose_log
from rw_ekf.diagnosis.prepare import preparation
from rw_ekf.diagnosis.report.text import diagnosis_text
from rw_ekf.likelihood.work_budget import Work
from rw_ekf.logs.reader import read_log
from rw_ekf.logs.wheel_log import WheelLog
from tests.commands.logs import write_log
from tests.diagnosis.simulated import log_of, simulated


class Clock:
    """Seconds that pass when they are told to."""

    def __init__(self) -> None:
        """At zero."""
        self.now = 0.0

    def __call__(self) -> float:
        """Now."""
        return self.now


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> WheelLog:
    """Five minutes of a wheel with quadratic drag."""
    run = simulated(["quadratic_drag:coefficient_1_rad=4e-6"], seed=4, samples=3000)
    path = tmp_path_factory.mktemp("logs") / "log.csv"
    header = "time_s,speed_rad_s,current_command_A"
    return read_log(write_log(path, [run.time_s, run.measured_speed_rad_s, run.current_command_A], header))


def test_a_share_is_spent_by_count_or_by_clock() -> None:
    """A stage has room while less than its share of the units, and of the seconds, is gone."""
    clock = Clock()
    work = Work(100.0, 10.0, clock)
    assert work.has(0.5)
    work.charge(49.0)
    assert work.has(0.5)
    work.charge(2.0)
    assert not work.has(0.5)
    assert work.has(0.8)
    clock.now = 8.5
    assert not work.has(0.8)
    work.start_clock()
    assert work.has(0.8)


def test_what_is_left_out_is_said_once() -> None:
    """Nothing left out, no sentence; the same thing twice is one item."""
    work = Work()
    assert work.sentences() == []
    work.leave_out("rivals of torque_ripple")
    work.leave_out("rivals of torque_ripple")
    (stated,) = work.sentences()
    assert stated.count("rivals of torque_ripple") == 1


def test_an_ordinary_record_leaves_nothing_out(log: WheelLog) -> None:
    """Five minutes at 10 Hz are well within the budget: the document's list is there, and empty."""
    document = diagnose_log(log).document()
    assert document["left_out"] == []
    assert document["verdict"]["effects"] == ["quadratic_drag"]


def test_a_spent_budget_ends_in_a_verdict_that_says_so(log: WheelLog, monkeypatch: pytest.MonkeyPatch) -> None:
    """With next to no budget there is still a verdict, twice the same; what was left out is in document and text.

    Counted work decides, not time: the clock here stands still.
    """
    monkeypatch.setattr(preparation, "Work", lambda: Work(1.0e6, 1.0, Clock()))
    documents = [diagnose_log(log).document() for _ in range(2)]
    assert documents[0] == documents[1]
    document = documents[0]
    assert document["verdict"]["kind"] in {"adequate", "effect", "unexplained"}
    assert document["left_out"]
    assert document["before"]["free_run_rms_rpm"] is not None
    text = diagnosis_text(document, directory=Path("there"))
    for item in document["left_out"]:
        assert any(item in warning for warning in document["warnings"])
        assert item in text


def test_ways_of_being_late_are_weighed_when_the_budget_is_nearly_spent(monkeypatch: pytest.MonkeyPatch) -> None:
    """A lag that an average imitates, two thirds of the work gone: both stand, and the truth is no less likely.

    Left out they had no probability, and hours of a lag were an average with 99 %.
    """
    run = simulated(["actuator_lag:time_constant_s=0.06"], seed=41, samples=3000, profile="P2")
    monkeypatch.setattr(preparation, "Work", lambda: Work(1.2e9, 1.0, Clock()))
    document = diagnose_log(log_of(run)).document()
    posterior = document["verdict"]["posterior"]
    assert document["left_out"]
    assert posterior["actuator_lag"] > 0.3
    assert posterior["speed_averaging"] + posterior["transport_delay"] > 0.1


def test_powers_are_those_of_the_sum_written_out() -> None:
    """Phasors from two tables give the power of exponentials, at even frequencies with gaps and at uneven ones."""
    rng = np.random.default_rng(5)
    time_s = 3.0 + np.cumsum(rng.uniform(0.05, 0.2, 700))
    values = rng.standard_normal((2, 700))
    values[:, rng.choice(700, 60)] = 0.0
    even = 0.004 * np.arange(3, 400)
    frequency = np.concatenate((np.delete(even, [30, 31, 200, *range(130, 185)]), even[-1] * 1.002 ** np.arange(1, 90)))
    written = np.abs(np.exp(-2j * np.pi * np.outer(frequency, time_s)) @ values.T.astype(np.complex128)).T ** 2
    np.testing.assert_allclose(powers(frequency, time_s, values), written, rtol=1e-7)
