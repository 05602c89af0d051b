"""Replay of a log that is too long to be held: it streams through the filter in parts, in memory that does not grow.

With a configuration, or from a run's own start, that is one pass. Without, the log is read once to find where it moves
most; that part says how it is to be looked at (noises, Stribeck speed, what is read as it should be), and one further
reading is a second look at the whole, linearised where the part ended, beside one whose parameters wander
(`rw_ekf.hindsight`). The document is that of `rw_ekf.log_replay`.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from rw_ekf.course.course import Course
from rw_ekf.errors import LogError
from rw_ekf.filter.belief import Belief
from rw_ekf.filter.log_filter import LogFilter
from rw_ekf.filter.parameters_held import without_drift
from rw_ekf.filter.second_pass import Start
from rw_ekf.hindsight import CLEARLY, hindsight_of_part, with_stribeck_speeds
from rw_ekf.identify.misread import misreadings_and_questions, warnings_of
from rw_ekf.identify.noise_colour import NoiseColour, independent_readings
from rw_ekf.identify.record_scale import most_moved
from rw_ekf.log_replay import Run, blaming, columns_of_run, replay_of_log_reported, teller_of_noise
from rw_ekf.logs.in_parts import UnsoundError
from rw_ekf.logs.long_log import LogPart, LongLog
from rw_ekf.logs.record_print import made_of
from rw_ekf.logs.sampling import Sampling, evenly_stamped, held_readings, read_anew, sampling_of
from rw_ekf.logs.wheel_log import WheelLog
from rw_ekf.pass_sums import PassSums
from rw_ekf.residual_judgement import JUDGED_SAMPLES, judge_log
from rw_ekf.second_record import as_of_another_record, changes_with_time
from rw_ekf.starting_point import FilterSetup, setup_of_record
from rw_ekf.wheel.effect_table import NO_EFFECTS

if TYPE_CHECKING:
    from rw_ekf.settings.schema import Configuration
    from rw_ekf.wheel.model_file import WheelModel

Columns = dict[str, Any]
Writer = Callable[[WheelLog, Columns], object]  # takes rows of a log, with what the filter says of each


def replay_long(
    log: LongLog,
    configuration: Configuration | None = None,
    model: WheelModel | None = None,
    setup: FilterSetup | None = None,
    *,
    writers: Sequence[Writer] = (),
    advance: Callable[[int], object] = lambda rows: None,
) -> Run:
    """Filter a log part by part, as `replay_log` does one that is held.

    writers: take the rows, a part at a time. advance: is given how many rows have been filtered. Raises UnsoundError
    where the log has to be read as a whole, and what `replay_log` raises.
    """
    began_s = time.perf_counter()
    known = setup or model
    effects = NO_EFFECTS if known is None else known.effects
    if configuration is None and setup is None and changes_with_time(effects):
        raise UnsoundError(f"{log.name}: when something begins is told from the whole of it")
    if known is not None and known.temperature_lag_s > 0.0:
        raise UnsoundError(f"{log.name}: a temperature that acts late goes on from part to part")
    parts = _Parts(log, effects.columns, as_it_was=setup is not None)
    with blaming(model, log.name):
        if setup is None and configuration is None:
            whole, colour = _back(parts, model, writers, advance)
        else:
            whole, colour = _forward(parts, configuration, model, setup, writers, advance), None
        used = whole.setup
        follows = bool(used.effects.terms) or used.constants.dry_walk > 0.0  # from where it was at the beginning
        consistency = judge_log(parts.course(parts.first if follows else parts.busiest), used, whole.belief)
    described = not (setup is None and configuration is None and model is None)
    again = None if model is None else made_of(model.source, parts.first)
    sums = whole.sums
    warnings = [
        *warnings_of(*misreadings_and_questions(parts.busiest, described=described)),
        *replay_of_log_reported(log, parts.sampling, model, again, colour),
        *used.notes,
        *sums.remarks(driven=parts.driven),
        *consistency.warnings(),
    ]
    return Run(
        log, used, whole.belief, sums.statistics, consistency, tuple(warnings), None, whole.as_it_went,
        teller_of_noise(configuration, model, setup), time.perf_counter() - began_s, len(sums.troubles),
    )  # fmt: skip


@dataclass(frozen=True, eq=False)
class _Whole:
    """What a pass over all parts leaves."""

    setup: FilterSetup
    belief: Belief
    sums: PassSums
    as_it_went: Belief | None = None


class _Parts:
    """The parts of a log as filters read them, and what is kept of them: the first, and where the wheel moves most."""

    def __init__(self, log: LongLog, columns: tuple[str, ...], *, as_it_was: bool) -> None:
        """as_it_was: a run continues from its own start with every reading that it took then, held ones too."""
        self.colour: NoiseColour | None = None  # of the readings' noise, where neighbouring ones say the same
        self.driven = False
        self._log, self._columns, self._as_it_was = log, columns, as_it_was
        self._first: WheelLog | None = None
        self._busiest: WheelLog | None = None
        self._moved_rad_s = -1.0

    @property
    def first(self) -> WheelLog:
        """The first part. Raises LogError for a log without a single speed."""
        return self._known(self._first)

    @property
    def busiest(self) -> WheelLog:
        """The part in which the speed changes most. Raises LogError for a log without a single speed."""
        return self._known(self._busiest)

    @property
    def sampling(self) -> Sampling:
        """How the busiest part was sampled."""
        return sampling_of(self.busiest)

    def logs(self, *, again: bool = False) -> Iterator[LogPart]:
        """Read the parts once; again: they will be read once more."""
        for part in self._log.parts(again=again):
            if self._first is None:
                if not self._as_it_was and evenly_stamped(part.log) is not part.log:
                    raise UnsoundError(
                        f"{self._log.name}: its rows come in batches, and its clock is that of their count"
                    )
                self._first = part.log
            _, moved_rad_s = most_moved(part.log.speed_rad_s, JUDGED_SAMPLES)
            if moved_rad_s > self._moved_rad_s and np.isfinite(part.log.speed_rad_s).any():
                self._moved_rad_s, self._busiest = moved_rad_s, part.log
            self.driven = self.driven or bool(np.any(part.log.current_A != 0.0))
            yield part

    def courses(self) -> Iterator[tuple[LogPart, Course]]:
        """Read the parts once, with what filters read of them."""
        return ((part, self.course(part.log, part.first_row - part.begin)) for part in self.logs())

    def course(self, log: WheelLog, first_row: int = 0) -> Course:
        """The course of a part that begins with that row of the log."""
        course = Course.of_log(log if self._as_it_was else read_anew(log, held_readings(log)[0]), self._columns)
        return course if self.colour is None else course.only(self.colour.walking(first_row, len(log)))

    def _known(self, log: WheelLog | None) -> WheelLog:
        if log is None:
            raise LogError(
                f"{self._log.name}: not one of its {len(self._log)} samples has a speed; there is nothing to filter"
            )
        return log


class _Pass:
    """A filter on its way through the parts."""

    def __init__(self, setup: FilterSetup, start: Belief, *, wanders: bool) -> None:
        self._begun = setup, start, wanders
        constants = setup.constants if wanders else without_drift(setup.constants)
        self.setup = replace(setup, constants=constants)
        self.filter = LogFilter(
            constants, start.mean, start.covariance, setup.effects, self.setup.effect_drift, mends=True
        )
        self.sums = PassSums.of(setup)

    def anew(self) -> _Pass:
        """The same before the first part."""
        setup, start, wanders = self._begun
        return _Pass(setup, start, wanders=wanders)

    @property
    def belief(self) -> Belief:
        """Where the filter is."""
        return Belief(self.filter.mean, self.filter.covariance)

    def over(self, part: LogPart, course: Course, writers: Sequence[Writer] = ()) -> None:
        """Go on over a part; `writers` take its rows."""
        run = self.filter.over(course, part.begin, keep_states=bool(writers))
        self.sums.add(course, run, part.begin)
        if writers:
            rows = part.log.rows(slice(part.begin, None))
            columns = columns_of_run(rows, run.since(part.begin), self.setup, smooth=False)
            for write in writers:
                write(rows, columns)


def _forward(
    parts: _Parts,
    configuration: Configuration | None,
    model: WheelModel | None,
    setup: FilterSetup | None,
    writers: Sequence[Writer],
    advance: Callable[[int], object],
) -> _Whole:
    """One pass, from where a configuration or a run's own start says."""
    found = None
    for part, course in parts.courses():
        if found is None:
            setup = setup or setup_of_record(course, configuration, model)
            found = _Pass(setup, setup.prior, wanders=True)
        found.over(part, course, writers)
        advance(len(part.log) - part.begin)
    if found is None or setup is None:
        raise LogError("the log has no rows")
    parts.busiest  # noqa: B018 - a log without a single speed is none
    found.sums.refuse_runaway()
    return _Whole(setup, found.belief, found.sums)


def _back(
    parts: _Parts,
    model: WheelModel | None,
    writers: Sequence[Writer],
    advance: Callable[[int], object],
) -> tuple[_Whole, NoiseColour | None]:
    """The whole log in hindsight, from its busiest part, and the colour of its readings' noise."""
    for _ in parts.logs(again=True):
        pass
    course, parts.colour = independent_readings(parts.course(parts.busiest))
    setup = with_stribeck_speeds(course, setup_of_record(course, None, model))
    if model is not None:
        setup = as_of_another_record(course, setup)
    part = hindsight_of_part(course, setup)
    start = Start.of(setup.prior, part.middle, setup.effects)
    steady = _Pass(part.setup, setup.prior if start is None else start.belief, wanders=False)
    ways = [steady]
    if setup.constants.wanders:
        ways.append(_Pass(part.setup, setup.prior, wanders=True))
    for log, course in parts.courses():
        for way in ways:
            way.over(log, course)
        advance(len(log.log) - log.begin)
    chosen = ways[-1] if ways[-1].sums.log_likelihood >= steady.sums.log_likelihood + CLEARLY else steady
    chosen.sums.refuse_runaway()
    if writers:
        again = chosen.anew()
        for log, course in parts.courses():
            again.over(log, course, writers)
    found = chosen.belief
    if chosen is steady and start is not None and not steady.sums.was_reset:
        found = start.taken_from(found) or found
    return _Whole(chosen.setup, part.of_whole(found), chosen.sums, chosen.belief), parts.colour
