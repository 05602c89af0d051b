"""The loop: sample, filter, command, sinks. The same for a wheel on a line, a logged run and a simulated wheel."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Protocol

from rw_ekf.errors import EndOfRecord
from rw_ekf.filter.estimator import Estimator
from rw_ekf.records import IssuedCommand, StepResult, WheelDriver, WheelSample


class Sink(Protocol):
    """Takes every sample with what became of it."""

    def write(self, sample: WheelSample, command: IssuedCommand | None, result: StepResult) -> None:
        """Take one sample."""
        ...

    def close(self) -> None:
        """Finish. Safe to call twice."""
        ...


Issue = Callable[[WheelSample, StepResult], IssuedCommand | None]


def run_loop(samples: Iterable[WheelSample], estimator: Estimator, issue: Issue, sinks: Sequence[Sink]) -> None:
    """Run until the samples end. Time is each sample's own; no clock is read here.

    issue: decides and sends the command that follows a sample; None where no command is known.
    """
    for sample in samples:
        result = estimator.step(sample)
        command = issue(sample, result)
        if command is not None:
            estimator.command_issued(command)
        for sink in sinks:
            sink.write(sample, command, result)


def samples_of_record(driver: WheelDriver) -> Iterator[WheelSample]:
    """Every sample of a replayed record, at once."""
    while True:
        try:
            sample = driver.read(0.0)
        except EndOfRecord:
            return
        if sample is not None:
            yield sample


def command_of_record(driver: WheelDriver) -> Issue:
    """Issue what the record says was in force after each sample."""
    return lambda sample, result: driver.command_current(0.0)  # a record commands nothing: it answers what was logged
