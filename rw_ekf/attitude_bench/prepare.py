"""What a contest is about, from what was requested: which schemes, which wheel, and what `diagnose` makes of it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pydantic import ValidationError

from rw_ekf.attitude_bench.metrics import WINDOW_S
from rw_ekf.attitude_bench.scenario import Scenario, load_scenario
from rw_ekf.checking.choices import names_of
from rw_ekf.checking.paths import path_of
from rw_ekf.control.compensation.schemes import SCHEMES
from rw_ekf.errors import BadInputError
from rw_ekf.model.effect import Term
from rw_ekf.model.effect_kinds import StribeckEffect
from rw_ekf.model.friction import LAW_NAMES
from rw_ekf.units import rpm_from_rad_s
from rw_ekf.wheel.model_file import WheelModel

if TYPE_CHECKING:
    from rw_ekf.drivers.sim.plant_parameters import PlantParameters

# One of each kind, and what is recommended: about a minute of processor time, where all of them take two.
REPRESENTATIVE = (
    "pid_current", "speed_mode", "dmc", "predictive_crossing", "predictive_diagnosed", "pistiner_offset",
    "dither_triangular", "adrc", "sliding_mode", "pi_drag", "mrac", "ekbf",
)  # fmt: skip
_SPIKE_BEFORE_REVERSAL_S = 20.0
_REVERSES_WITHIN_S = 1.0  # of when it would if the attitude were held to the last bit
_LONGEST_S = 3600.0  # a run that nobody gave a length is made no longer
# Constants of an estimator's effect that say where in its record it was, which a simulated wheel does not have.
_OF_THE_RECORD = {"start_s", "piece_s", "reference_s"}


def with_wheel_of(scenario: Scenario, model: WheelModel) -> Scenario:
    """The scenario with the model's wheel on it. Raises BadInputError where a simulated wheel cannot be that."""
    from rw_ekf.attach.simulated import simulated_plant

    parameters = model.parameters
    wheel: dict[str, Any] = {
        "motor_gain": parameters.motor_gain,
        "viscous": parameters.viscous,
        "coulomb": parameters.coulomb,
        "static": max(parameters.static, parameters.coulomb),
        "stribeck_speed_rpm": rpm_from_rad_s(model.stribeck_speed_rad_s),
    }
    if model.inertia_kg_m2 is not None:
        wheel["inertia_kg_m2"] = model.inertia_kg_m2
    data = scenario.model_dump()
    try:
        wheel["effects"] = _texts(scenario.changed("wheel", **wheel), model)  # which reverses when that wheel does
        simulated_plant(parameters, model.stribeck_speed_rad_s, wheel["effects"])
        return Scenario.model_validate(data | {"wheel": data["wheel"] | wheel})
    except (ValidationError, BadInputError) as error:
        reason: object = error
        if isinstance(error, ValidationError):
            first = error.errors()[0]
            reason = f"{'.'.join(map(str, first['loc']))}: {first['msg']}"
        raise BadInputError(f"the bench has no wheel like this model's: {reason}") from None


def _texts(scenario: Scenario, model: WheelModel) -> list[str]:
    """The effects of a model as the simulated wheel takes them. Raises BadInputError for a law without a formula."""
    nameless = [term.id for term in model.effects.terms if term.law is not None]
    if nameless:
        raise BadInputError(f"a simulated wheel follows formulas, and {nameless[0]} has none: bench a model without it")
    texts = [_text(scenario, term) for term in model.effects.terms]
    if model.stribeck_law != LAW_NAMES[0] and not any(
        issubclass(t.effect, StribeckEffect) for t in model.effects.terms
    ):
        texts.append(f"stribeck_shape:speed_rad_s={model.stribeck_speed_rad_s:.9g},law={model.stribeck_law}")
    return texts


def _text(scenario: Scenario, term: Term) -> str:
    """One effect of a model as the simulated wheel takes it, sine and cosine as one: "ID:name=value,..."."""
    unknown = [[0.0] * len(term.values)] * len(term.values)
    named = {
        name: reported["value"] for name, reported in term.described(unknown).items() if name not in _OF_THE_RECORD
    }
    if "onset_s" in named:
        reversal_s = scenario.reversal_s
        at_s = 0.0 if reversal_s is None else reversal_s - _SPIKE_BEFORE_REVERSAL_S
        named["onset_s"] = scenario.control.settling_s + max(at_s, 0.0)
    written = ",".join(
        f"{name}={value}" if isinstance(value, str) else f"{name}={value:.9g}" for name, value in named.items()
    )
    return f"{term.id}:{written}"


def schemes_of(wanted: Sequence[str] | str | None) -> list[str]:
    """The ids of the schemes, in the registry's order; None: the representative ones, "all": all.

    Raises BadInputError that lists what there is.
    """
    wanted = REPRESENTATIVE if wanted is None else names_of("schemes", wanted)
    if wanted == ["all"]:
        return list(SCHEMES)
    if not wanted:
        raise BadInputError(f"schemes: none is named; there are {', '.join(SCHEMES)}")
    for name in wanted:
        if name not in SCHEMES:
            raise BadInputError(f"schemes: {name!r}: there is no such scheme; there are {', '.join(SCHEMES)}")
    return [name for name in SCHEMES if name in wanted]


def scenario_of(path: str | Path | None, model: WheelModel | None, effects: Sequence[str] | str | None) -> Scenario:
    """The scenario, with the wheel of a model where one is given, and the effects added to it.

    A model's wheel may reverse later: where no file says how long a run is, it then is long enough. Raises ConfigError
    for a file that is wrong, BadInputError for an effect that is, a wheel that never reverses, or a run too short.
    """
    from rw_ekf.attitude_bench.bench_wheels import drawn_wheel

    scenario = Scenario() if path is None else load_scenario(path_of(path, "a scenario"))
    length_given = "duration_s" in scenario.cycle.model_fields_set
    if model is not None:
        scenario = with_wheel_of(scenario, model)
    scenario = scenario.changed("wheel", effects=(*scenario.wheel.effects, *names_of("effects", effects)))
    _: PlantParameters = drawn_wheel(scenario, 1)  # an effect that cannot be is found here, before any run
    reversal_s = scenario.reversal_s
    if reversal_s is None:
        raise BadInputError(
            "the wheel never reverses in this scenario: wheel.start_rpm and body.disturbance_Nm must have opposite "
            "signs, so that the disturbance drives the wheel through zero"
        )
    duration_s, wanted_s = scenario.cycle.duration_s, math.ceil(reversal_s + WINDOW_S)
    if duration_s >= reversal_s + WINDOW_S - _REVERSES_WITHIN_S:
        return scenario
    if not length_given and wanted_s <= _LONGEST_S:
        return scenario.changed("cycle", duration_s=float(wanted_s))
    raise BadInputError(
        f"the wheel would reverse after {reversal_s:.0f} s and is judged for {WINDOW_S:g} s from there on, but "
        f"cycle.duration_s is {duration_s:g} s: give a scenario {wanted_s} s or more of it, or start the wheel slower "
        "(wheel.start_rpm)"
    )
