"""What `diagnose` returns."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rw_ekf.checking.paths import path_of
from rw_ekf.diagnosis.outcome import Outcome
from rw_ekf.diagnosis.report.speed_picture import speed_course, speed_figure
from rw_ekf.diagnosis.report.text import diagnosis_text
from rw_ekf.diagnosis.report.words import Units
from rw_ekf.documents import inertia_text
from rw_ekf.logs.tables import table_of
from rw_ekf.result_display import Shown

if TYPE_CHECKING:
    import pyarrow as pa
    from matplotlib.figure import Figure

    from rw_ekf.diagnosis.report.curves import Curve


class Diagnosis(Outcome, Shown):
    """The outcome of `diagnose` for one log, with all that is reported of it."""

    def text(self, directory: Path | None = None) -> str:
        """What `diagnose` prints; directory: where the report was written."""
        behind = "" if self.inertia_kg_m2 is None else inertia_text(self.inertia_kg_m2, self.inertia_from)
        return diagnosis_text(self.content, directory=directory, wheel_units=self.in_rpm, inertia=behind)

    def report(self, directory: str | Path, options: Sequence[str] = ()) -> list[Path]:
        """Write what `diagnose --out` leaves; returns the files. options: see `write_report`, as what is raised."""
        from rw_ekf.diagnosis.report.diagnosis_page import write_report
        from rw_ekf.effects.catalogue import with_own

        with with_own(() if self.model is None else self.model.own_effects):
            return write_report(path_of(directory, "a folder"), self, options)

    @property
    def verdict(self) -> dict[str, Any]:
        """Kind, effects, probabilities and the sentence."""
        found: dict[str, Any] = self.document()["verdict"]
        return found

    @property
    def candidates(self) -> list[dict[str, Any]]:
        """What was tried, strongest first, as the document has it; empty where the excitation is insufficient."""
        found: list[dict[str, Any]] = self.document()["candidates"]
        return found

    @property
    def probabilities(self) -> dict[str, float]:
        """How probable each effect is, by id, `none` and `something_else` too; empty where nothing was weighed."""
        return dict(self.verdict["posterior"] or {})

    @property
    def curves(self) -> list[Curve]:
        """What `cause.png` draws: of each named cause its law among the measured points, in the units of its labels."""
        from rw_ekf.diagnosis.report.cause_curve import cause_curves
        from rw_ekf.effects.catalogue import with_own

        with with_own(() if self.model is None else self.model.own_effects):
            return cause_curves(self, Units(self.in_rpm, self.inertia_kg_m2))

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
        return speed_figure(speed_course(self, Units(self.in_rpm, self.inertia_kg_m2)))

    def __repr__(self) -> str:
        return f"Diagnosis({self.log.name!r}, {self.verdict['statement']!r})"
