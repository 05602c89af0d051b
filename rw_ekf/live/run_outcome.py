"""What a run came to, and the models that it leaves behind."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from rw_ekf.errors import BadInputError
from rw_ekf.filter.belief import Belief
from rw_ekf.filter.estimator import Estimator
from rw_ekf.learning.learned_file import has_learned
from rw_ekf.learning.run_start import Start
from rw_ekf.live.live_wheel import LiveWheel
from rw_ekf.live.watches import RunWatches
from rw_ekf.logs.atomic import write_text
from rw_ekf.logs.checksums import note_file
from rw_ekf.records import LinkCounters, StateNow
from rw_ekf.sinks.all_sinks import RunContext
from rw_ekf.sinks.recent import RecentSink
from rw_ekf.sinks.run_files import RunFiles, Unwritten
from rw_ekf.starting_point import FilterSetup, model_of
from rw_ekf.statistics import LoopTiming, RunStatistics
from rw_ekf.wheel.model_file import WheelModel, refusal_of


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
    alarms: tuple[str, ...] = ()  # what the watch reported, in sentences, oldest first
    findings: tuple[str, ...] = ()  # what the wheel, its line or its wire map did, in sentences, oldest first
    halted: str | None = None  # why the run ended before its time, where the wheel must not be driven on
    unwritten: Unwritten = field(default_factory=Unwritten)
    model: Path | None = None  # that it left; None where it learned nothing, or there was no room

    def say(self, logger: Any, *, writes: bool) -> None:
        """Tell the log that the run has ended, and how. writes: whether it ever commanded the wheel."""
        zero = ("confirmed" if self.zero_confirmed else "NOT confirmed") if writes else "left to who commands the wheel"
        logger.info(
            "ended",
            by="halt" if self.halted is not None else self.stopped_by or "duration",
            state=self.state.state.value,
            samples=self.statistics.samples,
            lasted_s=round(self.statistics.duration_s, 1),
            zero_current=zero,
        )


def outcome_of(
    run: RunContext,
    start: Start,
    estimator: Estimator,
    watches: RunWatches,
    live: LiveWheel,
    stopped_by: str | None,
    *,
    zero_confirmed: bool,
) -> RunOutcome:
    """Sum a run up that has ended in order, and leave the model it ended with. stopped_by: who requested the end."""
    belief = Belief(estimator.mean, estimator.covariance)
    run.statistics.points = estimator.points
    watches.find_negative_gain(belief)
    model, known = None, belief.parameter_covariance
    if run.statistics.samples and not (
        start.from_prior and not has_learned(start.setup.prior.parameter_covariance, known)
    ):
        with run.unwritten.tried(run.files.model, run.logger.warning):
            source = {"method": "filter", "log": run.files.log.name, "record": run.record.text}
            write_model(run.files.model, model_of(belief, start.setup, source, wheel=watches.wheel))
            model = run.files.model
    return RunOutcome(
        files=run.files,
        setup=start.setup,
        start=start.document | {"sign_confirmed": watches.sign.confirmed},
        belief=belief,
        statistics=run.statistics,
        recent=run.recent,
        link=live.link,
        timing=live.timing,
        stopped_by=stopped_by,
        lost=live.lost,
        zero_confirmed=zero_confirmed,
        state=watches.states.now,
        alarms=() if watches.alarms is None else tuple(watches.alarms.warnings),
        findings=(*watches.check.findings, *estimator.findings),
        halted=live.halted,
        unwritten=run.unwritten,
        model=model,
    )


def write_model(path: Path, model: WheelModel) -> None:
    """Write a model file. Raises BadInputError where the place cannot be written, or nothing could read it again."""
    refusal = refusal_of(model)
    if refusal is not None:
        raise BadInputError(f"{path}: not written, because nothing could read it: {refusal}")
    write_text(path, model.to_text(), follow=False)
    note_file(path)
