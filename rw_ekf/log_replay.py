"""Replay of a logged run: the compiled pass, or the very loop of the daemon, to the same document."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from rw_ekf.arrays import Float64Array
from rw_ekf.course.conditions import of_lost_temperature
from rw_ekf.course.course import Course
from rw_ekf.documents import REPLAY_SCHEMA, as_it_went_text, entry_text, log_entry
from rw_ekf.errors import BadInputError, FilterError, LogError
from rw_ekf.filter import gating
from rw_ekf.filter.belief import Belief
from rw_ekf.filter.consistency import Consistency
from rw_ekf.filter.constants import DEFAULT_SPEED_NOISE_RAD_S
from rw_ekf.filter.filter_run import FilterRun
from rw_ekf.filter.log_filter import filter_log
from rw_ekf.hindsight import belief_of_log, filtered, run_of_log, with_stribeck_speeds
from rw_ekf.identify.misread import misreadings_and_questions, warnings_of
from rw_ekf.identify.noise_colour import NoiseColour, independent_readings
from rw_ekf.learning.aged_model import carried_over
from rw_ekf.logs.checksums import changed
from rw_ekf.logs.metadata import metadata_path, read_metadata
from rw_ekf.logs.record_print import made_of
from rw_ekf.logs.run_directory import start_path
from rw_ekf.logs.sampling import Sampling, sampling_of, without_repeats
from rw_ekf.logs.tables import table_of
from rw_ekf.model.state import PARAMETER_NAMES
from rw_ekf.numbers import plus_minus
from rw_ekf.pass_sums import PassSums
from rw_ekf.pictures import run_figure
from rw_ekf.records import IssuedCommand, WheelSample
from rw_ekf.residual_judgement import judge_log
from rw_ekf.result_display import Shown
from rw_ekf.second_record import as_of_another_record, with_warmth_of_record
from rw_ekf.starting_point import (
    FilterSetup,
    course_for,
    model_of,
    setup_of_configuration,
    setup_of_record,
    setup_of_start,
)
from rw_ekf.statistics import RunStatistics
from rw_ekf.units import rpm_from_rad_s
from rw_ekf.wheel.model_file import read_model

if TYPE_CHECKING:
    import pyarrow as pa
    from matplotlib.figure import Figure

    from rw_ekf.logs.long_log import LongLog
    from rw_ekf.logs.wheel_log import WheelLog
    from rw_ekf.settings.schema import Configuration
    from rw_ekf.wheel.model_file import WheelModel


@dataclass(eq=False, frozen=True, repr=False)
class Run(Shown):
    """A replayed log: where it ended, how it went, and per-sample columns where they were requested."""

    log: WheelLog | LongLog  # of a long one the rows are not kept
    setup: FilterSetup
    belief: Belief
    statistics: RunStatistics
    consistency: Consistency
    warnings: tuple[str, ...]
    columns: dict[str, Any] | None
    as_it_went: Belief | None = None  # at the end of the rows, where `belief` is in hindsight and may be another
    noise_from: str | None = None  # where the readings' noise is from, if not given: the record, the model
    filter_s: float = 0.0  # that the filter took [s]
    resets: int = 0  # of the filter, with a divergence or a lock-out among them
    picture_rows: tuple[WheelLog, dict[str, Any]] | None = None  # of a long log, a row in so many with its columns

    @property
    def hindsight(self) -> Belief | None:
        """What is believed of the whole log, where that is not what the rows end with."""
        return None if self.as_it_went is None else self.belief

    @property
    def model(self) -> WheelModel:
        """What is believed at the end, for another log to start from."""
        source = {"method": "replay", "log": Path(self.log.name).name, "samples": len(self.log)}
        return model_of(self.belief, self.setup, source)

    @property
    def table(self) -> pa.Table:
        """A row per sample, as `replay --out` writes them. Raises ValueError where they were not kept."""
        return table_of(self._rows())

    @property
    def estimates(self) -> dict[str, Float64Array]:
        """What the filter believed at each sample (n,), by the names of the states, in their units.

        Raises ValueError where the rows were not kept; `replay` of the library keeps them.
        """
        rows = self._rows()
        return {name: rows[name] for name in self.setup.state_names}

    @property
    def innovation(self) -> Float64Array:
        """Reading less prediction at each sample [rad/s], (n,), NaN where there was none. Raises as `estimates`."""
        innovation: Float64Array = self._rows()["innovation_rad_s"]
        return innovation

    def entry(self) -> dict[str, Any]:
        """What the document of `replay --json` has of this log."""
        return log_entry(self.log.name, self.statistics, self.belief, self.setup, self.warnings, self.as_it_went)

    def document(self) -> dict[str, Any]:
        """The document of `replay --json` for this log alone."""
        seconds = {"read": 0.0, "filter": self.filter_s, "write": 0.0}
        return {"schema": REPLAY_SCHEMA, "logs": [self.entry()], "seconds": seconds}

    def text(self) -> str:
        """What `replay` prints of it."""
        entry = self.entry()
        lines = [entry_text(entry, self.statistics, self.belief, self.setup)]
        if self.as_it_went is not None:
            lines.append(as_it_went_text(entry))
        if self.noise_from is not None:
            noise_rad_s = self.setup.constants.speed_noise_rad_s
            shows_none = self.setup.fit_of_record is None and noise_rad_s == DEFAULT_SPEED_NOISE_RAD_S
            teller = "assumed, for the record shows none" if shows_none else f"taken from {self.noise_from}"
            lines.append(f"  speed noise {rpm_from_rad_s(noise_rad_s):.3g} rpm {teller}; --config gives the run's own")
        return "\n".join(lines)

    def plot(self, truth: Mapping[str, float] | None = None) -> Figure:
        """Speed, innovation and parameters over time, as a matplotlib figure; truth: parameters, drawn dashed."""
        in_rpm = self.setup.inertia_kg_m2 is not None
        log, columns = self.picture_rows or (self._held_log(), self._rows())
        return run_figure(log, columns, truth=truth, hindsight=self.hindsight, wheel_units=in_rpm)

    def __repr__(self) -> str:
        parts = zip(PARAMETER_NAMES, self.belief.parameters, self.belief.core.parameter_std, strict=True)
        return f"Run({self.log.name!r}, {', '.join(f'{name} {plus_minus(v, std)}' for name, v, std in parts)})"

    def _held_log(self) -> WheelLog:
        from rw_ekf.logs.wheel_log import WheelLog

        if not isinstance(self.log, WheelLog):
            raise ValueError(f"{self.log.name}: the rows of this log are not held")
        return self.log

    def _rows(self) -> dict[str, Any]:
        if self.columns is None:
            raise ValueError(f"{self.log.name}: the rows of this run were not kept")
        return self.columns


def replay_log(
    log: WheelLog,
    configuration: Configuration | None = None,
    model: WheelModel | None = None,
    setup: FilterSetup | None = None,
    *,
    with_columns: bool = False,
    smooth: bool = False,
    online: bool = False,
    advance: Callable[[int], object] = lambda n: None,
) -> Run:
    """Filter a log. Raises LogError for a log without a single speed, FilterError where the filter breaks.

    setup: where to start (`setup_of_run`); without it configuration, model or the record say. Without configuration and
    setup the belief at the end is that of `rw_ekf.hindsight`.
    with_columns: keep one row per sample. smooth: add smoothed states. online: send the log through the daemon's loop
    and filterpy; `advance` is then called for every 100 samples done.
    """
    began_s = time.perf_counter()
    noise_from = teller_of_noise(configuration, model, setup)
    again = None if model is None else made_of(model.source, log)
    # A run continues from its own start just as it went: every reading that it took then.
    log, sampling = without_repeats(log) if setup is None else (log, sampling_of(log))
    known = setup if setup is not None else model
    course = course_for(log, known)
    if not np.isfinite(course.speed_rad_s).any():
        raise LogError(f"{log.name}: not one of its {len(log)} samples has a speed; there is nothing to filter")
    with_hindsight = setup is None and configuration is None
    colour = None
    if with_hindsight:
        course, colour = independent_readings(course)
        log = replace(log, speed_rad_s=course.speed_rad_s)
    described = setup is not None or configuration is not None or model is not None
    odd = warnings_of(*misreadings_and_questions(log, described=described))
    if setup is None:
        setup = setup_of_record(course, configuration, model)
    if smooth and setup.effects.table().hidden:
        raise BadInputError(
            f"--smooth cannot look back through the hidden state of {', '.join(setup.effects.ids)}: leave it out"
        )
    with blaming(model, log.name):
        if with_hindsight:
            setup = with_stribeck_speeds(course, setup)
            if model is not None:
                course = with_warmth_of_record(log, course, setup)
                setup = as_of_another_record(course, setup)
            run, setup = run_of_log(course, setup, keep_states=with_columns, keep_history=smooth)
        if online:
            run = _online(log, setup, advance)
        elif not with_hindsight:
            run = filtered(course, setup, keep_states=with_columns, keep_history=smooth)
        sums = PassSums.of(setup)
        sums.add(course, run)
        sums.refuse_runaway()
        belief = belief_of_log(course, setup, run) if with_hindsight else Belief(run.mean, run.covariance)
        consistency = judge_log(course, setup, belief)
    warnings = [
        *odd,
        *of_lost_temperature(log.time_s, log.channels.get("temperature_degC"), setup.effects),
        *replay_of_log_reported(log, sampling, model, again, colour),
        *setup.notes,
        *sums.remarks(driven=bool(np.any(log.current_A != 0.0))),
        *consistency.warnings(),
    ]
    columns = columns_of_run(log, run, setup, smooth=smooth) if with_columns else None
    as_it_went = Belief(run.mean, run.covariance) if with_hindsight else None
    return Run(
        log, setup, belief, sums.statistics, consistency, tuple(dict.fromkeys(warnings)), columns, as_it_went,
        noise_from, time.perf_counter() - began_s, len(sums.troubles),
    )  # fmt: skip


def replay_of_log_reported(
    log: WheelLog | LongLog,
    sampling: Sampling,
    model: WheelModel | None,
    again: str | None,
    colour: NoiseColour | None,
) -> list[str]:
    """What is reported of a log and of the model that was given for it, before anything of the filter.

    again: that the model was made of this very log. colour: of the readings' noise.
    """
    return [
        *sampling.remarks(),
        *log.warnings,
        *(() if model is None else model.remarks),
        *([] if again is None else [again]),
        *([] if colour is None else [colour.sentence]),
    ]


def teller_of_noise(
    configuration: Configuration | None, model: WheelModel | None, setup: FilterSetup | None
) -> str | None:
    """Where the readings' noise is from, if it was not given."""
    if setup is not None or configuration is not None:
        return None
    return "the model" if model else "the record"


def setup_of_run(log: Path) -> FilterSetup:
    """Start as the run did that wrote this log: from its `STEM.start.yaml`, in the configuration of its metadata.

    Without a start model from what the configuration says. Raises LogError without metadata, ConfigError where they
    cannot be taken.
    """
    from rw_ekf.settings.load import configuration_of  # pydantic takes a tenth of a second, and few replays get here

    metadata = read_metadata(log)
    if metadata is None:
        raise LogError(f"{log}: has no {metadata_path(log).name} beside it, which says how its run started")
    configuration = configuration_of(metadata.configuration, metadata_path(log))
    remark = changed(metadata_path(log))
    stated = () if remark is None else (remark,)
    if start_path(log).is_file():
        start = read_model(start_path(log))
        setup = setup_of_start(configuration, start)
        return replace(setup, notes=(*stated, *start.remarks, *setup.notes))
    named = configuration.filter.model
    if named is None:
        setup = setup_of_configuration(configuration, None)
    else:
        model = carried_over(read_model(Path(named)))[0]
        setup, stated = setup_of_configuration(configuration, model), (*stated, *model.remarks)
    return replace(setup, notes=(*stated, *setup.notes))


def refuse_runaway_model(log: str, course: Course, setup: FilterSetup, model: WheelModel) -> None:
    """Raise BadInputError where the filter, set up from that model, goes beyond what any machine does in this log."""
    with blaming(model, log):
        run = filter_log(course, setup.constants, setup.prior.mean, setup.prior.covariance, setup.effects)
        sums = PassSums.of(setup)
        sums.add(course, run)
        sums.refuse_runaway()


@contextmanager
def blaming(model: WheelModel | None, log: str) -> Iterator[None]:
    """Where the filter breaks with a model that somebody gave, that model is bad input."""
    try:
        yield
    except FilterError:
        if model is None:
            raise
        raise BadInputError(
            f"{log}: with the model given the filter runs away from these readings: it is not a model of this machine, "
            "or not in the units of this log; give another model, or none"
        ) from None


def rows_of_log(log: WheelLog) -> Iterator[tuple[WheelSample, IssuedCommand]]:
    """Yield the log as the samples and commands of a run."""
    channels = log.channels
    temperature, pressure = channels.get("temperature_degC"), channels.get("pressure_Pa")
    voltage, angle = channels.get("bus_voltage_V"), channels.get("angle_rad")
    for i in range(len(log)):
        speed = float(log.speed_rad_s[i])
        sample = WheelSample(
            time_s=float(log.time_s[i]),
            speed_rad_s=None if np.isnan(speed) else speed,
            temperature_degC=_value(temperature, i),
            pressure_Pa=_value(pressure, i),
            bus_voltage_V=_value(voltage, i),
            angle_rad=_value(angle, i),
            segment=int(log.segment[i]),
        )
        yield sample, IssuedCommand(float(log.current_A[i]), float(log.command_delay_s[i]))


def _value(values: Float64Array | None, i: int) -> float | None:
    return None if values is None or np.isnan(values[i]) else float(values[i])


def _online(log: WheelLog, setup: FilterSetup, advance: Callable[[int], object]) -> FilterRun:
    """Run the daemon's loop over the log and collect what the compiled pass would have left."""
    from rw_ekf.attach.opening import replay_wheel
    from rw_ekf.filter.estimator import Estimator
    from rw_ekf.live.loop import command_of_record, readings_of_record, run_loop
    from rw_ekf.sinks.array_sink import ArraySink

    estimator = Estimator(setup.constants, setup.prior.mean, setup.prior.covariance, setup.effects, setup.effect_drift)
    driver = replay_wheel(rows_of_log(log), log.name)
    sink = ArraySink(len(log), advance, len(setup.state_names))
    run_loop(readings_of_record(driver), estimator, command_of_record(driver), [sink])
    driver.close()
    return sink.as_run(estimator.mean, estimator.covariance)


def columns_of_run(log: WheelLog, run: FilterRun, setup: FilterSetup, *, smooth: bool) -> dict[str, Any]:
    """One row per sample, as docs/contract.md#logs has them."""
    columns: dict[str, Any] = {"time_s": log.time_s}
    columns |= {name: run.states[:, i] for i, name in enumerate(setup.state_names)}
    columns |= {f"std_{name}": run.stds[:, i] for i, name in enumerate(setup.state_names)}
    columns["innovation_rad_s"] = run.innovation_rad_s
    columns["innovation_std_rad_s"] = np.sqrt(run.innovation_variance)
    columns["nis"] = run.nis
    columns["accepted"] = (run.outcome == gating.UPDATED) | (run.outcome == gating.FIRST)
    columns["reason"] = np.array(REASONS, dtype=object)[run.outcome]
    if smooth:
        from rw_ekf.filter.smoother import smooth_log

        means, stds = smooth_log(run)
        columns |= {f"smoothed_{name}": means[:, i] for i, name in enumerate(setup.state_names)}
        columns |= {f"std_smoothed_{name}": stds[:, i] for i, name in enumerate(setup.state_names)}
    return columns


# By outcome code of rw_ekf.filter.gating; an accepted sample has none.
REASONS = ["first", "", "missing", "gate", "repeated", "backward", "reseeded"]
