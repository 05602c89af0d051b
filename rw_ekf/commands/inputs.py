"""What several verbs read: logs with a column map, configurations, models."""

from __future__ import annotations

import argparse
import math
import os
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

from rw_ekf.console import STATUS

if TYPE_CHECKING:
    from rw_ekf.checking.effect_file import OwnFormula
    from rw_ekf.effects.own_effect import OwnEffect
    from rw_ekf.learning.run_start import GivenModel
    from rw_ekf.logs.column_map import ColumnMap
    from rw_ekf.logs.long_log import LongLog
    from rw_ekf.logs.wheel_log import WheelLog
    from rw_ekf.settings.schema import Configuration
    from rw_ekf.wheel.model_file import WheelModel
    from rw_ekf.wheel.wheel_tag import WheelTag


CONFIG_HELP = "configuration file, or the name of a shipped one: simulated, example, bus"


def add_config_option(
    parser: argparse.ArgumentParser, what: str = "", *, required: bool = False, one_wheel: bool = True
) -> None:
    """Add --config, and --wheel where one wheel of it can be meant; what: it is read for."""
    help_text = f"{CONFIG_HELP}; {what}" if what else CONFIG_HELP
    parser.add_argument("-c", "--config", metavar="F", required=required, help=help_text)
    if one_wheel:
        what = "of a configuration with several wheels (wheels: [...]) that one"
        parser.add_argument("--wheel", metavar="NAME", help=what)


def duration_s(text: str, *, or_zero: bool = False) -> float:
    """An option's duration [s]. Raises ArgumentTypeError naming what was found."""
    from rw_ekf.units import seconds_from

    seconds = seconds_from(text)
    if seconds is None or not 0.0 <= seconds < math.inf or (seconds == 0.0 and not or_zero):
        kind = "duration" if or_zero else "duration above zero"
        raise argparse.ArgumentTypeError(f"{text!r} is no {kind}: write 90, 90s, 10m, 2h, 1d or 1h30m")
    return seconds


def add_log_options(parser: argparse.ArgumentParser) -> None:
    """Options of every verb that reads logs."""
    parser.add_argument("--columns", metavar="MAP", help="column map (YAML) of a foreign log; see docs/logs.md")
    add_config_option(parser, "noise, prior, Stribeck speed, inertia; without it the record tells")


def log_options(args: argparse.Namespace) -> list[str]:
    """Those of `add_log_options` that were given, as they can be typed again from anywhere."""
    from rw_ekf.settings.load import configuration_path
    from rw_ekf.settings.resources import config_directory

    given = []
    for option, name, path_of in (
        ("--columns", args.columns, map_path),
        ("--config", args.config, configuration_path),
    ):
        if name is not None:
            path = path_of(name)
            given += [option, name if path.parent == config_directory() else str(path.absolute())]
    return given


def read_configuration(args: argparse.Namespace) -> Configuration | None:
    """Read the configuration of --config, if there is one, of the wheel of --wheel.

    Raises ConfigError, and UsageError for a wheel of no configuration: which wheel of a log is meant, a map states.
    """
    refuse_wheel_of_nothing(args)
    if args.config is None:
        return None
    from rw_ekf.settings.load import load_configuration

    STATUS.tell(f"reads the configuration {args.config}")
    return load_configuration(args.config, args.wheel)


def refuse_wheel_of_nothing(args: argparse.Namespace) -> None:
    """Raise UsageError where --wheel has no --config whose wheel it could be."""
    from rw_ekf.errors import UsageError

    if args.config is None and args.wheel is not None:
        raise UsageError(
            f"--wheel {args.wheel}: names one of the wheels of a configuration, and there is none: give --config, or "
            "leave it out; of a log that holds several wheels a column map says which (`only` or `variable`)"
        )


def read_wheel_model(path: str | None, configuration: Configuration | None = None) -> WheelModel | None:
    """Read the model named on the command line, else the configuration's `filter.model`, else none."""
    named = path or (configuration.filter.model if configuration is not None else None)
    if named is None:
        return None
    from rw_ekf.wheel.model_file import read_model

    STATUS.tell(f"reads the model {named}")
    return read_model(Path(named))


def read_own_formulas(path: str | None) -> list[OwnFormula]:
    """Read a file of a user's own effects, if one is named. Raises ConfigError with file:line:column."""
    if path is None:
        return []
    from rw_ekf.checking.effect_file import read_effect_file
    from rw_ekf.drivers.sim.plant_effects import EFFECTS
    from rw_ekf.effects.catalogue import CATALOGUE_IDS

    return read_effect_file(path, CATALOGUE_IDS | EFFECTS.keys())


def read_own_effects(path: str | None, model: WheelModel | None) -> list[type[OwnEffect]]:
    """The same as effects of the estimator. Raises ConfigError too where the model has another of one id."""
    if path is None:
        return []
    from rw_ekf.effects.own_effect import effect_of
    from rw_ekf.errors import ConfigError

    own = [effect_of(formula) for formula in read_own_formulas(path)]
    known = {} if model is None else {effect.id: effect for effect in model.own_effects}
    findings = [
        f"{path}: {effect.id} is in the model by another formula, {known[effect.id].equation}: give yours another id"
        for effect in own
        if known.get(effect.id, effect) is not effect
    ]
    if findings:
        raise ConfigError(findings)
    return own


def given_model(configuration: Configuration, args: argparse.Namespace) -> GivenModel:
    """Read what `run` and `excite` were given to start from: --model, else filter.model, and how they take it."""
    from rw_ekf.learning.run_start import GivenModel

    return GivenModel(
        read_wheel_model(args.model, configuration),
        args.model or configuration.filter.model,
        named=args.model is not None,
        fresh=args.fresh,
        other_wheel=args.other_wheel,
    )


def wheel_of_logs(logs: Iterable[str]) -> WheelTag | None:
    """Whose logs these are, by the models that their runs left beside them; None where one does not say or differs."""
    from dataclasses import replace

    tags = [_wheel_of_log(log) for log in logs]
    known = [tag for tag in tags if tag is not None]
    if not known or len(known) < len(tags) or any(tag.difference(known[0]) is not None for tag in known):
        return None
    return replace(known[0], sign_confirmed=any(tag.sign_confirmed for tag in known))


def _wheel_of_log(log: str) -> WheelTag | None:
    from rw_ekf.errors import ConfigError
    from rw_ekf.logs.run_directory import model_path, start_path
    from rw_ekf.wheel.model_file import read_model

    for path in (model_path(log), start_path(log)):  # at the end more is known than at the start
        try:
            tag = read_model(path).wheel
        except ConfigError:
            continue
        if tag is not None:
            return tag
    return None


def read_logs(paths: list[str], columns: str | None, *, excerpts: bool = False) -> list[WheelLog]:
    """Read logs, all through the same column map if one is named. Raises LogError or ConfigError.

    excerpts: of those that are too long to be held, stretches will do.
    """
    from rw_ekf.logs.excerpt import read_log_or_excerpt
    from rw_ekf.logs.reader import read_log

    column_map = read_column_map(columns)
    logs = [read_log_or_excerpt(path, column_map) if excerpts else read_log(path, column_map) for path in paths]
    for log in logs:
        tell_of_log(log)
    return logs


def tell_of_log(log: WheelLog | LongLog) -> None:
    """Say with -v what was read: its rows, and which column of the file is what."""
    from rw_ekf.logs.wheel_log import WheelLog

    sources = log.sources.items() if isinstance(log, WheelLog) else ()
    reported = "; ".join(f"{name} is column {source.column!r}" for name, source in sources if source.kind != "constant")
    STATUS.tell(f"has read {log.name}: {len(log)} rows{f'; {reported}' if reported else ''}")


def read_column_map(columns: str | None) -> ColumnMap:
    """The column map that is named, or that of a log's own names. Raises ConfigError."""
    from rw_ekf.logs.column_map import ColumnMap

    if columns is None:
        return ColumnMap()
    from rw_ekf.logs.column_map_file import load_column_map  # here, for the checker takes a tenth of a short replay

    path = map_path(columns)
    STATUS.tell(f"reads the column map {path}")
    return load_column_map(path)


def map_path(name: str) -> Path:
    """Find the column map that is meant: a file, or the name of a shipped one. Raises ConfigError."""
    from rw_ekf.settings.resources import available_resources, own_or_shipped

    return own_or_shipped(name, [shipped for shipped in available_resources() if shipped.startswith("columns-")])


def make_place(directory: Path) -> None:
    """Make the folder of --out, before the work. Raises BadInputError where that cannot be, or none may write there."""
    from rw_ekf.errors import BadInputError

    try:
        directory.mkdir(parents=True, exist_ok=True)
        reason = None if os.access(directory, os.W_OK | os.X_OK) else "Permission denied"
    except OSError as error:
        reason = error.strerror or str(error)
    if reason is not None:
        raise BadInputError(f"{directory}: cannot be a directory to write in ({reason}): give another place to --out")


def refuse_to_overwrite(outputs: Iterable[str | None], inputs: Iterable[str | None]) -> None:
    """Raise BadInputError where an output is an input, or a part of one: a log from hardware cannot be had again.

    Nor must an output take the name of a log whose first part has been compressed: it would stand for that part.
    """
    from rw_ekf.errors import BadInputError
    from rw_ekf.logs.parts import parts_of

    named = [Path(name) for name in inputs if name is not None]
    read = [file for path in named for file in (path, *parts_of(path).files)]
    for name in outputs:
        if name is None:
            continue
        STATUS.tell(f"will write {name}")
        place = Path(name)
        same_name = not place.exists() and place.absolute() in [path.absolute() for path in named]
        if same_name or (place.exists() and any(path.exists() and path.samefile(place) for path in read)):
            raise BadInputError(f"{name}: is also read by this command and would be lost: name another file to write")
