"""A diagnosis for the terminal: the verdict first, then the figures, then what else was looked at."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from rw_ekf.console import shown_path
from rw_ekf.diagnosis.report.rows import CandidateRow, candidate_rows
from rw_ekf.diagnosis.report.words import Units, figure_pairs, untestable_reasons, verdict_of

_OTHERS = 5


def diagnosis_text(
    document: Mapping[str, Any], *, directory: Path | None = None, wheel_units: bool = True, inertia: str = ""
) -> str:
    """Return the diagnosis as lines for a person; nothing but names from outside is beyond ASCII.

    directory: where the report was written, None if nowhere. wheel_units: rpm, otherwise plain SI. inertia: what stands
    behind every torque, in words.
    """
    _, name, statement = verdict_of(document)
    rows = candidate_rows(document)
    lines = [f"{document.get('log')}: {name.lower()}", f"  {statement}"]
    lines += _ascii(
        [
            *_figures(document, Units(wheel_units, None), inertia),
            *_effects(rows),
            *_left(document),
            *_explanations(document),
            *_candidates(document, rows),
        ]
    )
    lines += [f"  warning: {text}" for text in document.get("warnings") or ()]
    if directory is not None:
        lines.append(f"  report: {shown_path(directory / 'report.html')}")
        if document.get("model"):
            model = shown_path(directory / str(document["model"]))
            lines.append(f"  model:  {model}  (replay, run and diagnose take it: --model)")
    return "\n".join(lines)


def _figures(document: Mapping[str, Any], units: Units, inertia: str) -> list[str]:
    """Before -> after, in right-aligned columns."""
    pairs = figure_pairs(document, units)
    if not pairs:
        return []
    both = any(pair.added for pair in pairs)
    befores, afters = zip(*(pair.texts for pair in pairs), strict=True)
    wide = max(len(pair.label) for pair in pairs)
    wide_before, wide_after = max(map(len, befores)), max(map(len, afters))
    lines = ["", "  on the held-out part" + (", before -> after" if both else "")]
    for pair, before, after in zip(pairs, befores, afters, strict=True):
        line = f"    {pair.label:<{wide}}  {before:>{wide_before}}"
        if both:
            line += f" -> {after:>{wide_after}}"
        line += f" {pair.unit}" if pair.unit else "  (1 is ideal)" if pair.key == "nis_mean" else ""
        if both and pair.change_percent is not None:
            line += f"  ({pair.change_text})"
        if pair.unit == "mNm" and inertia:
            line += f"  [{inertia}]"
        lines.append(line)
    return lines


def _effects(rows: Sequence[CandidateRow]) -> list[str]:
    lines = []
    for row in rows:
        if row.standing == "added":
            texts = [f"{parameter.name} {parameter.text}" for parameter in row.parameters]
            lines.append(f"    {row.effect}: {', '.join(texts) or 'no parameters'}")
    return ["", "  added", *lines] if lines else []


def _left(document: Mapping[str, Any]) -> list[str]:
    """What the catalogue does not explain, in words, and which record would show more."""
    shapes = list(document.get("shapes") or ())
    if not shapes:
        return []
    lines = [f"    against {shape['dependence']}: {shape['sentence']}" for shape in shapes]
    return ["", "  left over", *lines, f"    what would tell more: {shapes[0]['record']}"]


def _explanations(document: Mapping[str, Any]) -> list[str]:
    """What stands, with its probability, where more than one explanation does."""
    entries = list(document.get("explanations") or ())
    if len(entries) < 2:
        return []
    lines = [f"{'+'.join(entry['effects']) or 'none'} {entry['posterior']:.2g}" for entry in entries]
    other = document["verdict"]["posterior"].get("something_else", 0.0)
    head = "explanations that stand, with their probability"
    if other >= 0.5:
        head = f"something else {other:.2g}; what was weighed, held against each other alone"
    return ["", f"  {head}: {', '.join(lines)}"]


def _candidates(document: Mapping[str, Any], rows: Sequence[CandidateRow]) -> list[str]:
    """The strongest of those that were not added, and in one line what could not be tested."""
    others = [row for row in rows if row.standing not in {"added", "untestable"}]
    lines = []
    if others:
        wide = max(len(row.effect) for row in others[:_OTHERS])
        lines = [
            "",
            "  other candidates" + (f", the first {_OTHERS} of {len(others)}" if len(others) > _OTHERS else ""),
        ]
        lines += [
            f"    {row.effect:<{wide}}  {row.statistic:>6}  p {row.p_value:<7}  error {row.gain:>7}  {row.decision}"
            for row in others[:_OTHERS]
        ]
    reasons = untestable_reasons(document.get("candidates") or ())
    if reasons:
        texts = [f"{', '.join(effects)} ({reason})" for reason, effects in reasons.items()]
        lines.append(f"  not testable: {'; '.join(texts)}")
    return [*lines, ""] if lines else [""]


def _ascii(lines: list[str]) -> list[str]:
    """Signs of the report as a terminal is sure to know them."""
    signs = str.maketrans({"−": "-", "–": "-", "²": "^2"})
    return [line.translate(signs) for line in lines]
