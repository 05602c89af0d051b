"""Measure the page: how soon it is seen, what its server costs, and whether a day of rows leaves memory as it was.

python -m tools.measure.page paint RUNS [--loads 5] [--after 0]      of a server that began so long ago [s], and again
python -m tools.measure.page clients [--clients 20] [--seconds 60]      processor share while 10 rows a second come
python -m tools.measure.page day RUNS [--hours 24] [--minutes 10]      the rows of so many hours in so many minutes

RUNS: a folder with a run of two minutes or more. `clients` and `day` write its rows again and again, a tenth of a
second apart, as a run does: line by line, in its files, with its state beside them. What the loop of a run is late by
with clients on its page, `tools.measure.daemon --clients` measures.
"""

from __future__ import annotations

import argparse
import itertools
import json
import os
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from rw_ekf.live.process import own_process
from rw_ekf.page.run_feed import RunFeed, runs_in
from tools.measure.browser import Browser
from tools.measure.daemon import processor_s, resident_kib
from tools.measure.page_clients import Clients

VIEW = [sys.executable, "-m", "rw_ekf", "view"]
PERIOD_S = 0.1
_SETTLED = 200  # rows until all are connected, and what the server loads ahead is loaded
_BATCH = 20  # rows that a run at a multiple of its speed writes at once
_FIRST_CHART = """new MutationObserver((_, watch) => { if (document.querySelector(".chart canvas")) {
  requestAnimationFrame(() => { window.chartAt = performance.now(); }); watch.disconnect(); } })
  .observe(document, { childList: true, subtree: true })"""


class RunAgain:
    """A run that writes the rows of another one again and again, its times going on."""

    def __init__(self, source: Path, folder: Path) -> None:
        """source: the first log of a run, of one part."""
        feed = RunFeed(source)
        folder.mkdir()
        self.log = folder / source.name
        for path in feed.stem.parent.glob(f"{feed.stem.name}.*"):
            if path.suffix in (".yaml", ".jsonl"):
                shutil.copy(path, folder / path.name)
        self._state = folder / "wheel.state.json"
        self._tables = []
        for path in (source, source.with_suffix(".estimates.csv")):
            names, *rows = path.read_text().splitlines()
            stream = (folder / path.name).open("w", buffering=1)
            stream.write(f"{names}\n")
            self._tables.append((stream, [row.partition(",")[2] for row in rows]))
        self.rows = 0

    def add(self, count: int) -> None:
        """More rows, and what is published behind them."""
        for stream, rows in self._tables:
            numbers = range(self.rows, self.rows + count)
            stream.write("".join(f"{10.0 + PERIOD_S * number:.9g},{rows[number % len(rows)]}\n" for number in numbers))
            stream.flush()
        self.rows += count
        document: dict[str, Any] = {
            "schema": "rw_ekf.state/1", "wheel": "wheel", "log": self.log.name, **own_process(), "link": {},
            "run_state": "TRACKING", "since_utc": "2026-01-01T00:00:00Z", "reason": "", "alarms": [],
        }  # fmt: skip
        beside = self._state.with_suffix(".new")
        beside.write_text(json.dumps(document))
        beside.replace(self._state)


@contextmanager
def viewed(folder: Path) -> Iterator[tuple[int, str]]:
    """A server of a folder's runs: its process, and its address with the token."""
    with subprocess.Popen([*VIEW, str(folder), "--listen", "127.0.0.1:0"], stdout=subprocess.PIPE, text=True) as server:
        try:
            assert server.stdout is not None
            yield server.pid, server.stdout.readline().strip()
        finally:
            server.terminate()


def paint(folder: Path, loads: int, after_s: float) -> None:
    """First paint and first chart, behind the navigation: of a server that nobody has asked yet, and of one in use.

    With the processor time until then of server and page, which other programs on the machine do not lengthen.
    """
    found: dict[str, list[tuple[float, ...]]] = {"cold": [], "warm": []}
    for _ in range(loads):
        with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile, Browser(Path(profile)) as browser:
            browser.call("Page.addScriptToEvaluateOnNewDocument", source=_FIRST_CHART)
            browser.call("Performance.enable", timeDomain="threadTicks")
            with viewed(folder) as (pid, address):
                time.sleep(after_s)
                for rows in found.values():
                    browser.open("about:blank")
                    began_s, drawn_s = processor_s(pid), _drawing_s(browser)
                    browser.open(address)
                    times = browser.until(_TIMES)
                    rows.append((*times, 1e3 * (processor_s(pid) - began_s), 1e3 * (_drawing_s(browser) - drawn_s)))
    for kind, rows in found.items():
        painted, charts, server, page = zip(*rows, strict=True)
        print(
            f"{kind}: first paint {_spread(painted)} ms, first chart {_spread(charts)} ms; processor time of the "
            f"server {_spread(server)} ms, of the page {_spread(page)} ms"
        )


_TIMES = """(() => { const seen = performance.getEntriesByName("first-contentful-paint")[0];
  return seen && window.chartAt ? [seen.startTime, window.chartAt] : null; })()"""


def _drawing_s(browser: Browser) -> float:
    """Processor time of the page's main thread."""
    return {one["name"]: float(one["value"]) for one in browser.call("Performance.getMetrics")["metrics"]}[
        "TaskDuration"
    ]


def clients(source: Path, count: int, seconds: float) -> None:
    """The share of a core that the server takes while a run of 10 Hz is watched."""
    with tempfile.TemporaryDirectory() as name:
        again = RunAgain(source, Path(name) / "runs")
        again.add(600)
        with viewed(again.log.parent) as (pid, address), Clients(address, count) as listening:
            began_s, used_s = 0.0, 0.0
            for number in itertools.count():
                if number == _SETTLED:
                    began_s, used_s = time.monotonic(), processor_s(pid)
                    listening.bytes = 0
                if number > _SETTLED and time.monotonic() - began_s > seconds:
                    break
                again.add(1)
                time.sleep(PERIOD_S)
            lasted_s = time.monotonic() - began_s
            share = 100.0 * (processor_s(pid) - used_s) / lasted_s
            rate = listening.bytes / lasted_s / 1e3 / max(count, 1)
    print(f"{count} clients: {share:.2f} % of a core, {rate:.2f} kB/s a client; load {os.getloadavg()[0]:.1f}")


def day(source: Path, hours: float, minutes: float) -> None:
    """Resident memory of the server and the page's heap, every so often, while a run of so many hours grows."""
    rows, every = round(3600.0 * hours / PERIOD_S), 60.0 * minutes / (hours * 3600.0 / PERIOD_S / _BATCH)
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as name, Browser(Path(name) / "profile") as browser:
        again = RunAgain(source, Path(name) / "runs")
        again.add(_BATCH)
        with viewed(again.log.parent) as (pid, address):
            browser.open(address)
            browser.until("document.querySelector('.chart canvas') !== null")
            began_s = next_s = reported_s = time.monotonic()
            while again.rows < rows:
                again.add(_BATCH)
                next_s += every
                time.sleep(max(next_s - time.monotonic(), 0.0))
                if time.monotonic() >= reported_s or again.rows >= rows:
                    reported_s += 30.0 * minutes / 10.0
                    print(_memory(again.rows, time.monotonic() - began_s, pid, browser), flush=True)
            print(f"console: {browser.stated}")


def _memory(rows: int, lasted_s: float, pid: int, browser: Browser) -> str:
    browser.call("HeapProfiler.collectGarbage")
    heap: dict[str, Any] = browser.call("Runtime.getHeapUsage")
    nodes = browser.call("Memory.getDOMCounters")
    held = browser.value("[shown[0].log.rows, shown[0].estimates.rows, shown[0].events.length]")
    return (
        f"{rows:7d} rows ({rows * PERIOD_S / 3600.0:5.2f} h) after {lasted_s:4.0f} s: "
        f"server {resident_kib(pid) / 1024:6.1f} MiB, heap {heap['usedSize'] / 2**20:5.2f} MiB, {nodes['nodes']} nodes "
        f"with {nodes['jsEventListeners']} listeners, held {held}, load {os.getloadavg()[0]:.1f}"
    )


def _spread(values: tuple[float, ...]) -> str:
    return f"{statistics.median(values):.0f} ({min(values):.0f} to {max(values):.0f})"


def main() -> None:
    """Measure one of three."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", 1)[0])
    parser.add_argument("what", choices=("paint", "clients", "day"))
    parser.add_argument("runs", type=Path)
    parser.add_argument("--loads", type=int, default=5)
    parser.add_argument("--after", type=float, default=0.0)
    parser.add_argument("--clients", type=int, default=20)
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--hours", type=float, default=24.0)
    parser.add_argument("--minutes", type=float, default=10.0)
    args = parser.parse_args()
    if args.what == "paint":
        paint(args.runs, args.loads, args.after)
    elif args.what == "clients":
        clients(runs_in(args.runs)[0], args.clients, args.seconds)
    else:
        day(runs_in(args.runs)[0], args.hours, args.minutes)
    print(f"load {os.getloadavg()[0]:.1f}")


if __name__ == "__main__":
    main()
