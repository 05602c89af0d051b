"""What the report's page is made of: its style, figures before and after, tables, commands.

Everything from outside is escaped.
"""

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
    plain_name,
    probability_text,
    ranked,
)
from rw_ekf.diagnosis.standing import standing_of
from rw_ekf.numbers import MISSING, number_of, number_text

STYLE = """
:root {
  --ground: #ffffff; --panel: #f6f7f9; --line: #dde1e6; --ink: #1d2126; --soft: #59616b;
  --before: #b84708; --after: #0067b1; --good: #0b6e4f; --grey: #5d6670;
}
@media screen and (prefers-color-scheme: dark) {
  :root {
    --ground: #14171b; --panel: #1d2127; --line: #343a43; --ink: #e8ebef; --soft: #a3acb7;
    --before: #f08a4b; --after: #5fb0ee; --good: #3fb68b; --grey: #8d97a3;
  }
  figure img { filter: invert(1) hue-rotate(180deg); mix-blend-mode: screen; }
  .badge { color: #101317 !important; }
}
* { box-sizing: border-box; }
html { background: var(--ground); -webkit-text-size-adjust: 100%; }
body {
  margin: 0 auto; padding: 2rem 1.5rem 4rem; max-width: 66rem; color: var(--ink); background: var(--ground);
  font: 16px/1.5 system-ui, -apple-system, "Segoe UI", Roboto, "Helvetica Neue", "Noto Sans", sans-serif;
}
.source { margin: 0 0 1.1rem; color: var(--soft); font-size: .875rem; overflow-wrap: anywhere; }
.badge {
  display: inline-block; padding: .18rem .75rem; border-radius: 1rem; color: #fff; background: var(--grey);
  font-weight: 650; font-size: .95rem; letter-spacing: .01em;
}
.badge.adequate { background: var(--good); }
.badge.effect { background: var(--after); }
.badge.unexplained { background: var(--before); }
h1 { margin: .6rem 0 1.5rem; font-size: 1.62rem; line-height: 1.3; font-weight: 620; text-wrap: pretty; }
.statement { margin: -.9rem 0 1.5rem; }
h2 { margin: 2.8rem 0 .5rem; padding-top: .9rem; border-top: 1px solid var(--line); font-size: 1.15rem; }
h3 { margin: 1.4rem 0 .3rem; font-size: .95rem; }
p, li { max-width: 46rem; }
.legend { margin: 0 0 .6rem; max-width: none; color: var(--soft); font-size: .875rem; }
.before { color: var(--before); } .after { color: var(--after); }
.tiles { display: flex; gap: .7rem; margin: 0 0 .7rem; }
.tile { flex: 1 1 0; min-width: 0; padding: .7rem .9rem .75rem; background: var(--panel); border-radius: .4rem; }
.tile.main { flex-grow: 2.2; }
.tile .label { display: flex; justify-content: space-between; font-size: .875rem; font-weight: 600; }
.tile .value { font-size: 1.3rem; line-height: 1.35; font-variant-numeric: tabular-nums; white-space: nowrap; }
.tile.main .value { font-size: 2.35rem; font-weight: 620; line-height: 1.2; }
.tile .unit, .tile .change { font-size: .875rem; color: var(--soft); font-weight: 400; }
.tile .note { font-size: .8rem; line-height: 1.35; color: var(--soft); }
.bar { height: .3rem; margin: .22rem 0; border-radius: .15rem; background: var(--after); min-width: 2px; }
.bar.was { background: var(--before); }
figure { margin: .6rem 0 0; }
figure img { display: block; width: 100%; height: auto; }
figcaption { margin: .4rem 0 0; max-width: 46rem; font-size: .9rem; color: var(--soft); }
.scroll { overflow-x: auto; }
table { border-collapse: collapse; width: 100%; font-size: .9rem; font-variant-numeric: tabular-nums; }
th, td { padding: .32rem .8rem .32rem 0; text-align: left; vertical-align: top; border-bottom: 1px solid var(--line); }
th { color: var(--soft); font-weight: 600; }
td.number, th.number { text-align: right; white-space: nowrap; }
tr.added td { font-weight: 650; } tr.untestable td, tr.rejected td { color: var(--soft); }
pre {
  margin: .3rem 0 .9rem; padding: .6rem .8rem; overflow-x: auto; background: var(--panel); border-radius: .4rem;
  font: .875rem/1.5 ui-monospace, "SF Mono", Menlo, Consolas, monospace;
}
code { font-family: ui-monospace, "SF Mono", Menlo, Consolas, monospace; font-size: .92em; }
@media screen and (max-width: 44rem) {
  body { padding: 1.2rem 1rem 3rem; } h1 { font-size: 1.3rem; }
  .tiles { flex-wrap: wrap; } .tile { flex-basis: 44%; } .tile.main { flex-basis: 100%; }
  .tile .value { font-size: 1.1rem; white-space: normal; } .tile .label { flex-wrap: wrap; }
  .wide { overflow-x: auto; } .wide img { width: 46rem; max-width: none; }
}
@media print {
  @page { margin: 14mm; }
  body { max-width: none; padding: 0; font-size: 10pt; }
  h1 { font-size: 15pt; margin-bottom: .8rem; } h2 { margin-top: 1.4rem; }
  .tile { padding: .45rem .6rem; } .tile .note { display: none; }
  .tile .value { font-size: 12pt; } .tile.main .value { font-size: 20pt; }
  .scroll { overflow: visible; } table { font-size: 8.5pt; } th, td { padding-right: .5rem; }
  .badge, .bar, .tile { -webkit-print-color-adjust: exact; print-color-adjust: exact; }
  figure, table, pre, .tiles { break-inside: avoid; } h2, h3 { break-after: avoid; }
  pre { white-space: pre-wrap; }
}
"""

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
        f'<figure id="{name}"><div class="wide"><img src="{source}" alt="{html.escape(alt, quote=True)}"></div>'
        f"<figcaption>{caption}</figcaption></figure>"
    )


def table(heads: Sequence[str], rows: Sequence[tuple[str, Sequence[str]]], numbers: Sequence[int] = ()) -> str:
    """A table; rows: (class, cells); cells are markup already; numbers: columns set to the right."""

    def cells(tag: str, texts: Sequence[str]) -> str:
        classes = [' class="number"' if i in numbers else "" for i in range(len(texts))]
        return "".join(f"<{tag}{c}>{text}</{tag}>" for c, text in zip(classes, texts, strict=True))

    body = "".join(f'<tr class="{kind}">{cells("td", texts)}</tr>' for kind, texts in rows)
    return f'<div class="scroll"><table><thead><tr>{cells("th", heads)}</tr></thead><tbody>{body}</tbody></table></div>'


def parameter_table(document: Mapping[str, Any], start_s: float) -> str:
    """The parameters of the effects that were added; empty without any. start_s: the log's own time at its start."""
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
                cells[1] += _since_start(name, parameter, start_s)
                cells[3] = cells[3] or ("fixed" if fixed else MISSING)
                rows.append(("", cells))
    return table(("effect", "parameter", "value", "sigma", "unit"), rows, (2, 3)) if rows else ""


def base_parameter_table(document: Mapping[str, Any]) -> str:
    """The four parameters as the fit part gave them, and with what was added; empty where they are not known."""
    parameters = document.get("parameters") or {}
    before, after = parameters.get("before") or {}, parameters.get("after") or {}
    rows = [
        (
            "",
            [
                html.escape(plain_name(name)),
                *(prose(parameter_text(found[name])) for found in (before, after) if found),
            ],
        )
        for name in before
    ]
    heads = ("parameter", "before", "after") if after else ("parameter", "value")
    return table(heads, rows, tuple(range(1, len(heads)))) if rows else ""


def _since_start(name: str, parameter: Mapping[str, Any], start_s: float) -> str:
    """Beside the onset of an event: when that was since the log's start, where its own time does not begin at zero."""
    value = number_of(parameter.get("value"))
    if not name.startswith("onset_s") or value is None or start_s == 0.0:
        return ""
    return f"<br>{value - start_s:.1f} s after the log's start"


def candidate_table(document: Mapping[str, Any], start_s: float) -> str:
    """Every candidate of the catalogue, tested or not; empty without any. start_s: as in `parameter_table`."""
    candidates = list(document.get("candidates") or ())
    ordered = ranked(candidates) + [c for c in candidates if standing_of(c) == "untestable"]
    rows = []
    for candidate in ordered:
        parameters = "<br>".join(
            f"{html.escape(name)} {prose(parameter_text(parameter))}{_since_start(name, parameter, start_s)}"
            for name, parameter in (candidate.get("parameters") or {}).items()
        )
        cells = [
            f"{html.escape(plain_name(str(candidate.get('effect'))))}<br>"
            f"<code>{html.escape(str(candidate.get('effect')))}</code>",
            parameters or MISSING,
            html.escape(probability_text(candidate.get("posterior"))),
            html.escape(p_value_text(candidate.get("p_value"))),
            gain_text(candidate),
            html.escape(str(candidate.get("decision") or "")),
        ]
        rows.append((standing_of(candidate), cells))
    heads = ("effect", "parameters", "probability", "p-value", "held-out error", "decision")
    return table(heads, rows, (2, 3, 4)) if rows else ""


def figure_table(pairs: Sequence[FigurePair]) -> str:
    """All figures as numbers, before and after where anything was added; empty without any."""
    added = any(pair.after is not None and pair.after != pair.before for pair in pairs)
    rows = []
    for pair in pairs:
        change = percent_text(pair.change_percent) if pair.change_percent is not None else MISSING
        cells = [html.escape(v) for v in (pair.label, pair.unit, number_text(pair.before, 4))]
        rows.append(("", [*cells, html.escape(number_text(pair.after, 4)), change] if added else cells))
    heads = ("figure", "unit", "before", "after", "change") if added else ("figure", "unit", "value")
    return table(heads, rows, tuple(range(2, len(heads)))) if rows else ""


def split_text(document: Mapping[str, Any], start_s: float) -> str:
    """Which stretches of the log found the effect and which judged it, in its own time, which starts at start_s."""
    split = document.get("split") or {}
    lines = []
    for key, role in (("fit_s", "Fitted on"), ("heldout_s", "Held out")):
        spans = split.get(key) or []
        total = sum(end - start for start, end in spans)
        shown = ", ".join(f"{start:.6g} to {end:.6g}" for start, end in spans[:_MOST_SPANS])
        more = f", and {len(spans) - _MOST_SPANS} more" if len(spans) > _MOST_SPANS else ""
        lines.append(f"<li>{role}: {total:.6g} s in {len(spans)} stretches ({shown}{more} s)</li>" if spans else "")
    kind = html.escape(str(split.get("kind") or MISSING))
    own = f" Times are the log's own: it starts at {start_s:.10g} s." if start_s != 0.0 else ""
    return f"<p>Split: {kind}.{own}</p><ul>{''.join(lines)}</ul>"


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
