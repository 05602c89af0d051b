"""What `import rw_ekf` offers: each verb as a function, with what it finds as a value (docs/library.md).

Units are in the names. What cannot be done is raised as an `rw_ekf.Error` with the sentence that the command prints;
nothing is printed, and nothing ends the program.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence, ValuesView
from contextlib import contextmanager
from dataclasses import replace
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from numpy.typing import ArrayLike
from pydantic import Field

from rw_ekf.attitude_bench.held import Bench, hold_bench
from rw_ekf.attitude_bench.prepare import scenario_of, schemes_of
from rw_ekf.batch_fit import Fit, fit_record
from rw_ekf.checking.arguments import arguments
from rw_ekf.checking.choices import FitMethod, SplitKind
from rw_ekf.checking.effect_file import read_effect_file
from rw_ekf.checking.paths import path_of
from rw_ekf.checking.section import Section
from rw_ekf.checking.wording import suggestion
from rw_ekf.diagnosis.log_diagnosis import diagnose_log
from rw_ekf.diagnosis.result import Diagnosis
from rw_ekf.effects.catalogue import CATALOGUE_IDS
from rw_ekf.effects.own_effect import effect_of
from rw_ekf.errors import FilterError
from rw_ekf.errors import RwEkfError as Error
from rw_ekf.filter.belief import DEFAULT_PRIOR, with_prior_table
from rw_ekf.filter.constants import filter_constants
from rw_ekf.filter.estimator import Estimator as Filter
from rw_ekf.foreign_columns import GuessedColumns, doubted, guessed_columns
from rw_ekf.identify.record_scale import DEFAULT_STRIBECK_SPEED_RAD_S
from rw_ekf.learning.aged_model import as_given, carried_over
from rw_ekf.log_replay import Run, replay_log
from rw_ekf.log_simulation import simulate as simulated
from rw_ekf.logs.column_map import ColumnMap
from rw_ekf.logs.excerpt import read_log_or_excerpt
from rw_ekf.logs.joined import one_log
from rw_ekf.logs.local_time import zone_of
from rw_ekf.logs.reader import log_of_arrays, map_of, read_columns, read_log
from rw_ekf.logs.wheel_log import WheelLog as Log
from rw_ekf.model_comparison import Comparison, compared
from rw_ekf.one_thread import one_thread
from rw_ekf.records import Estimate, IssuedCommand, WheelSample
from rw_ekf.settings.schema import Configuration
from rw_ekf.starting_point import setup_of_model
from rw_ekf.units import rad_s_from_rpm
from rw_ekf.wheel.model_file import WheelModel as Model

if TYPE_CHECKING:
    from zoneinfo import ZoneInfo

__all__ = [
    "Bench", "Comparison", "Diagnosis", "Error", "Estimate", "Estimator",
    "Fit", "GuessedColumns", "Log", "Model", "Run",
    "bench", "compare", "diagnose", "fit", "guess_columns", "read", "replay", "simulate",
]  # fmt: skip

HasModel = Model | Fit | Diagnosis | Run
Progress = bool | Callable[[str], object] | None


_NUMPY_USUAL: Any = {"divide": "warn", "over": "warn", "under": "ignore", "invalid": "warn"}


@contextmanager
def _undisturbed() -> Iterator[None]:
    """One thread for linear algebra, and numpy's usual way with overflows, whatever else the program set."""
    with one_thread(), np.errstate(**_NUMPY_USUAL):
        yield


def read(
    source: Any = None,
    columns: str | Path | ColumnMap | GuessedColumns | None = None,
    time_zone: str | None = None,
    *,
    wheel: str | int | None = None,
    **arrays: ArrayLike,
) -> Log:
    """Read a log: a file of any form of docs/logs.md, a pandas, polars or arrow table, or a mapping of names to arrays.

    Or arrays by the names that a log's columns have, in place of a source, as `Log.from_arrays` takes them:
    `read(time_s=..., speed_rad_s=..., current_A=...)`.

    columns: the column map of a foreign one, its path, or what `guess_columns` found; without it columns of other names
    are guessed, if that is certain; what the motion then speaks against is among the log's warnings. wheel: of a file
    or table that holds several, the one of that name or number: by the groups that bear it (InfluxDB's tag, a topic),
    or the rows in which the column that distinguishes them has it. time_zone: in which dates and times are that bear no
    zone themselves, by its IANA name ("Europe/Berlin"); None: UTC. `time_s` of such a log is in seconds since 1970 in
    UTC. Raises Error with file, line and column, and what to do.
    """
    zone = zone_of(time_zone)
    if source is None or arrays:
        return _of_arrays(source, arrays, columns, wheel, zone)
    taken = columns.column_map if isinstance(columns, GuessedColumns) else columns
    if wheel is not None:
        taken = replace(map_of(taken), wheel=str(wheel))
    of_file = isinstance(source, str | PathLike)
    log = read_log(path_of(source, "a log"), taken, zone) if of_file else read_columns(source, taken, zone)
    guessed = columns is None and any(source.column != name for name, source in log.sources.items())
    return doubted(log) if guessed else log


def _of_arrays(source: Any, arrays: Mapping[str, Any], columns: object, wheel: object, zone: ZoneInfo | None) -> Log:
    """A log of arrays alone. Raises Error for what does not go with them."""
    if not arrays:
        raise Error(
            "read: a log is wanted: a path, a table, or arrays by name, as time_s=..., speed_rad_s=..., current_A=..."
        )
    for name, given in (("source", source), ("columns", columns), ("wheel", wheel)):
        if given is not None:
            raise Error(
                f"read: {name} and arrays by name ({', '.join(arrays)}) do not go together: give a source with its "
                "columns, time_zone and wheel, or arrays and time_zone"
            )
    return log_of_arrays(arrays, "arrays", zone)


def guess_columns(source: Any, columns: str | Path | ColumnMap | None = None, **answers: object) -> GuessedColumns:
    """Guess which column of a foreign log, or of a table, is what; what it cannot know becomes a question.

    answers: `current=3`, `speed="n:rpm"`, or of a part, with two underscores, `current__unit="mA"`. columns: a map that
    says only how the file is laid out. Raises Error.
    """
    reported = {name.replace("__", "."): "none" if value is None else str(value) for name, value in answers.items()}
    return guessed_columns(source, reported, columns)


simulate = _undisturbed()(simulated)


@_undisturbed()
def replay(
    log: Log | str | Path,
    model: HasModel | str | Path | None = None,
    smooth: bool = False,
    *,
    configuration: Configuration | str | Path | None = None,
) -> Run:
    """Filter a log, sample by sample, as the daemon would have. smooth: add what the whole log says of each sample.

    Without configuration and model noise, prior and scale come from the log itself. Raises Error.
    """
    given = _configuration(configuration)
    return replay_log(_log(log), given, _model(model, given), with_columns=True, smooth=smooth)


@_undisturbed()
def fit(
    logs: Log | str | Path | Sequence[Log | str | Path],
    prior: HasModel | str | Path | None = None,
    noise: bool = False,
    *,
    method: FitMethod = "least-squares",
    configuration: Configuration | str | Path | None = None,
) -> Fit:
    """Fit the parameters to a whole log, or to several of one wheel, and the effects of the prior.

    noise: report the noises as well. Raises Error.
    """
    given = _configuration(configuration)
    return fit_record(
        one_log(list(map(_log, _several(logs)))), given, _model(prior, given), method=method, with_noise=noise
    )


@_undisturbed()
def diagnose(
    logs: Log | str | Path | Sequence[Log | str | Path],
    model: HasModel | str | Path | None = None,
    *,
    split: SplitKind = "blocks",
    configuration: Configuration | str | Path | None = None,
    effect_file: str | Path | None = None,
    progress: Progress = False,
) -> Diagnosis:
    """Find what the model lacks in a log, or in several of one wheel.

    effect_file: of formulas of one's own, judged beside the catalogue. progress: True for a bar on a terminal, or a
    function that is given each step in words. Raises Error.
    """
    formulas = [] if effect_file is None else read_effect_file(path_of(effect_file, "an effect file"), CATALOGUE_IDS)
    given = _configuration(configuration)
    own = [effect_of(formula) for formula in formulas]
    with _reported(progress, "diagnose") as tell:
        held = [read_log_or_excerpt(log) if isinstance(log, str | PathLike) else _log(log) for log in _several(logs)]
        return diagnose_log(held, given, _model(model, given), split=split, advance=tell, own=own)


@np.errstate(**_NUMPY_USUAL)
def bench(
    model: HasModel | str | Path | None = None,
    *,
    schemes: Sequence[str] | str | None = None,
    seeds: int = 1,
    effects: Sequence[str] | str = (),
    scenario: str | Path | None = None,
    robustness: bool = False,
    spikes: bool = False,
    progress: Progress = False,
) -> Bench:
    """Hold friction compensations against each other on an attitude bench, over a wheel that reverses (docs/bench.md).

    model: whose wheel is put on the bench, effects and all. schemes: their ids, or ["all"]; None: one of each kind.
    effects: of the true wheel, that the first model does not have, as `bench --effect` has them. scenario: its file.
    Runs in processes of its own, which end with it. Raises Error.
    """
    held = _model(model)
    setting = scenario_of(scenario, held, effects)
    with _reported(progress, "bench") as tell:
        return hold_bench(
            schemes_of(schemes), setting, held, seeds, with_robustness=robustness, with_spikes=spikes,
            advance=lambda of: tell(f"{of} runs"),
        )  # fmt: skip


@_undisturbed()
def compare(
    first: HasModel | str | Path, second: HasModel | str | Path, on: Log | str | Path | None = None
) -> Comparison:
    """Hold two models, fits or runs against each other, number by number; on: which of them a third log likes better.

    Raises Error.
    """
    return compared(_held(first), _held(second), None if on is None else _log(on))


_ValueAndStd = tuple[float, Annotated[float, Field(gt=0.0)]]


class _OwnLoop(Section):
    """What an `Estimator` is given beside a model."""

    speed_noise_rpm: float = Field(gt=0, le=1e4, description="standard deviation of one speed reading [rpm]")
    acceleration_noise_rpm_per_sqrt_s: float = Field(ge=0, le=1e4, description="random walk of the speed [rpm/sqrt(s)]")
    period_s: float = Field(gt=0, description="usual time between two steps [s]")
    inertia_kg_m2: float | None = Field(
        None, gt=0, description="of the wheel [kg m^2]; it turns frictions into torques"
    )
    motor_gain: _ValueAndStd | None = Field(None, strict=False, description="value and std [rad/s^2/A]")
    viscous: _ValueAndStd | None = Field(None, strict=False, description="value and std [1/s]")
    coulomb: _ValueAndStd | None = Field(None, strict=False, description="value and std [rad/s^2]")
    static: _ValueAndStd | None = Field(None, strict=False, description="value and std [rad/s^2]")


_CONDITIONS = ("temperature_degC", "pressure_Pa", "bus_voltage_V", "angle_rad", "segment")  # that a step may be given


class Estimator:
    """The daemon's filter, for a loop of one's own: `step` with each reading."""

    def __init__(
        self,
        model: HasModel | str | Path | None = None,
        *,
        speed_noise_rpm: float = 1.0,
        acceleration_noise_rpm_per_sqrt_s: float = 0.03,
        period_s: float = 0.1,
        inertia_kg_m2: float | None = None,
        **priors: tuple[float, float],
    ) -> None:
        """Start from a model, else from the prior around [CK13]; noises that the model knows are the model's.

        A model is believed as a run believes it: of a wheel of another temperature, without what belonged to its
        record (docs/learning.md); `findings` names that. priors: motor_gain, viscous, coulomb, static as (value,
        standard deviation), in place of either's. period_s: usual time between two steps; a gap is never shorter than
        five of it. inertia_kg_m2: for `Estimate.friction_torque`; None: the model's, if somebody gave it one. Raises
        Error.
        """
        numbers: dict[str, Any] = {
            "speed_noise_rpm": speed_noise_rpm, "period_s": period_s,
            "acceleration_noise_rpm_per_sqrt_s": acceleration_noise_rpm_per_sqrt_s, "inertia_kg_m2": inertia_kg_m2,
        }  # fmt: skip
        given = arguments(_OwnLoop, numbers | priors, "Estimator")
        noise, period_s = rad_s_from_rpm(given.speed_noise_rpm), given.period_s
        torque_noise = rad_s_from_rpm(given.acceleration_noise_rpm_per_sqrt_s)
        known = _model(model)
        self._left_behind: list[str] = []
        self._inertia_kg_m2 = given.inertia_kg_m2
        if known is not None and not known.inertia_is_assumed:
            self._inertia_kg_m2 = given.inertia_kg_m2 or known.inertia_kg_m2
        if known is None:
            belief, effects, drift = DEFAULT_PRIOR, None, None
            constants = filter_constants(
                DEFAULT_STRIBECK_SPEED_RAD_S, speed_noise_rad_s=noise, acceleration_noise=torque_noise,
                nominal_period_s=period_s,
            )  # fmt: skip
        else:
            known, self._left_behind = carried_over(known)
            setup = setup_of_model(as_given(known), noise, torque_noise, period_s)
            constants, belief, effects, drift = setup.constants, setup.prior, setup.effects, setup.effect_drift
        belief = with_prior_table(belief, {name: getattr(given, name) for name in priors if getattr(given, name)})
        more = {} if effects is None else {"effects": effects, "drift": drift}
        self._filter = Filter(constants, belief.mean, belief.covariance, **more)  # type: ignore[arg-type]

    @np.errstate(**_NUMPY_USUAL)
    def step(self, time_s: float, speed_rad_s: float | None, current_A: float, **conditions: float) -> Estimate:
        """Take a reading, and the current that is in force from then on; returns what is believed at the reading.

        speed_rad_s: None or NaN where there was none. conditions: temperature_degC, angle_rad, for effects that need
        them; segment, another whole number where the time has begun anew. Raises Error for what is no number, and has
        then taken nothing.
        """
        unknown = next((name for name in conditions if name not in _CONDITIONS), None)
        if unknown is not None:
            raise Error(f"step: unknown condition {unknown}; {suggestion(unknown, _CONDITIONS)}")
        time_s, current_A = _finite("time_s", time_s), _finite("current_A", current_A)
        reported = {name: _finite_or_none(name, value) for name, value in conditions.items()}
        segment = reported.pop("segment", 0)
        if segment is None or segment % 1:
            raise Error(f"step: segment is {conditions['segment']!r}: a whole number is wanted")
        sample = WheelSample(time_s, _finite_or_none("speed_rad_s", speed_rad_s), **reported, segment=int(segment))  # type: ignore[arg-type]
        estimate = self._filter.step(sample)
        self._filter.command_issued(IssuedCommand(current_A))
        return estimate if self._inertia_kg_m2 is None else replace(estimate, inertia_kg_m2=self._inertia_kg_m2)

    @property
    def findings(self) -> list[str]:
        """What of the model was left behind, and what had to be reset so far, and why, in sentences."""
        return [*self._left_behind, *self._filter.findings]


def _finite(name: str, value: Any, wanted: str = "a finite number") -> float:
    """A number that a step was given. Raises FilterError for what is none."""
    try:
        if math.isfinite(value):
            return float(value)
    except (TypeError, ValueError, OverflowError):
        pass
    raise FilterError(f"step: {name} is {value!r}: give {wanted}")


def _finite_or_none(name: str, value: Any) -> float | None:
    """The same of what may be missing: None, NaN of whatever type, or masked."""
    missing = value is None or np.ma.is_masked(value) or _is_nan(value)
    return None if missing else _finite(name, value, "a finite number, or None where there was none")


def _is_nan(value: Any) -> bool:
    try:
        return math.isnan(value)
    except (TypeError, ValueError, OverflowError):  # no number, several, or a whole one beyond all floats
        return False


@contextmanager
def _reported(progress: Progress, title: str) -> Iterator[Callable[[str], object]]:
    """The function that is given each step in words. Raises Error where it is none."""
    if callable(progress):
        yield progress
    elif progress is None or progress is False:
        yield lambda text: None
    elif progress is not True:
        raise Error(f"progress: True, False or a function of a text is wanted; found {progress!r}")
    else:
        from rw_ekf.console import progress as shown

        with shown(title, None) as bar:

            def tell(text: str) -> None:
                bar.set_description(text)
                bar.update(1)

            yield tell


def _several(logs: Log | str | Path | Sequence[Log | str | Path]) -> list[Log | str | Path]:
    several = isinstance(logs, Sequence | Iterator | ValuesView) and not isinstance(logs, str | bytes)
    return list(logs) if several else [logs]  # type: ignore[arg-type, list-item]


def _log(given: Log | str | Path) -> Log:
    if isinstance(given, str | PathLike):
        return read_log(given)
    if not isinstance(given, Log):
        raise Error(f"a log is wanted, or the path of one; found {type(given).__name__}: `read` makes a log of a table")
    return given


def _configuration(given: Configuration | str | Path | None) -> Configuration | None:
    if given is None or isinstance(given, Configuration):
        return given
    from rw_ekf.settings.load import load_configuration

    return load_configuration(path_of(given, "a configuration"))


def _model(given: HasModel | str | Path | None, configuration: Configuration | None = None) -> Model | None:
    """What was given, else what the configuration names, else none."""
    named = given if given is not None or configuration is None else configuration.filter.model
    return None if named is None else _held(named)


def _held(given: HasModel | str | Path) -> Model:
    """A model, that of a result, or of a file. Raises Error where a diagnosis has none."""
    if isinstance(given, str | PathLike):
        return Model.load(given)
    if not hasattr(given, "model") and not isinstance(given, Model):
        raise Error(f"a model is wanted, what holds one, or the path of one; found {type(given).__name__}")
    model = given if isinstance(given, Model) else given.model
    if model is None:
        raise Error(f"{given!r} found no model")
    return model
