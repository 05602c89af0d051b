"""The report's style sheet: system fonts, two colours that every eye tells apart, light, dark and paper."""

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
