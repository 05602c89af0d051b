"""A diagnosis for the terminal: the verdict first, then the figures, then what else was looked at."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from rw_ekf.console import shown_path
from rw_ekf.diagnosis.report.words import (
    Units,
    figure_pairs,
    gain_text,
    p_value_text,
    parameter_text,
    percent_text,
    ranked,
    statistic_text,
    untestable_reasons,
    verdict_of,
)
from rw_ekf.diagnosis.standing import standing_of
from rw_ekf.numbers import number_text

_OTHERS = 5


def diagnosis_text(
    document: Mapping[str, Any], *, directory: Path | None = None, wheel_units: bool = True, inertia: str = ""
) -> str:
    """Return the diagnosis as lines for a person; nothing but names from outside is beyond ASCII.

    directory: where the report was written, None if nowhere. wheel_units: rpm, otherwise plain SI. inertia: what stands
    behind every torque, in words.
    """
    _, name, statement = verdict_of(document)
    lines = [f"{document.get('log')}: {name.lower()}", f"  {statement}"]
    lines += _ascii(
        [
            *_figures(document, Units(wheel_units, None), inertia),
            *_effects(document),
            *_left(document),
            *_explanations(document),
            *_candidates(document),
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
    both = any(pair.after is not None and pair.after != pair.before for pair in pairs)
    befores, afters = [number_text(p.before) for p in pairs], [number_text(p.after) for p in pairs]
    wide = max(len(pair.label) for pair in pairs)
    wide_before, wide_after = max(map(len, befores)), max(map(len, afters))
    lines = ["", "  on the held-out part" + (", before -> after" if both else "")]
    for pair, before, after in zip(pairs, befores, afters, strict=True):
        line = f"    {pair.label:<{wide}}  {before:>{wide_before}}"
        if both:
            line += f" -> {after:>{wide_after}}"
        line += f" {pair.unit}" if pair.unit else "  (1 is ideal)" if pair.key == "nis_mean" else ""
        if both and pair.change_percent is not None:
            line += f"  ({percent_text(pair.change_percent)})"
        if pair.unit == "mNm" and inertia:
            line += f"  [{inertia}]"
        lines.append(line)
    return lines


def _effects(document: Mapping[str, Any]) -> list[str]:
    lines = []
    for candidate in document.get("candidates") or ():
        if standing_of(candidate) == "added":
            parameters = candidate.get("parameters") or {}
            texts = [f"{name} {parameter_text(parameter)}" for name, parameter in parameters.items()]
            lines.append(f"    {candidate['effect']}: {', '.join(texts) or 'no parameters'}")
    return ["", "  added", *lines] if lines else []


def _left(document: Mapping[str, Any]) -> list[str]:
    """What the catalogue does not explain, in words, and which record would tell more."""
    shapes = list(document.get("shapes") or ())
    if not shapes:
        return []
    said = [f"    against {shape['dependence']}: {shape['sentence']}" for shape in shapes]
    return ["", "  left over", *said, f"    what would tell more: {shapes[0]['record']}"]


def _explanations(document: Mapping[str, Any]) -> list[str]:
    """What stands, with its probability, where more than one explanation does."""
    entries = list(document.get("explanations") or ())
    if len(entries) < 2:
        return []
    said = [f"{'+'.join(entry['effects']) or 'none'} {entry['posterior']:.2g}" for entry in entries]
    return ["", f"  explanations that stand, with their probability: {', '.join(said)}"]


def _candidates(document: Mapping[str, Any]) -> list[str]:
    """The strongest of those that were not added, and in one line what could not be tested."""
    candidates = list(document.get("candidates") or ())
    others = [candidate for candidate in ranked(candidates) if standing_of(candidate) != "added"]
    lines = []
    if others:
        wide = max(len(str(candidate.get("effect"))) for candidate in others[:_OTHERS])
        lines = [
            "",
            "  other candidates" + (f", the first {_OTHERS} of {len(others)}" if len(others) > _OTHERS else ""),
        ]
        for candidate in others[:_OTHERS]:
            gain = gain_text(candidate)
            lines.append(
                f"    {candidate.get('effect'):<{wide}}  {statistic_text(candidate.get('statistic')):>6}"
                f"  p {p_value_text(candidate.get('p_value')):<7}  error {gain:>7}"
                f"  {candidate.get('decision')}"
            )
    reasons = untestable_reasons(candidates)
    if reasons:
        texts = [f"{', '.join(effects)} ({reason})" for reason, effects in reasons.items()]
        lines.append(f"  not testable: {'; '.join(texts)}")
    return [*lines, ""] if lines else [""]


def _ascii(lines: list[str]) -> list[str]:
    """Signs of the report as a terminal is sure to know them."""
    signs = str.maketrans({"−": "-", "–": "-", "²": "^2"})
    return [line.translate(signs) for line in lines]
