"""What `diagnose --out DIR` leaves: the document, the pictures, the page that holds them, the better model.

The page is filled with rows, sentences and pictures here; what it looks like is its template's.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rw_ekf.diagnosis.report.cause_curve import cause_curves
from rw_ekf.diagnosis.report.curves import curves_picture, shape_curves
from rw_ekf.diagnosis.report.drawn_time import timeline
from rw_ekf.diagnosis.report.next_steps import commands, excitation_of, next_steps
from rw_ekf.diagnosis.report.picture_files import remove, write_pictures
from rw_ekf.diagnosis.report.residual_panels import residual_picture, residual_view
from rw_ekf.diagnosis.report.rows import (
    added_parameters,
    candidate_rows,
    evidence_scale,
    friction_rows,
    hypothesis_rows,
)
from rw_ekf.diagnosis.report.speed_picture import speed_course, speed_picture
from rw_ekf.diagnosis.report.template_engine import rendered
from rw_ekf.diagnosis.report.words import Units, figure_pairs, headline_of, verdict_of
from rw_ekf.diagnosis.thresholds import INDISTINGUISHABLE
from rw_ekf.documents import inertia_text
from rw_ekf.errors import BadInputError
from rw_ekf.json_output import json_text
from rw_ekf.logs.atomic import make_folder, write_text
from rw_ekf.logs.run_directory import DIAGNOSED_MODEL
from rw_ekf.numbers import number_text

if TYPE_CHECKING:
    from rw_ekf.diagnosis.outcome import Outcome

DOCUMENT, PAGE = "diagnosis.json", "report.html"
_PAGES = (".html", ".htm", ".pdf")  # what one file would be called
_EARLIER = "evidence.png"  # as the evidence was drawn before: of an earlier run, and so removed


def evidence_picture(document: Mapping[str, Any]) -> bytes | None:
    """A bar for every candidate that was tested, those that were not below; None without candidates."""
    rows = candidate_rows(document)
    if not rows:
        return None
    ticks = evidence_scale(document["candidates"]).ticks()
    return rendered("evidence.svg", {"rows": rows, "ticks": ticks}).encode()


def page(
    diagnosis: Outcome, pictures: Mapping[str, bytes], model: Path, units: Units, options: Sequence[str] = ()
) -> str:
    """The whole HTML document.

    pictures: name of the file -> content; model: where the better one is written; options: that the log was read with.
    """
    document, log = diagnosis.document(), diagnosis.log
    kind, name, statement = verdict_of(document)
    headline = headline_of(document, units)
    start_s = float(log.time_s[0]) if len(log) else 0.0
    rate_hz = document.get("rate_hz")
    inertia = diagnosis.inertia_kg_m2
    candidates = candidate_rows(document, start_s)
    values = {
        "kind": kind,
        "verdict": name,
        "headline": headline or statement,
        "statement": statement if headline != statement else "",
        "title": f"{name}: {Path(log.name).name}",
        "facts": [
            log.name,
            f"{document.get('samples', len(log))} samples",
            *([] if rate_hz is None else [f"{number_text(rate_hz)} Hz"]),
            f"{log.duration_s:.6g} s",
        ],
        "pictures": pictures,
        "units": units,
        "judged": diagnosis.before is not None,
        "compared": diagnosis.after is not None,
        "inertia": "" if inertia is None else inertia_text(inertia, diagnosis.inertia_from),
        "shapes": list(document.get("shapes") or ()),
        "steps": next_steps(document),
        "excitation": excitation_of(document),
        "commands": [] if diagnosis.model is None else commands(model, log.name, options),
        "figures": figure_pairs(document, units),
        "candidates": candidates,
        "hypotheses": hypothesis_rows(document),
        "alike": number_text(INDISTINGUISHABLE),
        "parameters": added_parameters(candidates),
        "friction": friction_rows(document),
        "split": document.get("split"),
        "start_s": start_s,
        "warnings": list(dict.fromkeys(str(text) for text in (*log.warnings, *(document.get("warnings") or ())))),
    }
    return rendered("report.html", values)


def refuse_name_of_page(directory: Path) -> None:
    """Raise BadInputError for a name such as x.html: what is written is a folder, and a page in it."""
    if directory.suffix.lower() in _PAGES and not directory.is_dir():
        raise BadInputError(
            f"{directory}: a report is a folder, with its page in it as {PAGE}: give the name of a folder, such as "
            f"{directory.with_suffix('')}"
        )


def write_report(directory: Path, diagnosis: Outcome, options: Sequence[str] = ()) -> list[Path]:
    """Write everything into `directory`, each file whole or not at all, pictures last; returns what was written.

    options: of the command line with which the log was read, for the commands that the page shows.
    What an earlier run left there and this one does not have (a model, a picture) is removed.
    Raises BadInputError if the place cannot be written or is named like a page, PictureError, after all else is, for
    pictures that cannot be drawn.
    """
    units, document = Units(diagnosis.in_rpm, diagnosis.inertia_kg_m2), diagnosis.document()
    refuse_name_of_page(directory)
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
