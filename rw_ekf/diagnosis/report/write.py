"""What `diagnose --out DIR` leaves: the document, the pictures, the page that holds them, the better model."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from rw_ekf.diagnosis.report.cause import cause_curves
from rw_ekf.diagnosis.report.curves import curves_picture, shape_curves
from rw_ekf.diagnosis.report.drawn import remove, write_pictures
from rw_ekf.diagnosis.report.drawn_time import timeline
from rw_ekf.diagnosis.report.evidence_bars import evidence_picture
from rw_ekf.diagnosis.report.page import page
from rw_ekf.diagnosis.report.residual_panels import residual_picture, residual_view
from rw_ekf.diagnosis.report.speed import speed_course, speed_picture
from rw_ekf.diagnosis.report.words import Units
from rw_ekf.json_output import json_text
from rw_ekf.logs.atomic import make_folder, write_text
from rw_ekf.logs.run_directory import DIAGNOSED_MODEL

if TYPE_CHECKING:
    from rw_ekf.diagnosis.result import Diagnosis

DOCUMENT, PAGE = "diagnosis.json", "report.html"
_EARLIER = "evidence.png"  # as the evidence was drawn before: of an earlier run, and so removed


def write_report(
    directory: Path,
    diagnosis: Diagnosis,
    *,
    inertia_kg_m2: float | None,
    wheel_units: bool,
    options: Sequence[str] = (),
) -> list[Path]:
    """Write everything into `directory`, each file whole or not at all, pictures last; returns what was written.

    inertia_kg_m2: turns residuals into mNm; None: they stay accelerations. wheel_units: rpm and mA, otherwise plain SI.
    options: of the command line with which the log was read, for the commands that the page shows.
    What an earlier run left there and this one does not have (a model, a picture) is removed.
    Raises BadInputError if the place cannot be written, PictureError, after all else is, for pictures that cannot be
    drawn.
    """
    units, document = Units(wheel_units, inertia_kg_m2), diagnosis.document()
    make_folder(directory)
    written = [directory / DOCUMENT]
    write_text(written[0], json_text(document))
    model = directory / DIAGNOSED_MODEL
    if diagnosis.model is not None:
        write_text(model, diagnosis.model.to_text())
        written.append(model)
    else:
        remove(model)
    shapes, named = document.get("shapes") or (), (document.get("verdict") or {}).get("kind") == "effect"
    pictures, failed = write_pictures(
        directory,
        {
            "shapes.png": lambda: curves_picture(shape_curves(shapes, timeline(diagnosis.log.time_s)), left_over=named),
            "cause.png": lambda: curves_picture(cause_curves(diagnosis, units)),
            "speed.png": lambda: speed_picture(speed_course(diagnosis, units)),
            "residual.png": lambda: residual_picture(residual_view(diagnosis, units)),
            "evidence.svg": lambda: evidence_picture(document),
            _EARLIER: lambda: None,
        },
    )
    # The page comes last: where it stands, what it speaks of stands too.
    write_text(directory / PAGE, page(diagnosis, pictures, model, units, options))
    if failed is not None:
        raise failed
    return [*written, *(directory / name for name in pictures), directory / PAGE]
