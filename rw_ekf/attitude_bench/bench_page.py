"""What `bench --out DIR` leaves: the document, the pictures, and one page that holds them."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from rw_ekf.attitude_bench.bench_pictures import courses_picture, peaks_picture
from rw_ekf.attitude_bench.contest import Contest
from rw_ekf.attitude_bench.contest_result import BASELINE, LEGEND, Row, Table, rows_of, tables_of
from rw_ekf.attitude_bench.metrics import RECOVERED_DEG
from rw_ekf.control.compensation.schemes import SCHEMES
from rw_ekf.diagnosis.report.picture_files import write_pictures
from rw_ekf.diagnosis.report.template_engine import rendered
from rw_ekf.json_output import json_text
from rw_ekf.logs.atomic import make_folder, write_text

DOCUMENT, PAGE = "bench.json", "bench.html"
_PEAKS = "peaks.png"
_TEMPLATES = Path(__file__).parent / "templates"


def write_page(
    directory: Path, contest: Contest, document: Mapping[str, Any], headline: str, further: Sequence[Table] = ()
) -> list[Path]:
    """Write everything into `directory`; returns what was written.

    Raises BadInputError if it cannot be made, PictureError, after all else is, for pictures that cannot be drawn.
    further: tables that stand below those of the reversal.
    """
    make_folder(directory)
    rows = rows_of(contest)
    noises = contest.scenario.cycle.speed_noise_rpm
    write_text(directory / DOCUMENT, json_text(document))
    courses = {_course_name(noise_rpm): partial(courses_picture, contest, noise_rpm) for noise_rpm in noises}
    pictures, failed = write_pictures(directory, {_PEAKS: lambda: peaks_picture(rows, noises), **courses})
    write_text(directory / PAGE, page_text(contest, rows, pictures, headline, further))
    if failed is not None:
        raise failed
    return [directory / name for name in (DOCUMENT, *pictures, PAGE)]


def _course_name(noise_rpm: float) -> str:
    return f"attitude-{noise_rpm:g}rpm.png"


def headline_of(rows: Sequence[Row]) -> str:
    """One sentence: what a reversal costs without compensation, and with the best one."""
    noise_rpm = rows[0].noise_rpm
    here = {row.scheme: row for row in rows if row.noise_rpm == noise_rpm and math.isfinite(row.peak_deg)}
    # A loop in the wheel's own electronics is other hardware.
    others = [row for row in here.values() if row.scheme != BASELINE and SCHEMES[row.scheme].inner_rate_hz is None]
    if all(row.scheme != BASELINE for row in rows):
        return _without_baseline(others or list(here.values()), noise_rpm)
    if BASELINE not in here:
        return "No wheel reversed under the plain controller: there is nothing to compare with."
    base = here[BASELINE]
    if not others:
        return f"A reversal throws the attitude off by {base.peak_deg:.2f} deg."
    best = min(others, key=lambda row: row.peak_deg)
    return (
        f"A reversal throws the attitude off by {base.peak_deg:.2g} deg; with {best.scheme} by {best.peak_deg:.2g} "
        f"deg, {base.peak_deg / best.peak_deg:.0f} times less, at {noise_rpm:g} rpm of speed noise."
    )


def _without_baseline(reversed_in: Sequence[Row], noise_rpm: float) -> str:
    """The sentence where the plain controller was not asked for. reversed_in: rows that have a peak."""
    if not reversed_in:
        return f"No wheel reversed, and {BASELINE} was not among the schemes: there is nothing to compare."
    best = min(reversed_in, key=lambda row: row.peak_deg)
    return (
        f"A reversal throws the attitude off by {best.peak_deg:.2g} deg with {best.scheme}, at {noise_rpm:g} rpm of "
        f"speed noise; {BASELINE} was not among the schemes, so there is no ratio to it."
    )


def page_text(
    contest: Contest, rows: Sequence[Row], pictures: Mapping[str, bytes], headline: str, further: Sequence[Table]
) -> str:
    """The whole HTML document."""
    scenario = contest.scenario
    facts = [
        f"body {scenario.body.inertia_kg_m2:g} kg m²",
        f"disturbance {1e3 * scenario.body.disturbance_Nm:g} mNm",
        f"{scenario.cycle.rate_hz:g} Hz",
        f"{contest.seeds} seed{'s' if contest.seeds > 1 else ''}",
    ]
    if scenario.wheel.effects:
        facts.append("wheel with " + ", ".join(scenario.wheel.effects))
    tables = zip(scenario.cycle.speed_noise_rpm, tables_of(rows, scenario), strict=True)
    values = {
        "facts": facts,
        "headline": headline,
        "pictures": pictures,
        "reversals": [(table, _course_name(noise_rpm)) for noise_rpm, table in tables],
        "further": further,
        "legend": LEGEND,
        "recovered_deg": RECOVERED_DEG,
    }
    return rendered("bench.html", values, _TEMPLATES)
