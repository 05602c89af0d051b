"""What a diagnosis leaves: its document, and the arrays its pictures are drawn from."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rw_ekf.arrays import BoolArray, Float64Array
from rw_ekf.logs.tables import table_of
from rw_ekf.shown import Shown

if TYPE_CHECKING:
    import pyarrow as pa
    from matplotlib.figure import Figure

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
        Float64Array  # what the smoothed speed asks for beyond the model; a wheel's torque / J
    )
    normalised_innovation: Float64Array  # one-step error over its standard deviation


@dataclass(eq=False, frozen=True, repr=False)
class Diagnosis(Shown):
    """The outcome of `diagnose` for one log."""

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
    in_rpm: bool = True  # speeds are told in rpm; False: in rad/s, or m/s of a plant that moves along a line

    def document(self) -> dict[str, Any]:
        """The document of `diagnose --json` (docs/contract.md#diagnosis)."""
        return self.content

    def text(self, directory: Path | None = None) -> str:
        """What `diagnose` prints; directory: where the report was written."""
        from rw_ekf.diagnosis.report.text import diagnosis_text
        from rw_ekf.documents import inertia_text

        behind = "" if self.inertia_kg_m2 is None else inertia_text(self.inertia_kg_m2, self.inertia_from)
        return diagnosis_text(self.content, directory=directory, wheel_units=self.in_rpm, inertia=behind)

    def report(self, directory: str | Path, options: Sequence[str] = ()) -> list[Path]:
        """Write what `diagnose --out` leaves; returns the files. options: see `write_report`, as what is raised."""
        from rw_ekf.diagnosis.report.write import write_report
        from rw_ekf.effects.catalogue import with_own

        with with_own(() if self.model is None else self.model.own_effects):
            return write_report(
                Path(directory), self, inertia_kg_m2=self.inertia_kg_m2, wheel_units=self.in_rpm, options=options
            )

    @property
    def verdict(self) -> dict[str, Any]:
        """Kind, effects, probabilities and the sentence."""
        found: dict[str, Any] = self.content["verdict"]
        return found

    @property
    def table(self) -> pa.Table:
        """A row per sample: what was measured, and what the models before and after make of it."""
        columns: dict[str, Any] = {"time_s": self.log.time_s, "speed_rad_s": self.log.speed_rad_s}
        columns["heldout"] = self.heldout
        for name, trace in (("before", self.before), ("after", self.after)):
            if trace is not None:
                columns |= {f"{key}_{name}": values for key, values in vars(trace).items()}
        return table_of(columns)

    def plot(self) -> Figure:
        """Speed, measured and simulated before and after, as a matplotlib figure."""
        from rw_ekf.diagnosis.report.speed import speed_course, speed_figure
        from rw_ekf.diagnosis.report.words import Units

        return speed_figure(speed_course(self, Units(self.in_rpm, self.inertia_kg_m2)))

    def __repr__(self) -> str:
        return f"Diagnosis({self.log.name!r}, {self.verdict['statement']!r})"
