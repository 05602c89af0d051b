"""The loop: sample, filter, state, command, alarms, sinks. One for a wheel on a line, a record and a simulation."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence

from rw_ekf.driver import WheelDriver
from rw_ekf.errors import EndOfRecord
from rw_ekf.filter.estimator import Estimator
from rw_ekf.records import Alarms, CompensationNow, Estimate, IssuedCommand, Reading, Sink, StateNow, Tick

Issue = Callable[[Tick], IssuedCommand | None]  # decides and sends what follows a sample; None: no command is known
Watch = Callable[[Tick], Alarms]
Judge = Callable[[Reading, Estimate | None], StateNow | None]  # the state of the run, before anything is commanded


def run_loop(
    readings: Iterable[Reading],
    estimator: Estimator,
    issue: Issue,
    sinks: Sequence[Sink],
) -> None:
    """Run until the readings end: every turn of `turns`, one after the other, with nobody who watches or judges."""
    for _ in turns(readings, estimator, issue, sinks):
        pass


def turns(
    readings: Iterable[Reading],
    estimator: Estimator,
    issue: Issue,
    sinks: Sequence[Sink],
    watch: Watch = lambda tick: Alarms(),
    judge: Judge = lambda reading, estimate: None,
    turned: Callable[[StateNow | None], None] = lambda state: None,
    compensating: Callable[[StateNow | None], CompensationNow | None] = lambda state: None,
) -> Iterator[None]:
    """One turn of the loop for each reading; yields behind every one, so that others may have theirs in between.

    Time is each sample's own; no clock is read here.

    turned: given the state at the end of every turn, behind all sinks. compensating: what becomes of a compensation in
    a state, called in every turn behind the command.

    A turn without a sample is judged and shown to the sinks, with the sample and the estimate of before; there is none
    to show before the first sample.
    """
    tick: Tick | None = None
    alarms = Alarms()
    for reading in readings:
        sample, link, _, host_s = reading
        if sample is None:
            state = judge(reading, None)
            if tick is not None:
                now = compensating(state)
                tick = Tick(
                    tick.sample, tick.estimate, None, alarms.on, link, state, fresh=False, compensation=now,
                    host_s=host_s,
                )  # fmt: skip
        else:
            estimate = estimator.step(sample)
            state = judge(reading, estimate)
            command = issue(Tick(sample, estimate, None, alarms.on, link, state))
            if command is not None:
                estimator.command_issued(command)
            alarms = watch(Tick(sample, estimate, command, alarms.on, link, state))
            now = compensating(state)
            tick = Tick(
                sample, estimate, command, alarms.on, link, state, alarms_over=alarms.over, compensation=now,
                host_s=host_s,
            )  # fmt: skip
        if tick is not None:
            for sink in sinks:
                sink.write(tick)
        turned(state)
        yield


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


def with_following_command(readings: Iterator[Reading]) -> Iterator[tuple[Reading, IssuedCommand | None]]:
    """Pair each reading with the command that telemetry reports at the next one, a tick later.

    Beside another controller the command of an interval is known only at its end: what a reading reports as in force
    was set after the reading before. Readings wait over ticks without a reply, except for those without a sample, which
    are passed on at once. The last is dropped: nothing is known of what followed.
    """
    waiting: list[Reading] = []
    for reading in readings:
        sample = reading.sample
        if sample is None:
            yield reading, None
            continue
        current = sample.current_command_A if sample.current_command_A is not None else sample.current_A
        if current is not None:
            for before in waiting:
                yield before, IssuedCommand(current)
            waiting.clear()
        waiting.append(reading)


def following(readings: Iterator[Reading]) -> tuple[Iterator[Reading], Issue]:
    """Beside a lab's own controller: readings a tick late, and what says for each the command reported after it."""
    latest: list[IssuedCommand | None] = []

    def walk() -> Iterator[Reading]:
        for reading, command in with_following_command(readings):
            latest[:] = [command]
            yield reading

    def issue(tick: Tick) -> IssuedCommand | None:
        return latest[0]

    return walk(), issue
