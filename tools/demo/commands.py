"""The product's own commands, as the demo starts them: in processes of their own, their JSON documents taken."""

from __future__ import annotations

import contextlib
import json
import math
import os
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from tools.demo.wheel import BAUD, COMMAND, SPEED_FACTOR

_LOOK_EVERY_S, _SPEAK_EVERY_S = 1.0, 15.0

CONFIGURATION = """\
# Written by `make demo` for the daemon. The wheel's time, its line included, runs {factor:g} times as fast as ours: so
# are baud rate, loop rate and slew limit. Each of the wheel's seconds has its usual 10 samples.
wheel: {{port: {link}, name: demo-wheel, baud: {baud}}}
limits: {{current_A: 0.6, slew_A_per_s: {slew:g}}}
loop: {{rate_hz: {rate:g}, reply_timeout_ms: 10}}
filter: {{model: {model}}}
command: {command}
output: {{directory: {directory}}}
"""


def write_configuration(path: Path, *, link: str, runs: Path, command: str, model: str = "null") -> Path:
    """Write a daemon's configuration. command: the section, as YAML; model: relative to `path`, or null."""
    text = CONFIGURATION.format(
        factor=SPEED_FACTOR,
        baud=BAUD,
        link=link,
        slew=5.0 * SPEED_FACTOR,
        rate=10.0 * SPEED_FACTOR,
        model=model,
        command=command,
        directory=runs,
    )
    path.write_text(text, encoding="utf-8")
    return path


def run_daemon(
    config: Path, wheel_s: float, runs: Path, *, at: float = math.inf, then: Callable[[Path], None] = lambda log: None
) -> dict[str, Any]:
    """`rw-ekf run` for so many of the wheel's seconds: its progress on a terminal, elsewhere a line now and then.

    runs: where it writes its log, which says how far it is; then: called once with that log, after `at` wheel seconds.
    """
    before = set(logs_in(runs))
    process = subprocess.Popen(
        [*COMMAND, "run", "--config", str(config), "--duration", str(wheel_s), "--json"],
        stdout=subprocess.PIPE,
        text=True,
        env={**os.environ, "PYTHONUNBUFFERED": "1"},
    )
    spoke = time.monotonic()
    while process.poll() is None:
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(timeout=_LOOK_EVERY_S)
        for log in set(logs_in(runs)) - before:
            covered = min(round(covered_s(log)), wheel_s)
            if covered >= at:
                at = math.inf
                then(log)
            if not sys.stderr.isatty() and time.monotonic() - spoke > _SPEAK_EVERY_S:
                spoke = time.monotonic()
                print(f"   {covered:3.0f} of {wheel_s:.0f} wheel seconds", flush=True)
    out, _ = process.communicate()
    if process.returncode != 0:
        raise SystemExit(f"the daemon ended with status {process.returncode}; its message stands above")
    document: dict[str, Any] = json.loads(out)
    return document


def logs_in(runs: Path) -> list[Path]:
    """Logs of runs, without their estimates."""
    return [path for path in runs.glob("*.csv") if not path.name.endswith(".estimates.csv")]


def covered_s(log: Path) -> float:
    """Seconds of the wheel's clock from the first whole line of a log to the last; 0 where there are not two."""
    header, *lines = log.read_text(encoding="utf-8").split("\n")[:-1] or [""]
    if len(lines) < 2:
        return 0.0
    at = header.split(",").index("time_s")
    return float(lines[-1].split(",")[at]) - float(lines[0].split(",")[at])


def command_json(*arguments: str) -> dict[str, Any]:
    """Run a command to its end and take its JSON document."""
    done = subprocess.run([*COMMAND, *arguments, "--json"], stdout=subprocess.PIPE, text=True, check=False)
    if done.returncode != 0:
        raise SystemExit(f"`rw-ekf {' '.join(arguments)}` ended with status {done.returncode}")
    document: dict[str, Any] = json.loads(done.stdout)
    return document
