"""What the run has learned so far, kept for the next one: saved whole once a minute, and at the end."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from rw_ekf.arrays import Float64Array
from rw_ekf.errors import RwEkfError
from rw_ekf.filter.belief import Belief
from rw_ekf.learning.learned_file import has_learned, learned_text, may_replace, out_of_bounds
from rw_ekf.learning.run_start import Start
from rw_ekf.logs.atomic import write_text
from rw_ekf.model.state import PARAMETER_COUNT
from rw_ekf.records import Estimate, RunState, Tick
from rw_ekf.starting_point import model_of
from rw_ekf.wheel.model_file import WheelModel, refusal_of
from rw_ekf.wheel.wheel_tag import WheelTag

if TYPE_CHECKING:
    from rw_ekf.sinks.all_sinks import RunContext


@dataclass(frozen=True)
class Learning:
    """What a run knows of its learning besides the belief."""

    start: Start
    wheel: Callable[[], WheelTag]  # with what is known of its sign by now
    doubt: Callable[[], str | None]  # why what is learned must not be kept; None where it may


class LearnedSink:
    """Saves every tick that it is given and the run trusts, but for the first ones.

    What is wrong replaces nothing, nor does a run that has learned nothing yet; and one that did not continue from what
    stands there replaces it only once it knows as much.
    """

    def __init__(self, run: RunContext, learning: Learning, every_s: float) -> None:
        """every_s: how often it is given a tick, by the run's clock."""
        self._run = run
        self._learning = learning
        self._first_s = run.clock.monotonic() + 0.5 * every_s
        self._newest: Estimate | None = None  # that was not saved yet
        self._replaces = learning.start.replaces
        self._stated: set[str] = set()
        self._failed = False
        self._too_little: str | None = None  # why what was learned last is not worth to be kept

    def write(self, tick: Tick) -> None:
        """Take a tick and save it, unless the run has only just begun."""
        if tick.state is None or tick.state.state is RunState.TRACKING:
            self._newest = tick.estimate
        if self._run.clock.monotonic() >= self._first_s:
            self._save()

    def close(self) -> None:
        """Save the last one."""
        self._save()
        if self._too_little is not None:
            self._say("learned_not_kept", self._too_little, "what was learned before stands, if there was anything")
        if self._failed:
            self._run.unwritten.other_files.append(self._run.files.learned.name)

    def _save(self) -> None:
        estimate, self._newest = self._newest, None
        model = self._model(estimate)
        doubt = self._learning.doubt()
        if doubt is None and model is not None:
            doubt = refusal_of(model) or out_of_bounds(model, self._learning.start.origin)
        if doubt is not None:
            self._say("learned_not_kept", doubt, "the next run does not go on from this one")
        elif model is not None:
            self._too_little = self._lacks(np.array(model.covariance)[:PARAMETER_COUNT, :PARAMETER_COUNT])
            if self._too_little is None:
                self._put(model)

    def _lacks(self, covariance: Float64Array) -> str | None:
        """Say why a belief, covariance (4, 4), is of less worth than what there is; None where it is not."""
        start = self._learning.start
        prior = start.setup.prior.parameter_covariance
        if start.from_prior and not has_learned(prior, covariance):
            return "the run has learned nothing that its configuration does not say"
        if start.standing is None:
            return None
        standing = np.array(start.standing.covariance)[:PARAMETER_COUNT, :PARAMETER_COUNT]
        if may_replace(standing, covariance, prior):
            return None
        return "by itself this run knows the wheel much less well than what was learned before it, which it has left"

    def _model(self, estimate: Estimate | None) -> WheelModel | None:
        """What was learned up to an estimate; None where there is none."""
        if estimate is None or estimate.covariance is None:
            return None
        known = len(estimate.values)
        belief = Belief(np.array(estimate.values), estimate.covariance[:known, :known])
        return model_of(
            belief, self._learning.start.setup, {"record": self._run.record.text}, wheel=self._learning.wheel()
        )

    def _put(self, model: WheelModel) -> None:
        """Replace the file; what stands there and was not continued from is kept beside the log."""
        files, fingerprint = self._run.files, self._learning.start.fingerprint
        try:
            if self._replaces:
                os.replace(files.learned, files.replaced)
                self._replaces = False
                self._run.logger.info(
                    "learned_replaced",
                    file=str(files.learned),
                    before=str(files.replaced),
                    do="to go back, put that one in this one's place",
                )
            text = learned_text(model, fingerprint, files.log.name, self._run.clock.utc())
            write_text(files.learned, text, follow=False)
            self._failed = False
        except (OSError, RwEkfError) as error:
            self._failed = True
            self._run.unwritten.note(str(error))
            self._say("learned_not_saved", str(error), "the run goes on, and tries again")

    def _say(self, event: str, reason: str, do: str) -> None:
        if event not in self._stated:
            self._stated.add(event)
            self._run.logger.warning(event, file=str(self._run.files.learned), reason=reason, do=do)
