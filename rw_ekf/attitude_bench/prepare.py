"""What a contest is about, from what was asked for: which schemes, which wheel, and what `diagnose` makes of it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from rw_ekf.attitude_bench.of_model import with_wheel_of
from rw_ekf.attitude_bench.scenario import Scenario, load_scenario
from rw_ekf.control.compensation.schemes import SCHEMES
from rw_ekf.errors import BadInputError
from rw_ekf.wheel.model_file import WheelModel

if TYPE_CHECKING:
    from rw_ekf.drivers.sim.plant_parameters import PlantParameters


# One of each kind, and what is recommended: about a minute of processor time, where all of them take two.
REPRESENTATIVE = (
    "pid_current", "speed_mode", "dmc", "predictive_crossing", "predictive_diagnosed", "pistiner_offset",
    "dither_triangular", "adrc", "sliding_mode", "pi_drag", "mrac", "ekbf",
)  # fmt: skip


def schemes_of(wanted: Sequence[str] | None) -> list[str]:
    """The ids of the schemes, in the registry's order; None: the representative ones, "all": all.

    Raises BadInputError that lists what there is.
    """
    if wanted == ["all"]:
        return list(SCHEMES)
    wanted = REPRESENTATIVE if wanted is None else wanted
    for name in wanted:
        if name not in SCHEMES:
            raise BadInputError(f"--schemes {name}: there is no such scheme; there are {', '.join(SCHEMES)}")
    return [name for name in SCHEMES if name in wanted]


def scenario_of(path: str | Path | None, model: WheelModel | None, effects: Sequence[str]) -> Scenario:
    """The scenario, with the wheel of a model where one is given, and the effects added to it.

    Raises ConfigError for a file that is wrong, BadInputError for an effect that is, or a wheel that never reverses.
    """
    from rw_ekf.attitude_bench.wheels import drawn_wheel

    scenario = Scenario() if path is None else load_scenario(str(path))
    if model is not None:
        scenario = with_wheel_of(scenario, model)
    if effects:
        scenario = scenario.changed("wheel", effects=(*scenario.wheel.effects, *effects))
    _: PlantParameters = drawn_wheel(scenario, 1)  # an effect that cannot be is found here, before any run
    reversal_s = scenario.reversal_s
    if reversal_s is None:
        raise BadInputError(
            "the wheel never reverses in this scenario: wheel.start_rpm and body.disturbance_Nm must have opposite "
            "signs, so that the disturbance drives the wheel through zero"
        )
    if reversal_s >= scenario.cycle.duration_s:
        raise BadInputError(
            f"the wheel would reverse after {reversal_s:.0f} s, but cycle.duration_s is {scenario.cycle.duration_s:g} "
            "s: make the run longer, or start the wheel slower (wheel.start_rpm)"
        )
    return scenario
