"""What the demo prints and draws."""

from __future__ import annotations

import io
import itertools
import tempfile
import textwrap
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from pyarrow import csv
from pyarrow.compute import fill_null_forward

from rw_ekf.commands.inputs import read_wheel_model
from rw_ekf.log_replay import replay_log
from rw_ekf.logs.picture_file import save_picture
from rw_ekf.logs.reader import read_log
from rw_ekf.model.state import PARAMETER_NAMES, STATE_UNITS
from rw_ekf.numbers import plus_minus
from rw_ekf.pictures import run_figure
from rw_ekf.settings.load import load_configuration
from tools.demo.wheel import Lot

_steps = itertools.count(1)
METRICS = (
    ("one step ahead", "one_step_rms_rpm"),
    ("20 s ahead", "horizon_20s_rms_rpm"),
    ("free run", "free_run_rms_rpm"),
)


def say(text: str) -> None:
    """Print the heading of the next step."""
    print(f"\n{next(_steps)}. {text}", flush=True)


def print_link(run: dict[str, Any]) -> None:
    """How the line and the loop behaved."""
    loop, wire = run["loop"], run["link"]
    print(
        f"   {run['logs'][0]['samples']} samples; {wire['requests']} requests, {wire['timeouts']} timeouts; "
        f"{loop['overruns']} overruns, late by {loop['late_ms_p99']:.2f} ms at the 99th percentile"
    )


def print_estimates(entry: dict[str, Any]) -> None:
    """The four parameters, and whether the filter noticed that its residual is not noise."""
    for name in PARAMETER_NAMES:
        print(f"   {name:<12}{estimate_text(entry, name):>26}  {STATE_UNITS[name]}")
    alarms = [text for text in entry["warnings"] if "residual is not noise" in text]
    if alarms:  # those of the run's course come first, the judgement of the whole run last
        print(wrapped(f"warning: {alarms[-1]}"))
    else:
        print("   no warning: the filter believes its model. That would be wrong here.")


def estimate_text(entry: dict[str, Any], name: str) -> str:
    """A parameter with the digits that its sigma allows."""
    return plus_minus(entry["state"][name], entry["std"][name])


def print_verdict(document: dict[str, Any]) -> None:
    """The verdict and its sentence."""
    print(wrapped(f"{document['verdict']['kind']}: {document['verdict']['statement']}"))


def print_before_after(before: dict[str, Any], after: dict[str, Any]) -> bool:
    """Errors without and with the effect; whether the free-run error fell."""
    print("   the first run's models as they were, nothing fitted to the second; its readings have 1 rpm of noise")
    print(f"   {'error, RMS':<16}{'four parameters':>17}{'with the effect':>17}")
    for words, key in METRICS:
        texts = ("-" if figures[key] is None else f"{figures[key]:.3f}" for figures in (before, after))
        print("   {:<16}{:>17}{:>17} rpm".format(words, *texts))
    key = METRICS[-1][1]
    return before[key] is not None and after[key] is not None and after[key] < before[key]


def print_truth(lot: Lot, runs: Sequence[tuple[str, dict[str, Any]]], found: dict[str, Any]) -> bool:
    """Open the seal: estimates of each run beside the truth, and the effect; whether the diagnosis named it."""
    print(f"   {'':<14}{'truth':>10}" + "".join(f"{title:>26}{'off by':>14}" for title, _ in runs))
    for name in PARAMETER_NAMES:
        line = f"   {name:<14}{lot.parameters[name]:>10.5g}"
        for _, entry in runs:
            off = (entry["state"][name] - lot.parameters[name]) / entry["std"][name]
            line += f"{estimate_text(entry, name):>26}{off:>+8.1f} sigma"
        print(f"{line}  {STATE_UNITS[name]}")
    verdict = found["verdict"]
    alike = {name for group in verdict["indistinguishable"] for name in group}
    named = lot.effect in {*verdict["effects"], *alike}
    print(
        f"   the effect: {lot.effect}, {lot.name} = {lot.value:g}; named by the diagnosis: {'yes' if named else 'NO'}"
    )
    effects = runs[-1][1]["effects"]
    if lot.effect in effects:
        state = effects[lot.effect]
        off = (state["value"] - lot.value) / state["std"]
        print(
            f"   now a state of the filter: {plus_minus(state['value'], state['std'])} {state['unit']}, "
            f"off by {off:+.1f} sigma"
        )
    return named


def wrapped(text: str) -> str:
    """A sentence in lines that a terminal holds."""
    return textwrap.fill(text, 116, initial_indent="   ", subsequent_indent="     ", break_on_hyphens=False)


def draw_so_far(path: Path, log: Path, truth: dict[str, float]) -> None:
    """Draw a run that still goes on, from what its daemon has written."""
    written = [file.read_text(encoding="utf-8").split("\n")[:-1] for file in (log, log.with_suffix(".estimates.csv"))]
    rows, estimates = ("\n".join(lines[: min(map(len, written))]) + "\n" for lines in written)
    with tempfile.TemporaryDirectory() as folder:
        head = Path(folder) / log.name
        head.write_text(rows, encoding="utf-8")
        record = read_log(head)
    table = csv.read_csv(io.BytesIO(estimates.encode()))
    # Estimates stand in the rows where they are another than the one before foretold; in between they stay.
    reported = {name: fill_null_forward(table[name]) for name in table.column_names if "innovation" not in name}
    columns = {name: reported.get(name, table[name]).to_numpy() for name in table.column_names}
    save_picture(run_figure(record, columns, truth=truth, title="demo, the first run so far"), path)


def draw_run(path: Path, log: str, config: Path, truth: dict[str, float], title: str) -> None:
    """Replay a log as its run went, and draw it beside the truth."""
    configuration = load_configuration(config)
    record = read_log(log)
    again = replay_log(record, configuration, read_wheel_model(None, configuration), with_columns=True)
    assert again.columns is not None
    save_picture(run_figure(record, again.columns, truth=truth, title=title), path)
