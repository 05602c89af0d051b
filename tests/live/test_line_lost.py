"""The line vanishes: the daemon reconnects with zero first, or ends and says so."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from rw_ekf.errors import DriverError
from tests.live.bench import Bench, driven, open_descriptors, served_wheel, wait_for
from tests.live.daemon import Notes, run


@pytest.fixture
def bench(tmp_path: Path) -> Iterator[Bench]:
    """A wheel on a pty."""
    with served_wheel(tmp_path) as made:
        yield made


@pytest.mark.slow
def test_zero_goes_out_after_a_reconnect_even_where_no_answer_comes_back(bench: Bench) -> None:
    """Plugged in again with its answers lost, the wheel that still turned under current is at zero within a second."""
    held: list[float] = []

    def plug_deaf() -> None:
        held.append(bench.registers.command_A)
        bench.fault("silence")
        bench.plug()
        wait_for(lambda: bench.registers.command_A == 0.0, 1.5)
        held.append(bench.registers.command_A)

    ran = run(bench, 3.4, (0.8, bench.unplug), (1.2, plug_deaf))
    assert held[0] != 0.0
    assert held[1] == 0.0
    assert ran.outcome.lost


def test_a_wheel_lost_and_back_only_at_the_end_is_still_given_zero(bench: Bench) -> None:
    """The line returns while the daemon is on its way out: zero is written over a new line and confirmed."""
    held: list[float] = []

    class Returning(Notes):
        def info(self, event: str, **context: object) -> None:
            super().info(event, **context)
            if event == "link_lost":
                held.append(bench.registers.command_A)
                threading.Timer(0.35, bench.plug).start()

        warning = error = info

    ran = run(bench, 0.8, (0.5, bench.unplug), notes=Returning())
    assert held
    assert held[0] != 0.0
    assert ran.outcome.zero_confirmed
    assert bench.registers.command_A == 0.0


def test_an_exception_inside_the_loop_leaves_the_wheel_at_zero(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    """Whatever breaks after the wheel was driven, zero reaches it before the exception is seen."""
    from rw_ekf.filter.estimator import Estimator

    was_driven: list[bool] = []

    def burst(*arguments: Any) -> Any:
        if driven(bench)():
            was_driven.append(True)
            raise ZeroDivisionError("injected")
        return step(*arguments)

    step = Estimator.step
    monkeypatch.setattr(Estimator, "step", burst)
    with pytest.raises(ZeroDivisionError, match="injected"):
        run(bench, 5.0)
    assert was_driven == [True]
    assert bench.registers.command_A == 0.0


def test_a_sink_that_breaks_does_not_end_the_run(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    """The wheel is driven to the end, the failure is said once and counted, the run is not a good one."""
    from rw_ekf.sinks.status_line import StatusLine

    def burst(*arguments: object) -> None:
        raise ZeroDivisionError("injected")

    monkeypatch.setattr(StatusLine, "write", burst)
    ran = run(bench, 0.6)
    assert ran.notes.events.count("sink_failed") == 1
    assert ran.outcome.unwritten.failed_sinks == {"status": ran.outcome.statistics.samples}
    assert ran.outcome.unwritten
    assert "ticks of sink status (ZeroDivisionError: injected)" in ran.outcome.unwritten.text()
    assert ran.outcome.zero_confirmed
    assert len(ran.log) == ran.outcome.statistics.samples


def test_a_port_that_cannot_be_opened_leaves_nothing_open(bench: Bench) -> None:
    """Twenty failed starts: an error each, no descriptor more than before, and then a run still works."""
    bench.unplug()
    with pytest.raises(DriverError, match="there is no port"):
        run(bench, 1.0)
    before = open_descriptors()
    for _ in range(20):
        with pytest.raises(DriverError, match="there is no port"):
            run(bench, 1.0)
    assert open_descriptors() == before
    bench.plug()
    assert run(bench, 0.3).outcome.zero_confirmed
