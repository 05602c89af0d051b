"""The report's page: verdict and figures first, then the pictures that show it, then tables and what to do."""

from __future__ import annotations

import base64
import html
from collections.abc import Mapping, Sequence
from itertools import combinations
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rw_ekf.diagnosis.report.markup import (
    STYLE,
    base_parameter_table,
    candidate_table,
    commands,
    figure,
    figure_table,
    parameter_table,
    prose,
    residual_caption,
    split_text,
    table,
    tiles,
)
from rw_ekf.diagnosis.report.shapes import shapes_caption
from rw_ekf.diagnosis.report.words import Units, figure_pairs, headline_of, untestable_reasons, verdict_of
from rw_ekf.diagnosis.standing import standing_of
from rw_ekf.documents import inertia_text
from rw_ekf.effects.catalogue import CATALOGUE
from rw_ekf.numbers import chance_text, number_text

if TYPE_CHECKING:
    from rw_ekf.diagnosis.result import Diagnosis


def page(
    diagnosis: Diagnosis,
    pictures: Mapping[str, bytes],
    directory: Path,
    units: Units,
    options: Sequence[str] = (),
) -> str:
    """The whole HTML document.

    pictures: name of the file -> content; directory, options: of the model and log, for commands shown.
    """
    document = diagnosis.document()
    kind, name, statement = verdict_of(document)
    title = f"{name}: {Path(diagnosis.log.name).name}"
    headline = headline_of(document, units)
    parts = [
        _head(diagnosis, kind, name, headline or statement),
        _figures(diagnosis, units),
        _pictures(diagnosis, pictures, units),
        _details(diagnosis, units),
        _next(diagnosis, directory, options),
    ]
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        '<meta name="color-scheme" content="light dark">\n'
        f"<title>{html.escape(title)}</title>\n<style>{STYLE}</style>\n</head>\n<body>\n"
        + "\n".join(part for part in parts if part)
        + "\n</body>\n</html>\n"
    )


def _head(diagnosis: Diagnosis, kind: str, name: str, headline: str) -> str:
    log, document = diagnosis.log, diagnosis.document()
    statement = verdict_of(document)[2]
    said = f'<p class="statement">{prose(statement)}</p>' if statement and statement != headline else ""
    facts = [html.escape(log.name), f"{document.get('samples', len(log))} samples"]
    if document.get("rate_hz") is not None:
        facts.append(f"{number_text(document['rate_hz'])} Hz")
    facts.append(f"{log.duration_s:.6g} s")
    return (
        f'<header><p class="source">Diagnosis of {" · ".join(facts)}</p>'
        f'<span class="badge {html.escape(kind, quote=True)}">{html.escape(name)}</span>'
        f"<h1>{prose(headline)}</h1>{said}</header>"
    )


def _figures(diagnosis: Diagnosis, units: Units) -> str:
    pairs = figure_pairs(diagnosis.document(), units)
    if diagnosis.after is not None:  # those that an effect did not move stand in the table
        pairs = [pair for pair in pairs if pair.moves] or pairs[:1]
    if not pairs:
        return ""
    compared = (
        ' <span class="before">Before</span> → <span class="after">after</span> the effect was added.'
        if diagnosis.after is not None
        else ""
    )
    plant = "" if units.wheel else " SI: rad/s, or m/s of a plant that moves along a line."
    torques = ""
    if diagnosis.inertia_kg_m2 is not None:
        torques = f" Torques: {prose(inertia_text(diagnosis.inertia_kg_m2, diagnosis.inertia_from))}."
    words = (
        "Root-mean-square errors on the held-out part, parameters frozen at what the fit part gave."
        f"{compared}{plant}{torques}"
    )
    return f'<p class="legend">{words}</p>{tiles(pairs)}'


_MEDIA = {"png": "image/png", "svg": "image/svg+xml"}


def _pictures(diagnosis: Diagnosis, pictures: Mapping[str, bytes], units: Units) -> str:
    kind, _, _ = verdict_of(diagnosis.document())
    thresholds = any(c.get("threshold") is not None for c in diagnosis.document().get("candidates") or ())
    parts = []
    for name, heading, alt, caption in (
        (
            "shapes.png",
            "What no effect explains" if kind != "effect" else "What is left over",
            "Fitted curves of what is left, over the quantities that it depends on, each with a band of two sigma.",
            shapes_caption(diagnosis.document()),
        ),
        ("speed.png", *_speed_words(diagnosis)),
        (
            "residual.png",
            "Residual",
            "Binned means of the residual against time, speed, low speed, current, angle and temperature.",
            residual_caption(units, has_after=diagnosis.after is not None, kind=kind),
        ),
        (
            "evidence.svg",
            "Evidence for every effect of the catalogue",
            "Bars of evidence for every candidate effect, each with its probability; the table below has the numbers.",
            "Blue was added to the model. Pale blue looked like the cause, until the effect that was added explained "
            "it, or cannot be told apart from another one. Grey was not needed, or could not be tested."
            + (" The tick on each line is its threshold." if thresholds else ""),
        ),
    ):
        if name in pictures:
            key, suffix = name.split(".")
            source = f"data:{_MEDIA[suffix]};base64,{base64.b64encode(pictures[name]).decode('ascii')}"
            parts.append(f"<h2>{heading}</h2>{figure(key, source, alt, caption)}")
    return "\n".join(parts)


def _speed_words(diagnosis: Diagnosis) -> tuple[str, str, str]:
    if diagnosis.before is None:
        heading, caption = "Speed and current", "Speed as it was read, and the current that was in force."
        return heading, caption, caption
    return (
        "Speed measured and predicted",
        "Speed and free-run error over time.",
        "Each stretch is simulated from its first measured speed with nothing but the current: what the model gets "
        "wrong adds up. Below: what the simulation misses the readings by, its running mean drawn "
        "thick; held-out stretches are shaded.",
    )


def _details(diagnosis: Diagnosis, units: Units) -> str:
    document = diagnosis.document()
    start_s = float(diagnosis.log.time_s[0]) if len(diagnosis.log) else 0.0
    parts = []
    for heading, content in (
        ("Parameters of what was added", parameter_table(document, start_s)),
        ("Parameters of the friction", base_parameter_table(document)),
        ("Figures on the held-out part", figure_table(figure_pairs(document, units))),
        ("Candidates", candidate_table(document, start_s)),
    ):
        if content:
            parts.append(f"<h3>{heading}</h3>{content}")
    if document.get("split"):
        parts.append(f"<h3>Split of the record</h3>{split_text(document, start_s)}")
    warnings = [*diagnosis.log.warnings, *(document.get("warnings") or ())]
    if warnings:
        items = "".join(f"<li>{prose(str(text))}</li>" for text in dict.fromkeys(warnings))
        parts.append(f"<h3>Warnings</h3><ul>{items}</ul>")
    return f"<h2>Numbers</h2>{''.join(parts)}" if parts else ""


def _next(diagnosis: Diagnosis, directory: Path, options: Sequence[str]) -> str:
    steps = "".join(f"<li>{prose(step)}</li>" for step in next_steps(diagnosis.document()))
    found = f"<h2>What to do next</h2><ul>{steps}</ul>"
    excitation = excitation_of(diagnosis.document())
    if excitation:
        rows = [("", [f"<code>{html.escape(name)}</code>", prose(text)]) for name, text in excitation.items()]
        found += f"<h3>What shows it best</h3>{table(('effect', 'excitation'), rows)}"
    if diagnosis.model is not None:
        found += f"<h3>The augmented model</h3>{commands(directory, diagnosis.log.name, options)}"
    return found


_OPEN = 0.05  # probability of an explanation that is worth settling
_FIRST = {
    "adequate": "Nothing needs to be added: the model may go on as it is.",
    "effect": "Run with the augmented model. The effect's coefficient is then estimated online, with a sigma of its "
    "own; diagnosing another log with this model must say adequate, or find the next effect.",
    "unexplained": "No effect of the catalogue explains what is left: log what else changes with it, and record a log "
    "that repeats it.",
    "insufficient_excitation": "Drive the wheel through reversals, low speeds and coast-downs "
    "(`rw-ekf excite identification --config wheel.yaml`), and diagnose that log.",
}

_UNSETTLED = (
    "Something is missing here, and no effect stood every test in this log: record a longer one, slow and fast, both "
    "ways (`rw-ekf excite identification`), and diagnose the two together (`rw-ekf diagnose LOG LOG`)."
)


def next_steps(document: Mapping[str, Any]) -> list[str]:
    """Sentences, most important first; code in backticks. The document's own `advice` goes before everything."""
    verdict = document.get("verdict") or {}
    given = verdict.get("advice") or document.get("advice") or ()
    steps = [given] if isinstance(given, str) else [str(step) for step in given]
    kind = str(verdict.get("kind"))
    open_ones = [item for item in document.get("explanations") or () if item["posterior"] >= _OPEN]
    if kind == "unexplained" and open_ones:
        steps.append(_UNSETTLED)
    elif (
        kind in _FIRST
        and not (kind == "insufficient_excitation" and steps)
        and not (kind == "adequate" and (document.get("torque_noise") or len(open_ones) > 1))
    ):
        steps.append(_FIRST[kind])
    if len(open_ones) > 1:
        steps.append(_settle(open_ones))
    noise = document.get("torque_noise")
    if noise:
        steps.append(
            f"{noise['sentence'][:1].upper()}{noise['sentence'][1:]}. A log that goes slowly through there, both ways, "
            "several times (`rw-ekf excite S1`), with angle and temperature beside it, shows whether it is noise."
        )
    if kind == "unexplained":
        steps += [
            f"On {shape['dependence']} would tell more: {shape['record']}." for shape in document.get("shapes") or ()
        ]
    for group in verdict.get("indistinguishable") or ():
        steps.append(_separation([str(name) for name in group]))
    if kind != "insufficient_excitation":
        for reason, effects in untestable_reasons(document.get("candidates") or ()).items():
            steps.append(f"{_listed(effects)} could not be tested: {reason}.")
    return steps


def _settle(explanations: Sequence[Mapping[str, Any]]) -> str:
    """The experiment that decides between explanations that stand."""
    names = [("+".join(item["effects"]) or "nothing beyond the model", item["posterior"]) for item in explanations]
    listed = ", ".join(f"{name} {chance_text(posterior)}" for name, posterior in names)
    return (
        f"Several explanations stand ({listed}). `rw-ekf excite --settle diagnosis.json --config wheel.yaml` designs "
        "the two minutes that tell them apart, and runs them; `rw-ekf diagnose` of both logs together then decides."
    )


def excitation_of(document: Mapping[str, Any]) -> dict[str, str]:
    """Effect -> what a log must contain to show it better: of what was named or is in doubt."""
    wanted = list((document.get("verdict") or {}).get("effects") or ())
    for group in (document.get("verdict") or {}).get("indistinguishable") or ():
        wanted += group
    wanted += [c.get("effect") for c in document.get("candidates") or () if standing_of(c) == "added"]
    return {str(name): CATALOGUE[name].excitation for name in dict.fromkeys(wanted) if name in CATALOGUE}


def _separation(group: list[str]) -> str:
    """What tells the members of a confounded class apart, as the catalogue has it."""
    said = f"{_listed(group)} look the same in this log"
    hints: list[str] = []
    for one, other in combinations(group, 2):
        for name, from_what in ((one, other), (other, one)):
            hint = CATALOGUE[name].confounded.get(from_what) if name in CATALOGUE else None
            if hint:  # the other way round says the same
                hints.append(hint)
                break
    return f"{said}; what separates them: {'; '.join(dict.fromkeys(hints))}." if hints else f"{said}."


def _listed(names: list[str]) -> str:
    code = [f"`{name}`" for name in names]
    return code[0] if len(code) == 1 else f"{', '.join(code[:-1])} and {code[-1]}"
