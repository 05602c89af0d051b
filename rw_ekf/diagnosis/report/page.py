"""What the report's page is filled with: rows, sentences and pictures; what it looks like is its template's."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from rw_ekf.diagnosis.report.rendering import rendered
from rw_ekf.diagnosis.report.rows import added_parameters, candidate_rows, friction_rows, hypothesis_rows
from rw_ekf.diagnosis.report.steps import commands, excitation_of, next_steps
from rw_ekf.diagnosis.report.words import Units, figure_pairs, headline_of, verdict_of
from rw_ekf.diagnosis.thresholds import INDISTINGUISHABLE
from rw_ekf.documents import inertia_text
from rw_ekf.numbers import number_text

if TYPE_CHECKING:
    from rw_ekf.diagnosis.result import Diagnosis


def page(
    diagnosis: Diagnosis, pictures: Mapping[str, bytes], model: Path, units: Units, options: Sequence[str] = ()
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
