"""The main job, end to end: a simulated wheel behind a real tty, the daemon on it, the replay of its log, a picture.

Nothing here is the product: it starts the product's own commands, and compares what they say.
"""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from rw_ekf.filter.identifiability import rounded
from rw_ekf.logs.reader import read_log
from rw_ekf.model.state import PARAMETER_NAMES, STATE_UNITS
from rw_ekf.pictures import run_picture
from rw_ekf.replay import replay_log
from rw_ekf.settings.load import load_configuration

SECONDS = 90.0
EFFECT = "offset_torque"
OUTPUT = Path("demo-output")
COMMAND = [sys.executable, "-m", "rw_ekf"]

CONFIGURATION = """\
# Written by `make demo`; the simulated wheel's truth is [CK13]'s, plus an effect that the estimator is not told.
wheel: {{port: {link}, name: demo-wheel}}
limits: {{current_A: 0.6}}
command: {{profile: P1, seed: 1}}
output: {{directory: {directory}}}
"""


def main() -> int:
    """Run the demonstration; returns the exit status."""
    OUTPUT.mkdir(exist_ok=True)
    runs = OUTPUT / "runs"
    shutil.rmtree(runs, ignore_errors=True)
    link = Path(tempfile.mkdtemp(prefix="rw-ekf-demo-")) / "wheel"
    config = OUTPUT / "demo.yaml"
    config.write_text(CONFIGURATION.format(link=link, directory=runs))

    say("1", f"a simulated wheel in a process of its own, with an effect nobody declares to the filter: {EFFECT}")
    with simulated_wheel(link, config) as simulation:
        say("2", f"the daemon on {simulation['device']}: {SECONDS:.0f} s of profile P1 of [CK13], in real time, 10 Hz")
        run = run_daemon(config)
    entry = run["logs"][0]
    loop, wire = run["loop"], run["link"]
    print(
        f"   {entry['samples']} samples; {wire['requests']} requests, {wire['timeouts']} timeouts; "
        f"{loop['overruns']} overruns, late by {loop['late_ms_p99']:.2f} ms at the 99th percentile"
    )

    say("3", "what it learned, beside the truth that the simulated wheel was given")
    print_estimates(entry, simulation["truth"])
    for text in entry["warnings"]:
        print(f"   warning: {text}")
    if not any("residual is not noise" in text for text in entry["warnings"]):
        print("   no warning: the filter believes its model. That would be wrong here.")

    say("4", f"replay of the log it has just written: {entry['log']}")
    replayed = command_json("replay", entry["log"], "--config", str(config))["logs"][0]
    worst = max(abs(replayed["state"][name] - entry["state"][name]) / entry["std"][name] for name in entry["state"])
    print(
        f"   the same estimates within {worst:.1e} of their own sigma"
        if worst <= 1e-6
        else f"   DIFFERS by {worst} sigma"
    )

    picture = OUTPUT / "demo.png"
    configuration = load_configuration(config)
    log = read_log(entry["log"])
    again = replay_log(log, configuration, with_columns=True)
    assert again.columns is not None
    run_picture(
        picture,
        log,
        again.columns,
        truth=simulation["truth"],
        title="demo: P1 on a simulated wheel with an undeclared offset torque",
    )
    say("5", f"the picture: {picture}    log, estimates, model: {runs}/")
    return 0 if worst <= 1e-6 else 1


def say(number: str, text: str) -> None:
    """Print the heading of a step."""
    print(f"\n{number}. {text}", flush=True)


@contextmanager
def simulated_wheel(link: Path, config: Path) -> Iterator[dict[str, Any]]:
    """A simulated wheel in a second process; yields what it says of itself when it is ready."""
    process = subprocess.Popen(
        [
            *COMMAND,
            "simulate",
            "--link",
            str(link),
            "--config",
            str(config),
            "--effect",
            EFFECT,
            "--seed",
            "1",
            "--json",
        ],
        stdout=subprocess.PIPE,
        text=True,
    )
    try:
        assert process.stdout is not None
        text = ""
        while not text.rstrip().endswith("\n}"):
            line = process.stdout.readline()
            if not line:
                raise SystemExit("the simulated wheel did not start; its message stands above")
            text += line
        yield json.loads(text)
    finally:
        process.send_signal(signal.SIGTERM)
        process.wait(timeout=10)
        shutil.rmtree(link.parent, ignore_errors=True)


def run_daemon(config: Path) -> dict[str, Any]:
    """`rw-ekf run` for the demo's time, its own progress line on a terminal, a line every 15 s elsewhere."""
    process = subprocess.Popen(
        [*COMMAND, "run", "--config", str(config), "--duration", str(SECONDS), "--json"],
        stdout=subprocess.PIPE,
        text=True,
        env={**os.environ, "PYTHONUNBUFFERED": "1"},
    )
    began = time.monotonic()
    if not sys.stderr.isatty():
        while process.poll() is None and time.monotonic() - began < SECONDS:
            try:
                process.wait(timeout=15.0)
            except subprocess.TimeoutExpired:
                print(f"   {time.monotonic() - began:3.0f} of {SECONDS:.0f} s", flush=True)
    out, _ = process.communicate()
    if process.returncode != 0:
        raise SystemExit(f"the daemon ended with status {process.returncode}; its message stands above")
    document: dict[str, Any] = json.loads(out)
    return document


def command_json(*arguments: str) -> dict[str, Any]:
    """Run one of the product's commands and take its JSON document."""
    out = subprocess.run([*COMMAND, *arguments, "--json"], stdout=subprocess.PIPE, text=True, check=True).stdout
    document: dict[str, Any] = json.loads(out)
    return document


def print_estimates(entry: dict[str, Any], truth: dict[str, float]) -> None:
    """Print a table: name, estimate with sigma, truth, how many sigmas apart."""
    print(f"   {'':<12}{'estimate':>26}  {'unit':<12}{'truth':>10}{'off by':>12}")
    for name in PARAMETER_NAMES:
        value, std = entry["state"][name], entry["std"][name]
        shown = rounded(value, std) if entry["identifiable"][name] else f"({value:.3g} +- {std:.2g}) not identifiable"
        off = (value - truth[name]) / std
        print(f"   {name:<12}{shown:>26}  {STATE_UNITS[name]:<12}{truth[name]:>10.5g}{off:>+9.1f} sigma")


if __name__ == "__main__":
    sys.exit(main())
