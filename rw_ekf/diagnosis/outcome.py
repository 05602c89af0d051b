"""What a diagnosis comes to: its document, and the arrays its pictures are drawn from."""

from __future__ import annotations

from copy import deepcopy
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from rw_ekf.arrays import BoolArray, Float64Array

if TYPE_CHECKING:
    from rw_ekf.logs.wheel_log import WheelLog
    from rw_ekf.wheel.model_file import WheelModel


@dataclass(eq=False, frozen=True)
class ModelTrace:
    """One model, its parameters frozen at what the fit part gave, run over the whole record; arrays (n,).

    NaN where a number does not exist (a missing speed, the first sample of a stretch).
    """

    one_step_error_rad_s: Float64Array  # reading minus the filter's prediction
    free_run_rad_s: Float64Array  # each stretch of the split simulated from its first speed
    residual_acceleration_rad_s2: (
        Float64Array  # what the smoothed speed requires beyond the model; a wheel's torque / J
    )
    normalised_innovation: Float64Array  # one-step error over its standard deviation


@dataclass(eq=False, frozen=True, repr=False)
class Outcome:
    """What was found in one log, as pages and pictures are made of it."""

    log: WheelLog
    content: dict[str, Any]  # of its document
    heldout: BoolArray  # (n,) samples that no parameter of the figures was fitted to; the search saw them
    before: ModelTrace | None = None  # None: the base model itself could not be judged
    after: ModelTrace | None = None  # None: nothing was added
    temperature_degC: Float64Array | None = None  # (n,) as the search used it
    angle_rad: Float64Array | None = None  # (n,) logged, or integrated where that is meaningful
    angle_is_logged: bool = False
    model: WheelModel | None = None  # what augmented-model.yaml holds
    inertia_kg_m2: float | None = None  # None: not known, or a plant that is no wheel
    inertia_from: str = ""  # "configuration", "model" or "assumed": what stands behind every torque
    in_rpm: bool = True  # speeds are reported in rpm; False: in rad/s, or m/s of a plant that moves along a line

    def document(self) -> dict[str, Any]:
        """The document of `diagnose --json` (docs/contract.md#diagnosis)."""
        return deepcopy(self.content)
