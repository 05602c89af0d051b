"""The evidence for every effect as a picture: the rows of the page's table, with their bars, as SVG."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from rw_ekf.diagnosis.report.rendering import rendered
from rw_ekf.diagnosis.report.rows import candidate_rows, evidence_scale


def evidence_picture(document: Mapping[str, Any]) -> bytes | None:
    """A bar for every candidate that was tested, those that were not below; None without candidates."""
    rows = candidate_rows(document)
    if not rows:
        return None
    ticks = evidence_scale(document["candidates"]).ticks()
    return rendered("evidence.svg", {"rows": rows, "ticks": ticks}).encode()
