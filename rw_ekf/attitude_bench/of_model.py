"""A scenario with the wheel of a model file: its parameters are the truth, its effects the simulated wheel's."""

from __future__ import annotations

from typing import Any

from pydantic import ValidationError

from rw_ekf.attitude_bench.scenario import Scenario
from rw_ekf.errors import BadInputError
from rw_ekf.model.friction import LAW_NAMES
from rw_ekf.units import rpm_from_rad_s
from rw_ekf.wheel.model_file import WheelModel

_SPIKE_BEFORE_REVERSAL_S = 20.0
# Constants of an estimator's effect that say where in its record it was, which a simulated wheel does not have.
_OF_THE_RECORD = {"start_s", "piece_s", "reference_s"}


def with_wheel_of(scenario: Scenario, model: WheelModel) -> Scenario:
    """The scenario with the model's wheel on it. Raises BadInputError where a simulated wheel cannot be that."""
    parameters = model.parameters
    wheel: dict[str, Any] = {
        "motor_gain": parameters.motor_gain,
        "viscous": parameters.viscous,
        "coulomb": parameters.coulomb,
        "static": max(parameters.static, parameters.coulomb),
        "stribeck_speed_rpm": rpm_from_rad_s(model.stribeck_speed_rad_s),
        "effects": [_text(scenario, entry) for entry in model.document()["effects"]],
    }
    if model.inertia_kg_m2 is not None:
        wheel["inertia_kg_m2"] = model.inertia_kg_m2
    if model.stribeck_law != LAW_NAMES[0]:
        wheel["effects"].append(f"stribeck_shape:speed_rad_s={model.stribeck_speed_rad_s:.9g},law={model.stribeck_law}")
    data = scenario.model_dump()
    try:
        return Scenario.model_validate(data | {"wheel": data["wheel"] | wheel})
    except ValidationError as error:
        first = error.errors()[0]
        key = ".".join(map(str, first["loc"]))
        raise BadInputError(f"the bench has no wheel like this model's: {key}: {first['msg']}") from None


def _text(scenario: Scenario, entry: dict[str, Any]) -> str:
    """One effect of a model file as the simulated wheel takes it: "ID:name=value,..."."""
    named = {entry["coefficient"]["name"]: entry["coefficient"]["value"]}
    named |= {name: value for name, value in entry["constants"].items() if name not in _OF_THE_RECORD}
    if "onset_s" in named:
        reversal_s = scenario.reversal_s
        at_s = 0.0 if reversal_s is None else reversal_s - _SPIKE_BEFORE_REVERSAL_S
        named["onset_s"] = scenario.control.settling_s + max(at_s, 0.0)
    if "law" in named:
        named["law"] = LAW_NAMES[round(named["law"])]
    written = ",".join(
        f"{name}={value}" if isinstance(value, str) else f"{name}={value:.9g}" for name, value in named.items()
    )
    return f"{entry['effect']}:{written}"
