"""Fragments of the report's page: figures before and after, tables, commands. Everything from outside is escaped."""

from __future__ import annotations

import html
import re
import shlex
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from rw_ekf.diagnosis.report.words import (
    FigurePair,
    Units,
    gain_text,
    p_value_text,
    parameter_text,
    percent_text,
    ranked,
    standing_of,
    statistic_text,
)
from rw_ekf.numbers import MISSING, number_text

_MOST_SPANS = 12


def prose(text: str) -> str:
    """Escaped text with `code` marked up, +- and -> set as signs."""
    escaped = html.escape(text).replace(" +- ", "&nbsp;±&nbsp;").replace("-&gt;", "→")
    return re.sub(r"`([^`]+)`", r"<code>\1</code>", escaped)


def tiles(pairs: Sequence[FigurePair]) -> str:
    """Before and after of every figure in two rows, the first one large; bars in proportion."""
    rows = [pairs[:3], pairs[3:]]
    return "".join(
        f'<div class="tiles">{"".join(_tile(pair, main=pair is pairs[0]) for pair in row)}</div>' for row in rows if row
    )


def _tile(pair: FigurePair, *, main: bool) -> str:
    single = pair.after is None or pair.after == pair.before
    value = number_text(pair.before)
    bars = change = ""
    if not single:
        value = f'<span class="before">{value}</span> → <span class="after">{number_text(pair.after)}</span>'
        if pair.change_percent is not None:
            change = f'<span class="change">{percent_text(pair.change_percent)}</span>'
            bars = _bars(pair)
    unit = f' <span class="unit">{html.escape(pair.unit)}</span>' if pair.unit else ""
    return (
        f'<div class="tile{" main" if main else ""}"><div class="label">{pair.label}{change}</div>'
        f'<div class="value">{value}{unit}</div>{bars}<div class="note">{html.escape(pair.note)}</div></div>'
    )


def _bars(pair: FigurePair) -> str:
    before, after = pair.before or 0.0, pair.after or 0.0
    longest = max(before, after)
    widths = [100.0 * value / longest if longest > 0.0 else 0.0 for value in (before, after)]
    return (
        f'<div class="bar was" style="width:{widths[0]:.1f}%"></div>'
        f'<div class="bar" style="width:{widths[1]:.1f}%"></div>'
    )


def figure(name: str, source: str, alt: str, caption: str) -> str:
    """A picture with its caption; source: a data URI."""
    return (
        f'<figure id="{name}"><img src="{source}" alt="{html.escape(alt, quote=True)}">'
        f"<figcaption>{caption}</figcaption></figure>"
    )


def table(heads: Sequence[str], rows: Sequence[tuple[str, Sequence[str]]], numbers: Sequence[int] = ()) -> str:
    """A table; rows: (class, cells); cells are markup already; numbers: columns set to the right."""

    def cells(tag: str, texts: Sequence[str]) -> str:
        classes = [' class="number"' if i in numbers else "" for i in range(len(texts))]
        return "".join(f"<{tag}{c}>{text}</{tag}>" for c, text in zip(classes, texts, strict=True))

    body = "".join(f'<tr class="{kind}">{cells("td", texts)}</tr>' for kind, texts in rows)
    return f'<div class="scroll"><table><thead><tr>{cells("th", heads)}</tr></thead><tbody>{body}</tbody></table></div>'


def parameter_table(document: Mapping[str, Any]) -> str:
    """The parameters of the effects that were added; empty without any."""
    rows = []
    for candidate in document.get("candidates") or ():
        if standing_of(candidate) == "added":
            for name, parameter in (candidate.get("parameters") or {}).items():
                text = parameter_text(parameter)
                unit = str(parameter.get("unit") or "")
                value = text.removesuffix(unit).rstrip() if unit else text
                fixed = parameter.get("std") is None
                found, _, sigma = value.partition(" +- ")
                if found.startswith("("):  # (1.23 +- 0.03)e-6
                    sigma, _, power = sigma.partition(")")
                    found, sigma = f"{found[1:]}{power}", f"{sigma}{power}"
                cells = [html.escape(v) for v in (candidate["effect"], name, found, sigma, unit)]
                cells[3] = cells[3] or ("fixed" if fixed else MISSING)
                rows.append(("", cells))
    return table(("effect", "parameter", "value", "sigma", "unit"), rows, (2, 3)) if rows else ""


def candidate_table(document: Mapping[str, Any]) -> str:
    """Every candidate of the catalogue, tested or not; empty without any."""
    candidates = list(document.get("candidates") or ())
    ordered = ranked(candidates) + [c for c in candidates if standing_of(c) == "untestable"]
    rows = []
    for candidate in ordered:
        parameters = "<br>".join(
            f"{html.escape(name)} {prose(parameter_text(parameter))}"
            for name, parameter in (candidate.get("parameters") or {}).items()
        )
        cells = [
            f"<code>{html.escape(str(candidate.get('effect')))}</code>",
            parameters or MISSING,
            statistic_text(candidate.get("statistic")),
            html.escape(p_value_text(candidate.get("p_value"))),
            gain_text(candidate),
            html.escape(str(candidate.get("decision") or "")),
        ]
        rows.append((standing_of(candidate), cells))
    heads = ("effect", "parameters", "statistic", "p-value", "held-out error", "decision")
    return table(heads, rows, (2, 3, 4)) if rows else ""


def figure_table(pairs: Sequence[FigurePair]) -> str:
    """All figures as numbers; empty without any."""
    rows = []
    for pair in pairs:
        change = percent_text(pair.change_percent) if pair.change_percent is not None else MISSING
        cells = [
            html.escape(v) for v in (pair.label, pair.unit, number_text(pair.before, 4), number_text(pair.after, 4))
        ]
        rows.append(("", [*cells, change]))
    return table(("figure", "unit", "before", "after", "change"), rows, (2, 3, 4)) if rows else ""


def split_text(document: Mapping[str, Any]) -> str:
    """Which stretches of the log found the effect and which judged it."""
    split = document.get("split") or {}
    lines = []
    for key, role in (("fit_s", "Fitted on"), ("heldout_s", "Held out")):
        spans = split.get(key) or []
        total = sum(end - start for start, end in spans)
        shown = ", ".join(f"{start:.6g} to {end:.6g}" for start, end in spans[:_MOST_SPANS])
        more = f", and {len(spans) - _MOST_SPANS} more" if len(spans) > _MOST_SPANS else ""
        lines.append(f"<li>{role}: {total:.6g} s in {len(spans)} stretches ({shown}{more} s)</li>" if spans else "")
    kind = html.escape(str(split.get("kind") or MISSING))
    return f"<p>Split: {kind}.</p><ul>{''.join(lines)}</ul>"


def commands(directory: Path, log_name: str, options: Sequence[str] = ()) -> str:
    """How to use the augmented model, from wherever one stands; options: those that the log was read with."""
    path = str((directory / "augmented-model.yaml").absolute())
    found_log = Path(log_name).absolute() if Path(log_name).exists() else Path(log_name)
    model, log = shlex.quote(path), shlex.join([str(found_log), *options])
    key = html.escape(f"filter:\n  model: {_yaml_text(path)}")
    parts = (
        ("Filter a log with it, the effect's coefficient a state of its own:", f"rw-ekf replay {log} --model {model}"),
        (
            "Look for what is left (it must say adequate, or name the next effect):",
            f"rw-ekf diagnose {log} --model {model}",
        ),
        ("Run the daemon with it:", f"rw-ekf run --config my-wheel.yaml --model {model}"),
    )
    found = "".join(f"<p>{words}</p><pre>{html.escape(command)}</pre>" for words, command in parts)
    return f"{found}<p>or for good, in the daemon's configuration:</p><pre>{key}</pre>"


def _yaml_text(text: str) -> str:
    """A YAML scalar; quoted where a plain one would be read otherwise."""
    import yaml

    dumped: str = yaml.safe_dump(text, width=10_000)
    return dumped.removesuffix("\n...\n").strip()


def residual_caption(units: Units, *, has_after: bool, kind: str) -> str:
    """What the picture of the residual says and how to read it."""
    what = "torque" if units.inertia_kg_m2 is not None else "acceleration"
    gone = (
        "<strong>A flat line through zero means that nothing is left that depends on this quantity</strong>"
        + ("; where <span class='before'>before</span> bends and <span class='after'>after</span> is flat, "
           "the model now explains it." if has_after else ".")
    )  # fmt: skip
    bold = {"adequate": "", "effect": "; what the named cause depends on is bold"}
    largest = bold.get(kind, "; the largest dependence is bold")
    return (
        f"{gone} The residual is the {what} that the smoothed speed asks for beyond the model: what drives the wheel "
        "forward is positive. All panels share one scale; points are single samples. Above each panel: size of the "
        f"structure in the means, noise taken off{largest}. Against time the whole record is "
        "shown, elsewhere its held-out part. A quantity that moves together with the cause bends too."
    )
