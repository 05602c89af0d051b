"""The daemon: a configuration becomes a live wheel, an estimator and its sinks, until a signal or a duration."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator
from dataclasses import dataclass, field
from datetime import datetime
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rw_ekf import __version__
from rw_ekf.control.commanders import controller_of
from rw_ekf.errors import BadInputError, RwEkfError
from rw_ekf.filter.belief import Belief
from rw_ekf.filter.estimator import Estimator
from rw_ekf.live.alarm_watch import AlarmWatch, alarm_watch_of
from rw_ekf.live.claim import PortClaim
from rw_ekf.live.follow import following
from rw_ekf.live.guard import SafetyLimits
from rw_ekf.live.live_wheel import LiveWheel
from rw_ekf.live.loop import run_loop
from rw_ekf.live.stop_signal import StopSignal
from rw_ekf.live.telemetry import TelemetryCheck
from rw_ekf.live.timing import LoopTiming
from rw_ekf.logs.atomic import write_text
from rw_ekf.logs.metadata import RunMetadata, metadata_path, utc_text, write_metadata
from rw_ekf.logs.writer import EstimateWriter, SampleWriter
from rw_ekf.numbers import plus_minus
from rw_ekf.records import Clock, LinkCounters, Reading, Sink, WheelProtocol
from rw_ekf.sinks.sign_sink import SignSink
from rw_ekf.sinks.sinks import LogSink, StateFileSink, StatisticsSink, SyncSink, Unwritten
from rw_ekf.sinks.status_line import StatusLine
from rw_ekf.starting_point import FilterSetup, carried_over, model_of, setup_of_configuration
from rw_ekf.statistics import RunStatistics
from rw_ekf.watch.sign_watch import SignWatch
from rw_ekf.watch.stuck_watch import ParameterBelief, StuckWatch
from rw_ekf.wheel.model_file import WheelModel, refusal_of

if TYPE_CHECKING:
    from rw_ekf.settings.schema import Configuration


_SURE = 5.0  # standard deviations


@dataclass(frozen=True)
class RunFiles:
    """Where one run leaves its files; all beside each other under one stem."""

    log: Path
    estimates: Path
    model: Path
    state: Path

    @classmethod
    def in_directory(cls, directory: Path, wheel: str, began: datetime) -> RunFiles:
        """Name the files of a run; the directory is made if it is not there. Raises BadInputError if it cannot be."""
        try:
            directory.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise BadInputError(
                f"output.directory {directory} cannot be made ({error.strerror}): give another one"
            ) from None
        safe = "".join(c if c.isalnum() or c in "-_" else "-" for c in wheel)[:60]
        stem = f"{began:%Y-%m-%dT%H-%M-%SZ}_{safe}"
        number = 1
        while os.path.lexists(directory / f"{stem}.csv"):
            number += 1
            stem = f"{began:%Y-%m-%dT%H-%M-%SZ}_{safe}_{number}"
        return cls(
            directory / f"{stem}.csv",
            directory / f"{stem}.estimates.csv",
            directory / f"{stem}.model.yaml",
            directory / f"{safe}.state.json",
        )


@dataclass(frozen=True)
class RunOutcome:
    """What a run came to."""

    files: RunFiles
    setup: FilterSetup
    belief: Belief
    statistics: RunStatistics
    link: LinkCounters
    timing: LoopTiming
    stopped_by: str | None
    lost: bool  # the link was down, or the wheel silent, at the end
    zero_confirmed: bool
    alarms: tuple[str, ...] = ()  # what the watch said, in sentences, oldest first
    findings: tuple[str, ...] = ()  # what the wheel, its line or its wire map did, in sentences, oldest first
    halted: str | None = None  # why the run ended before its time, where the wheel must not be driven on
    unwritten: Unwritten = field(default_factory=Unwritten)


def run_daemon(
    configuration: Configuration,
    protocol: WheelProtocol,
    model: WheelModel | None,
    duration_s: float | None,
    logger: Any,
    stop: StopSignal,
    clock: Clock,
) -> RunOutcome:
    """Attach, estimate, log, publish. Raises DriverError if the wheel cannot be reached at the start.

    Zero current is sent on every way out; `stop` ends the run in order.
    """
    from rw_ekf.attach import opener

    began = clock.utc()
    if model is not None:
        model, notes = carried_over(model)
        for text in notes:
            logger.info("effect_not_carried_over", text=text)
    setup = setup_of_configuration(configuration, model)
    estimator = Estimator(setup.constants, setup.prior.mean, setup.prior.covariance, setup.effects, setup.effect_drift)
    writes = configuration.command.profile != "none"
    controller, profile_s, phase = controller_of(configuration.command) if writes else (None, None, None)
    lasts_s = min((d for d in (duration_s, profile_s) if d is not None), default=None)
    statistics, unwritten = StatisticsSink(), Unwritten()
    watch = alarm_watch_of(configuration, estimator.constants, setup.inertia_kg_m2, logger, clock)
    with contextlib.ExitStack() as stack:
        stack.enter_context(PortClaim(configuration.wheel.port, clock))
        resolution, noise = protocol.limits.speed_step_rad_s, estimator.constants.speed_variance**0.5
        stribeck = estimator.constants.stribeck
        stuck = StuckWatch(resolution, noise, configuration.limits.silence_s, *stribeck)
        check = TelemetryCheck(
            logger.warning,
            stuck,
            lambda: ParameterBelief(estimator.parameters, estimator.parameter_covariance),
            writes=writes,
        )
        live = LiveWheel(
            opener(configuration, protocol, clock),
            SafetyLimits.of(configuration.limits),
            configuration.loop.rate_hz,
            stop,
            clock,
            writes=writes,
            note=logger.warning,
            check=check,
            speed_step_rad_s=max(resolution, noise),
        )
        sign = SignSink(
            SignWatch(setup.prior.parameters, stribeck.omega_s, max(resolution, noise)),
            protocol.scale_places,
            expectation_of(configuration, model),
            halt=live.halt if writes else None,
            found=check.found,
            note=logger.warning,
        )
        confirmed = False
        try:
            files = RunFiles.in_directory(Path(configuration.output.directory), configuration.wheel.name, began)
            status = StatusLine(logger, clock, lasts_s, phase)
            names = setup.state_names
            sinks = [
                *_sinks(stack, files, configuration, statistics, names, watch, unwritten, logger, status, clock),
                sign,
            ]
            logger.info("attached", wheel=live.driver.source, log=str(files.log), rate_hz=configuration.loop.rate_hz)
            readings = _with_metadata(live, live.readings(lasts_s), files, configuration, unwritten, logger, clock)
            if controller is None:
                readings, issue = following(readings)
            else:
                issue = partial(live.issue, controller)
            run_loop(readings, estimator, issue, sinks, *([] if watch is None else [watch.step]))
        finally:
            confirmed = live.close()
            if not confirmed:
                logger.error(
                    "zero_not_confirmed",
                    port=configuration.wheel.port,
                    do="the wheel may still carry its last current: run `rw-ekf stop --config F`, or cut its power",
                )
        belief = Belief(estimator.mean, estimator.covariance)
        gain, gain_std = belief.parameters.motor_gain, belief.parameter_std.motor_gain
        if live.halted is None and gain + _SURE * gain_std < 0.0:
            check.found(
                "negative_gain",
                f"the motor gain is estimated as {plus_minus(gain, gain_std)} rad/s^2/A, and no "
                "wheel has a negative one: a sign in the wire map is wrong, or the readings were not the wheel's",
            )
        model_now = model_of(belief, setup, {"method": "filter", "log": files.log.name})
        with _tried(files.model, unwritten, logger):
            refusal = refusal_of(model_now)
            if refusal is not None:
                raise BadInputError(f"{files.model}: not written, because nothing could read it: {refusal}")
            write_text(files.model, model_now.to_text(), follow=False)
        ended_by = "halt" if live.halted is not None else stop.requested or "duration"
        zero = ("confirmed" if confirmed else "NOT confirmed") if writes else "left to who commands the wheel"
        samples_read = statistics.statistics.samples
        logger.info("ended", by=ended_by, samples=samples_read, zero_current=zero)
        return RunOutcome(
            files,
            setup,
            belief,
            statistics.statistics,
            live.link,
            live.timing,
            stop.requested,
            live.lost,
            confirmed,
            () if watch is None else tuple(watch.warnings),
            tuple(check.findings),
            live.halted,
            unwritten,
        )


def expectation_of(configuration: Configuration, model: WheelModel | None) -> str:
    """Say where the expected motor gain comes from."""
    if model is not None:
        return "the model says"
    prior = configuration.filter.prior
    given = prior is not None and prior.motor_gain is not None
    return "filter.prior.motor_gain says" if given else "the built-in prior says"


@contextlib.contextmanager
def _tried(path: Path, unwritten: Unwritten, logger: Any) -> Iterator[None]:
    """A file whose loss must not end a run that drives a wheel: counted, and said where it is the first."""
    try:
        yield
    except (RwEkfError, OSError) as error:
        unwritten.other_files.append(path.name)
        if unwritten.note(str(error)):
            logger.warning("not_written", file=str(path), reason=str(error))


def _sinks(
    stack: contextlib.ExitStack,
    files: RunFiles,
    configuration: Configuration,
    statistics: StatisticsSink,
    names: tuple[str, ...],
    watch: AlarmWatch | None,
    unwritten: Unwritten,
    logger: Any,
    status: StatusLine,
    clock: Clock,
) -> list[Sink]:
    log = LogSink(SampleWriter(files.log), EstimateWriter(files.estimates, names), unwritten, logger.warning)
    about = {"schema": "rw_ekf.state/1", "wheel": configuration.wheel.name, "log": files.log.name}
    sinks: list[Sink] = [
        log,
        statistics,
        StateFileSink(files.state, about, clock, unwritten=unwritten, watched=watch is not None),
        SyncSink([files.log, files.estimates]),
        status,
    ]
    for sink in sinks:
        stack.callback(sink.close)
    return sinks


def _with_metadata(
    live: LiveWheel,
    readings: Iterator[Reading],
    files: RunFiles,
    configuration: Configuration,
    unwritten: Unwritten,
    logger: Any,
    clock: Clock,
) -> Iterator[Reading]:
    """Write the metadata when the first sample comes: only then is its UTC known."""
    first = True
    for reading in readings:
        if first:
            first = False
            about = RunMetadata(
                utc_text(clock.utc()),
                live.driver.source,
                __version__,
                live.driver.identity,
                configuration.model_dump(mode="json"),
            )
            with _tried(metadata_path(files.log), unwritten, logger):
                write_metadata(files.log, about)
        yield reading
