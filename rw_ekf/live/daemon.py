"""The daemon: a configuration becomes a live wheel, an estimator and its sinks, until a signal or a duration."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rw_ekf import __version__
from rw_ekf.clock import Clock
from rw_ekf.control.commanders import commander_of
from rw_ekf.driver import WheelProtocol
from rw_ekf.errors import BadInputError
from rw_ekf.filter.belief import Belief
from rw_ekf.filter.estimator import Estimator
from rw_ekf.learning.start import GivenModel, start_of_run
from rw_ekf.live.claim import PortClaim
from rw_ekf.live.confirm_sign import confirming
from rw_ekf.live.follow import following
from rw_ekf.live.guard import SafetyLimits
from rw_ekf.live.live_wheel import LiveWheel
from rw_ekf.live.loop import run_loop
from rw_ekf.live.oversight import ALONE, Oversight
from rw_ekf.live.process import own_process
from rw_ekf.live.stop_signal import StopSignal
from rw_ekf.live.timing import LoopTiming
from rw_ekf.live.watches import RunWatches, expectation_of
from rw_ekf.logs.atomic import write_text
from rw_ekf.logs.metadata import RunMetadata, metadata_path, utc_text, write_metadata
from rw_ekf.records import LinkCounters, Reading, StateNow
from rw_ekf.sinks.guard import GuardedSink
from rw_ekf.sinks.learned import Learning
from rw_ekf.sinks.recent import RecentSink
from rw_ekf.sinks.registry import RunContext, sinks_of
from rw_ekf.sinks.run_files import RunFiles, Unwritten
from rw_ekf.starting_point import FilterSetup, model_of
from rw_ekf.statistics import RunStatistics
from rw_ekf.units import rad_s_from_rpm
from rw_ekf.wheel.model_file import WheelModel, refusal_of
from rw_ekf.wheel.wheel_tag import WheelTag

if TYPE_CHECKING:
    from rw_ekf.settings.schema import Configuration


@dataclass(frozen=True)
class RunOutcome:
    """What a run came to."""

    files: RunFiles
    setup: FilterSetup
    start: Mapping[str, Any]  # from what, and whether the wheel's sign is confirmed
    belief: Belief
    statistics: RunStatistics
    recent: RecentSink  # what the end of the run is judged by
    link: LinkCounters
    timing: LoopTiming
    stopped_by: str | None
    lost: bool  # the link was down, or the wheel silent, at the end
    zero_confirmed: bool
    state: StateNow  # at the end
    alarms: tuple[str, ...] = ()  # what the watch said, in sentences, oldest first
    findings: tuple[str, ...] = ()  # what the wheel, its line or its wire map did, in sentences, oldest first
    halted: str | None = None  # why the run ended before its time, where the wheel must not be driven on
    unwritten: Unwritten = field(default_factory=Unwritten)


def run_daemon(
    configuration: Configuration,
    protocol: WheelProtocol,
    given: GivenModel,
    duration_s: float | None,
    logger: Any,
    stop: StopSignal,
    clock: Clock,
    oversight: Oversight = ALONE,
) -> RunOutcome:
    """Attach, estimate, log, publish.

    Raises DriverError if the wheel cannot be reached at the start, BadInputError if the model given is of another one.
    Zero current is sent on every way out; `stop` ends the run in order. oversight: who is told of completed turns.
    """
    from rw_ekf.attach import opener

    began = clock.utc()
    writes = configuration.command.writes
    commander = commander_of(configuration.command) if writes else None
    rate_hz, noise_rad_s = configuration.loop.rate_hz, rad_s_from_rpm(configuration.filter.speed_noise_rpm)
    with contextlib.ExitStack() as stack:
        stack.enter_context(PortClaim(configuration.wheel.port, clock))
        live = LiveWheel(
            opener(configuration, protocol, clock),
            SafetyLimits.of(configuration.limits),
            rate_hz,
            stop,
            clock,
            writes=writes,
            note=logger.warning,
            speed_step_rad_s=max(protocol.limits.speed_step_rad_s, noise_rad_s),
        )
        confirmed = in_order = False
        sinks: list[GuardedSink] = []
        try:
            files = RunFiles.of_run(configuration, began)
            start = start_of_run(configuration, given, _tag(live, protocol, configuration), files.learned, began)
            for event, text in start.said:
                logger.info(event, text=text)
            setup = start.setup
            estimator = Estimator(
                setup.constants, setup.prior.mean, setup.prior.covariance, setup.effects, setup.effect_drift
            )
            expectation = expectation_of(configuration, given)
            watches = RunWatches(configuration, protocol, start, expectation, estimator, live, logger, clock)
            stop.on_resume(watches.states.resume)
            if oversight.begin_safe is not None:
                watches.states.latch(oversight.begin_safe)
            if commander is not None and not watches.sign.confirmed:
                commander = confirming(commander, configuration, watches.sign_watch, watches.step_rad_s, logger)

            def lasts_s() -> float | None:
                own = None if commander is None else commander.lasts_s()
                return min((d for d in (duration_s, own) if d is not None), default=None)

            run = RunContext(
                files=files,
                wheel=configuration.wheel.name,
                output=configuration.output,
                port=configuration.wheel.port,
                state_names=setup.state_names,
                clock=clock,
                logger=logger,
                total_s=lasts_s,
                phase=None if commander is None else commander.phase,
                watched=watches.alarms is not None,
                recent=RecentSink(rate_hz),
                began=watches.states.now,
                link=lambda: live.link,
                learning=Learning(start, lambda: watches.wheel, lambda: watches.sign.doubt),
                process=own_process(),
                in_order=lambda: in_order,
            )
            sinks = sinks_of(run)
            logger.info("attached", wheel=live.driver.source, log=str(files.log), rate_hz=rate_hz)
            with run.unwritten.tried(files.start, logger.warning):
                _write_model(files.start, start.model)
            readings = _with_metadata(live, live.readings(lasts_s), run, configuration)
            if commander is None:
                readings, issue = following(readings)
            else:
                issue = partial(live.issue, commander.controller)
            run_loop(readings, estimator, issue, sinks, watches.step, watches.judge.judge, oversight.turned)
            in_order = True
        finally:
            confirmed = live.close()
            if not confirmed:
                logger.error(
                    "zero_not_confirmed",
                    port=configuration.wheel.port,
                    do="the wheel may still carry its last current: run `rw-ekf stop --config F`, or cut its power",
                )
            if in_order:
                oversight.over()
            for sink in sinks:
                sink.close()
        belief = Belief(estimator.mean, estimator.covariance)
        run.statistics.points = estimator.points
        watches.find_negative_gain(belief)
        with run.unwritten.tried(files.model, logger.warning):
            source = {"method": "filter", "log": files.log.name}
            _write_model(files.model, model_of(belief, setup, source, wheel=watches.wheel))
        ended_by = "halt" if live.halted is not None else stop.requested or "duration"
        zero = ("confirmed" if confirmed else "NOT confirmed") if writes else "left to who commands the wheel"
        now = watches.states.now
        logger.info("ended", by=ended_by, state=now.state.value, samples=run.statistics.samples, zero_current=zero)
        return RunOutcome(
            files=files,
            setup=setup,
            start=start.document | {"sign_confirmed": watches.sign.confirmed},
            belief=belief,
            statistics=run.statistics,
            recent=run.recent,
            link=live.link,
            timing=live.timing,
            stopped_by=stop.requested,
            lost=live.lost,
            zero_confirmed=confirmed,
            state=now,
            alarms=() if watches.alarms is None else tuple(watches.alarms.warnings),
            findings=(*watches.check.findings, *estimator.findings),
            halted=live.halted,
            unwritten=run.unwritten,
        )


def _write_model(path: Path, model: WheelModel) -> None:
    """Write a model file. Raises BadInputError where the place cannot be written, or nothing could read it again."""
    refusal = refusal_of(model)
    if refusal is not None:
        raise BadInputError(f"{path}: not written, because nothing could read it: {refusal}")
    write_text(path, model.to_text(), follow=False)


def _tag(live: LiveWheel, protocol: WheelProtocol, configuration: Configuration) -> WheelTag:
    """Who answers, through which wire map."""
    section = configuration.wheel
    return WheelTag.of_identity(
        live.driver.identity, protocol=section.protocol, wire_map=protocol.fingerprint, port=section.port
    )


def _with_metadata(
    live: LiveWheel, readings: Iterator[Reading], run: RunContext, configuration: Configuration
) -> Iterator[Reading]:
    """Write the metadata when the first sample comes: only then is its UTC known."""
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
        yield reading
