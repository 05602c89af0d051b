"""Where a run starts: from what was learned before, from a model that was named, or from the configuration; and why."""

from __future__ import annotations

import math
import os
from dataclasses import dataclass, replace
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rw_ekf.errors import BadInputError, ConfigError
from rw_ekf.learning.aged_model import aged, as_given, carried_over
from rw_ekf.learning.learned_file import Learned, content_of, fingerprint, out_of_bounds, read_learned
from rw_ekf.starting_point import FilterSetup, model_of, setup_of_configuration, setup_of_start
from rw_ekf.wheel.model_file import WheelModel
from rw_ekf.wheel.wheel_tag import WheelTag

if TYPE_CHECKING:
    from rw_ekf.settings.schema import Configuration

_UNKNOWN_AGE_S = 365.0 * 86_400.0  # of a file from the future: some clock was wrong, nobody knows which
_SURE = 2.0  # standard deviations by which a gain that drives must be positive
_NO_CURRENT = 100.0  # times limits.current_A: what does not overcome Coulomb friction then has no motor
_STEPPED_S = 60.0  # by so much a clock is set back now and then
_OF_START = ("speed_noise_rpm", "acceleration_noise_rpm_per_sqrt_s", "parameter_drift_percent_per_sqrt_hour", "prior")


@dataclass(frozen=True)
class GivenModel:
    """What a run was given on its command line and by filter.model."""

    model: WheelModel | None = None
    file: str | None = None  # where it stands
    named: bool = False  # by --model: it goes before what was learned
    fresh: bool = False  # --fresh: what was learned is left alone
    other_wheel: bool = False  # --other-wheel: a model of another wheel may drive this one


@dataclass(frozen=True)
class Start:
    """Where a run starts, and what had to be reported about it."""

    setup: FilterSetup
    model: WheelModel  # the same, as a replay can take it up
    wheel: WheelTag  # the wheel that is driven; sign_confirmed as far as it is known now
    origin: FilterSetup  # of the configuration: the sign is held against it, not against what was learned
    fingerprint: str  # of where the configuration starts
    document: dict[str, Any]  # for the run's document: from, file, age_s, not_used
    stated: tuple[tuple[str, str], ...] = ()  # events with their sentences
    replaces: bool = False  # a learned file stands there that this run does not continue from
    standing: WheelModel | None = None  # what is in that file, as old as it is now, where it is of this wheel and sound
    from_prior: bool = True  # from the configuration alone: what it says before its first reading is the prior


def start_of_run(
    configuration: Configuration, given: GivenModel, wheel: WheelTag, learned: Path, now: datetime
) -> Start:
    """Choose. wheel: who answers now; learned: where its learned file would be.

    Raises BadInputError where the model that was given is of another wheel, which this run would drive.
    """
    stated: list[tuple[str, str]] = []
    model = given.model
    if model is not None:
        if configuration.command.writes:
            _check_gain(model, given, configuration.limits.current_A)
        stated += [("model_changed", text) for text in model.remarks]
        stated += _whose(model, given, wheel, drives=configuration.command.writes)
        model, notes = carried_over(model)
        stated += [("effect_not_carried_over", text) for text in notes]
        start = setup_of_configuration(configuration, None)
        model = as_given(model, start.constants, start.prior)
    setup = origin = setup_of_configuration(configuration, model)
    began = _fingerprint(configuration, given.model)
    found, why_not = _read(learned, configuration, given)
    standing = None
    if found is not None and why_not is not None and found.of_another(wheel) is None:
        standing = aged(found.model, origin, max((now - found.saved).total_seconds(), 0.0))
        standing = None if out_of_bounds(found.model, origin) else standing
    found = None if given.fresh else found
    if found is not None and why_not is None:
        why_not = _unfit(found, wheel, began, setup)
    tags = [known.wheel for known in (found, model) if known is not None and known.wheel is not None]
    wheel = replace(wheel, sign_confirmed=any(tag.vouches_for(wheel) for tag in tags))
    document: dict[str, Any] = {"from": "configuration" if model is None else "model", "file": given.file}
    document |= {"age_s": None, "learned_not_used": why_not}
    goes_on = found is not None and why_not is None
    if found is not None and goes_on:
        age_s = (now - found.saved).total_seconds()
        age_s = 0.0 if -_STEPPED_S < age_s < 0.0 else age_s
        model, notes = carried_over(found.model)
        stated += [("effect_not_carried_over", text) for text in notes]
        stated.append(("learned_continued", _continued(learned, found, age_s, wheel)))
        setup = setup_of_start(configuration, aged(model, origin, age_s if age_s >= 0.0 else _UNKNOWN_AGE_S))
        document = {"from": "learned", "file": str(learned), "age_s": age_s, "learned_not_used": None}
    elif why_not is not None:
        stated.append(
            ("learned_not_used", f"the run starts from {_origin(given)}, not from what was learned: {why_not}")
        )
    source = {"method": "start", **document, "started_from": began}
    return Start(
        setup=setup,
        model=replace(model_of(setup.prior, setup, source), effects=setup.effects, wheel=wheel),
        wheel=wheel,
        origin=origin,
        fingerprint=began,
        document=document,
        stated=tuple(stated),
        replaces=not goes_on and configuration.filter.continue_learned and os.path.lexists(learned),
        standing=standing,
        from_prior=model is None,
    )


def _check_gain(model: WheelModel, given: GivenModel, limit_A: float) -> None:
    """Raise BadInputError where no wheel has the model's gain, so that nothing may be driven by it."""
    gain, std = model.parameters.motor_gain, math.sqrt(model.covariance[0][0])
    if gain - _SURE * std > 0.0 and gain * _NO_CURRENT * limit_A > model.parameters.coulomb:
        return
    what = "is negative" if gain <= 0.0 else "may be none" if gain <= _SURE * std else "is too small to turn a wheel"
    raise BadInputError(
        f"{given.file}: motor_gain {gain:.4g} +- {std:.2g} rad/s^2/A {what}: no run drives a wheel by it. Fit the "
        "model again with the sign and the scale of current and speed as the wheel has them"
    )


def _whose(model: WheelModel, given: GivenModel, wheel: WheelTag, *, drives: bool) -> list[tuple[str, str]]:
    """What has to be reported of whose a given model is. Raises BadInputError where it must not drive this wheel."""
    if model.wheel is None:
        text = f"{given.file} does not say which wheel it is of: taken for this one's"
        return [("model_of_unknown_wheel", text)]
    difference = model.wheel.difference(wheel)
    if difference is None:
        return []
    if drives and not given.other_wheel:
        raise BadInputError(
            f"{given.file}: {difference}: this run would drive a wheel with a model of another. Give this wheel's own "
            "model, or --other-wheel if that is meant"
        )
    return [("model_of_another_wheel", f"{given.file}: {difference}")]


def _read(path: Path, configuration: Configuration, given: GivenModel) -> tuple[Learned | None, str | None]:
    """What was learned, where it can be read; and why nothing continues from it: no word where there is no file."""
    if not os.path.lexists(path):
        return None, None
    try:
        found = read_learned(path)
    except ConfigError as error:
        return None, "--fresh was given" if given.fresh else error.findings[0]
    if given.fresh:
        return found, "--fresh was given"
    if given.named:
        return found, "--model was given"
    return found, None if configuration.filter.continue_learned else "filter.continue_learned is false"


def _unfit(found: Learned, wheel: WheelTag, began: str, setup: FilterSetup) -> str | None:
    """Say why a run on this wheel cannot continue from it; None where it can."""
    if found.started_from != began:
        changed = "filter.model, filter.prior, a noise, the drift or the Stribeck curve is another than it began from"
    else:
        changed = None
    return found.of_another(wheel) or changed or out_of_bounds(found.model, setup)


def _fingerprint(configuration: Configuration, model: WheelModel | None) -> str:
    """Of everything that says where a run starts: what is learned from another start is not continued."""
    section = configuration.filter.model_dump(mode="json")
    numbers = {name: section[name] for name in _OF_START}
    stribeck = [configuration.wheel.stribeck_speed_rpm, configuration.wheel.stribeck_law]
    return fingerprint(numbers, stribeck, None if model is None else content_of(model))


def _origin(given: GivenModel) -> str:
    return "the configuration" if given.model is None else str(given.file)


def _continued(path: Path, found: Learned, age_s: float, wheel: WheelTag) -> str:
    if age_s >= 0.0:
        log = found.model.source.get("log")
        age = f"saved {duration_text(age_s)} ago by the run {log}; its sigmas have grown with that"
    else:
        age = "saved, by the clock, in the future: its sigmas have grown as if that were a year ago"
    unknown = "" if wheel.serial_number is not None else ". The wheel gives no serial number: taken for the same one"
    return f"the run goes on from {path}, {age}{unknown}"


def duration_text(seconds: float) -> str:
    """`4 s`, `12 min`, `3.5 h`, `9 days`."""
    for limit, unit, name in ((90.0, 1.0, "s"), (5400.0, 60.0, "min"), (172_800.0, 3600.0, "h")):
        if seconds < limit:
            return f"{seconds / unit:.3g} {name}"
    return f"{seconds / 86_400.0:.3g} days"
