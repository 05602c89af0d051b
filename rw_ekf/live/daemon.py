"""The daemon: a configuration becomes a live wheel, an estimator and its sinks, until a signal or a duration."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from types import TracebackType
from typing import TYPE_CHECKING, Any, Self

from rw_ekf.clock import Clock
from rw_ekf.control.commanders import Commander, commander_of
from rw_ekf.driver import WheelProtocol
from rw_ekf.filter.estimator import Estimator
from rw_ekf.learning.run_start import GivenModel, Start, start_of_run
from rw_ekf.live.compensating import compensated, request_socket
from rw_ekf.live.guard import SafetyLimits
from rw_ekf.live.live_wheel import LiveWheel, Place
from rw_ekf.live.loop import following, turns
from rw_ekf.live.oversight import ALONE, Oversight
from rw_ekf.live.port_claim import PortClaim
from rw_ekf.live.process import own_process
from rw_ekf.live.published_state import leave_place
from rw_ekf.live.run_outcome import RunOutcome, outcome_of, write_model
from rw_ekf.live.sign_check import confirming
from rw_ekf.live.stop_signal import StopSignal
from rw_ekf.live.watches import RunWatches, expectation_of
from rw_ekf.logs.metadata import RunMetadata, metadata_path, utc_text, write_metadata
from rw_ekf.records import Reading
from rw_ekf.sinks.all_sinks import RunContext, sinks_of
from rw_ekf.sinks.guarded_sink import GuardedSink
from rw_ekf.sinks.learned_sink import Learning
from rw_ekf.sinks.recent import RecentSink
from rw_ekf.sinks.run_files import RunFiles
from rw_ekf.units import rad_s_from_rpm
from rw_ekf.version import __version__
from rw_ekf.wheel.wheel_tag import WheelTag

if TYPE_CHECKING:
    from rw_ekf.settings.schema import Configuration


@dataclass(frozen=True)
class Task:
    """What a run is to do."""

    configuration: Configuration
    protocol: WheelProtocol
    given: GivenModel
    duration_s: float | None = None
    planned: Commander | None = None  # what is commanded, in place of what the configuration requests


def run_daemon(
    task: Task,
    logger: Any,
    stop: StopSignal,
    clock: Clock,
    oversight: Oversight = ALONE,
    claim: PortClaim | None = None,
) -> RunOutcome:
    """Attach, estimate, log, publish.

    Raises DriverError if the wheel cannot be reached at the start, BadInputError if the model given is of another one.
    Zero current is sent on every way out; `stop` ends the run in order. oversight: who is notified of completed turns.
    claim: of the port, where the caller has made it already.
    """
    from rw_ekf.attach.opening import opener

    place = Place(opener(task.configuration, task.protocol, clock))
    with claim or PortClaim(task.configuration.wheel.port, clock):
        run = turns_of_run(task, logger, stop, clock, oversight, place)
        try:
            while True:
                next(run)
        except StopIteration as end:
            outcome: RunOutcome = end.value
            return outcome


def turns_of_run(
    task: Task, logger: Any, stop: StopSignal, clock: Clock, oversight: Oversight, place: Place
) -> Generator[LiveWheel, None, RunOutcome]:
    """The run as `run_daemon` has it, on a port that is claimed; yields the wheel when it is open and after every turn.

    Closing it is a way out too.
    """
    configuration, protocol = task.configuration, task.protocol
    began = clock.utc()
    commander = task.planned or (commander_of(configuration.command) if configuration.command.writes else None)
    with request_socket(configuration, clock, logger) as requests:
        live = _opened(configuration, protocol, logger, stop, clock, place)
        with _WayOut(live, configuration.wheel.port, oversight, logger) as way_out:
            files = RunFiles.of_run(configuration, began)
            leave_place(configuration)
            start = start_of_run(configuration, task.given, _tag(live, protocol, configuration), files.learned, began)
            for event, text in start.stated:
                logger.info(event, text=text)
            setup, prior = start.setup, start.setup.prior
            estimator = Estimator(setup.constants, prior.mean, prior.covariance, setup.effects, setup.effect_drift)
            expectation = expectation_of(configuration, task.given)
            watches = RunWatches(configuration, protocol, start, expectation, estimator, live, logger, clock)
            if place.resumed_by is not None:
                stop.on_resume(watches.states.resume, place.resumed_by)
            if oversight.begin_safe is not None:
                watches.states.latch(oversight.begin_safe)
            commander, compensating = compensated(commander, configuration, start, requests, watches.sign, logger)
            if commander is not None and not watches.sign.confirmed:
                place_of_current = protocol.scale_places.get("current", configuration.wheel.protocol)
                commander = confirming(
                    commander, configuration, watches.sign_watch, watches.step_rad_s, watches.states.latch, logger,
                    place_of_current,
                )  # fmt: skip
            run = replace(
                _context(configuration, files, start, watches, live, logger, clock),
                total_s=_lasts_s(task.duration_s, commander),
                phase=None if commander is None else commander.phase,
                in_order=lambda: way_out.in_order,
                requests=requests,
                label=place.label,
                process=own_process() | {"resume_signal": place.resumed_by},
            )
            way_out.sinks = sinks_of(run)
            logger.info("attached", source=live.driver.source, log=str(files.log), rate_hz=configuration.loop.rate_hz)
            readings = _with_metadata(live, live.readings(run.total_s), run, configuration, start)
            if commander is None:
                readings, issue = following(readings)
            else:
                issue = partial(live.issue, commander.controller)
            live.due_s = place.begins_s()
            yield live
            judge, turned = watches.judge.judge, oversight.turned
            for _ in turns(readings, estimator, issue, way_out.sinks, watches.step, judge, turned, compensating):
                yield live
        confirmed = way_out.zero_confirmed
        outcome = outcome_of(run, start, estimator, watches, live, stop.requested, zero_confirmed=confirmed)
        outcome.say(logger, writes=commander is not None)
        return outcome


class _WayOut:
    """Every way out of a run: zero to the wheel, those who watch notified if the loop came to its end, sinks closed."""

    def __init__(self, live: LiveWheel, port: str, oversight: Oversight, logger: Any) -> None:
        self._live = live
        self._port = port
        self._oversight = oversight
        self._logger = logger
        self.sinks: Sequence[GuardedSink] = ()
        self.in_order = False
        self.zero_confirmed = False

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self.in_order = kind is None
        self.zero_confirmed = self._live.close()
        if not self.zero_confirmed:
            self._logger.error(
                "zero_not_confirmed",
                port=self._port,
                do="the wheel may still carry its last current: run `rw-ekf stop --config F`, or cut its power",
            )
        if self.in_order:
            self._oversight.over()
        for sink in self.sinks:
            sink.close()


def _opened(
    configuration: Configuration, protocol: WheelProtocol, logger: Any, stop: StopSignal, clock: Clock, place: Place
) -> LiveWheel:
    """The wheel on its line. Raises DriverError if it cannot be reached."""
    return LiveWheel(
        place,
        SafetyLimits.of(configuration.limits),
        configuration.loop.rate_hz,
        stop,
        clock,
        writes=configuration.command.writes,
        note=logger.warning,
        speed_step_rad_s=max(protocol.limits.speed_step_rad_s, rad_s_from_rpm(configuration.filter.speed_noise_rpm)),
    )


def _context(
    configuration: Configuration,
    files: RunFiles,
    start: Start,
    watches: RunWatches,
    live: LiveWheel,
    logger: Any,
    clock: Clock,
) -> RunContext:
    """What the sinks need of a run, but for what it commands and how it ends."""
    return RunContext(
        files=files,
        wheel=configuration.wheel.name,
        output=configuration.output,
        port=configuration.wheel.port,
        state_names=start.setup.state_names,
        compensated=configuration.compensation.scheme is not None,
        clock=clock,
        logger=logger,
        watched=watches.alarms is not None,
        recent=RecentSink(configuration.loop.rate_hz, start.setup.effects.columns),
        began=watches.states.now,
        link=lambda: live.link,
        halted=lambda: live.halted,
        timing=live.timing,
        period_s=1.0 / configuration.loop.rate_hz,
        learning=Learning(start, lambda: watches.wheel, lambda: watches.doubt),
        process={},
    )


def _lasts_s(duration_s: float | None, commander: Commander | None) -> Callable[[], float | None]:
    """How long a run lasts as far as is known by now: what was requested, or what is commanded if that is shorter."""

    def lasts_s() -> float | None:
        own = None if commander is None else commander.lasts_s()
        return min((d for d in (duration_s, own) if d is not None), default=None)

    return lasts_s


def _tag(live: LiveWheel, protocol: WheelProtocol, configuration: Configuration) -> WheelTag:
    """Who answers, through which wire map."""
    section = configuration.wheel
    return WheelTag.of_identity(
        live.driver.identity, protocol=section.protocol, wire_map=protocol.fingerprint, port=section.port
    )


def _with_metadata(
    live: LiveWheel, readings: Iterator[Reading], run: RunContext, configuration: Configuration, start: Start
) -> Iterator[Reading]:
    """Write the metadata and the start when the first sample comes: only then is its UTC known, and there is a run."""
    first = True
    for reading in readings:
        if first and reading.sample is not None:
            first = False
            about = RunMetadata(
                utc_text(run.clock.utc()),
                live.driver.source,
                __version__,
                live.driver.identity,
                configuration.model_dump(mode="json"),
            )
            with run.unwritten.tried(metadata_path(run.files.log), run.logger.warning):
                write_metadata(run.files.log, about)
            with run.unwritten.tried(run.files.start, run.logger.warning):
                write_model(run.files.start, start.model)
        yield reading
