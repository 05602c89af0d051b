"""The loop: sample, filter, command, alarms, sinks. The same for a wheel on a line, a record and a simulated wheel."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence

from rw_ekf.driver import WheelDriver
from rw_ekf.errors import EndOfRecord
from rw_ekf.filter.estimator import Estimator
from rw_ekf.records import ActiveAlarm, IssuedCommand, Reading, Sink, Tick

Issue = Callable[[Tick], IssuedCommand | None]  # decides and sends what follows a sample; None: no command is known
Watch = Callable[[Tick], tuple[ActiveAlarm, ...]]  # the alarms that are on


def run_loop(
    readings: Iterable[Reading],
    estimator: Estimator,
    issue: Issue,
    sinks: Sequence[Sink],
    watch: Watch = lambda tick: (),
) -> None:
    """Run until the readings end. Time is each sample's own; no clock is read here."""
    alarms: tuple[ActiveAlarm, ...] = ()
    for sample, link in readings:
        estimate = estimator.step(sample)
        command = issue(Tick(sample, estimate, None, alarms, link))
        if command is not None:
            estimator.command_issued(command)
        alarms = watch(Tick(sample, estimate, command, alarms, link))
        tick = Tick(sample, estimate, command, alarms, link)
        for sink in sinks:
            sink.write(tick)


def readings_of_record(driver: WheelDriver) -> Iterator[Reading]:
    """Every sample of a replayed record, at once."""
    while True:
        try:
            sample = driver.read(0.0)
        except EndOfRecord:
            return
        if sample is not None:
            yield Reading(sample)


def command_of_record(driver: WheelDriver) -> Issue:
    """Issue what the record says was in force after each sample."""
    return lambda tick: driver.command_current(0.0)  # a record commands nothing: it answers what was logged
