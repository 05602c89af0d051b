"""Measure the daemon: a simulated wheel on a pty, 10 Hz, ten minutes; lateness, processor share, memory.

python -m tools.measure.daemon [--minutes 10] [--output '{mcap: true, prometheus: "127.0.0.1:9464", influx: file}']
python -m tools.measure.daemon --minutes 2 --clients 100      that watch the page of the run
python -m tools.measure.daemon --minutes 1 --rate 200         over a line of 921,600 baud
"""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import yaml
from tqdm import tqdm

from tools.measure.page_clients import Clients

COMMAND = [sys.executable, "-m", "rw_ekf"]
CONFIGURATION = """\
wheel: {{port: {link}{line}}}
{loop}limits: {{current_A: 0.6}}
command: {{profile: random-sines, amplitude_A: 0.15, period_s: 25}}
output: {output}
"""
_TICKS_PER_S = os.sysconf("SC_CLK_TCK")


def main() -> int:
    """Run and print the figures beside their marks."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--minutes", type=float, default=10.0)
    parser.add_argument("--clients", type=int, help="that watch its page (run --view); without: there is no page")
    parser.add_argument(
        "--rate", type=float, help="turns a second, over a line that carries them; without: 10, 38,400 baud"
    )
    parser.add_argument("--output", type=yaml.safe_load, default={}, help="further keys of `output`, as YAML")
    args = parser.parse_args()
    minutes = args.minutes
    with tempfile.TemporaryDirectory(prefix="rw-ekf-measure-") as name:
        directory = Path(name)
        link = directory / "wheel"
        config = directory / "wheel.yaml"
        output = {"directory": str(directory / "runs"), **args.output}
        line, loop = ("", "") if args.rate is None else (", baud: 921600", loop_of(args.rate))
        config.write_text(CONFIGURATION.format(link=link, output=json.dumps(output), line=line, loop=loop))
        wheel = subprocess.Popen([*COMMAND, "simulate", "--link", str(link)], stdout=subprocess.PIPE, text=True)
        try:
            assert wheel.stdout is not None
            wheel.stdout.readline()
            document, usage = _run(config, 60.0 * minutes, args.clients)
        finally:
            wheel.send_signal(signal.SIGTERM)
            wheel.wait(timeout=10)
    _print(document, usage)
    return 0


def loop_of(rate_hz: float) -> str:
    """The section `loop` of a rate; a reply is awaited for four fifths of a turn, or for as long as usual."""
    return f"loop: {{rate_hz: {rate_hz:g}, reply_timeout_ms: {min(40.0, 800.0 / rate_hz):g}}}\n"


def _run(config: Path, seconds: float, clients: int | None) -> tuple[dict[str, Any], list[tuple[float, float, int]]]:
    """Run the daemon; its document, and (time [s], processor time [s], resident memory [KiB]) every few seconds."""
    view = [] if clients is None else ["--view", "127.0.0.1:0"]
    process = subprocess.Popen(
        [*COMMAND, "run", "--config", str(config), "--duration", str(seconds), "--json", *view],
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL if clients is None else subprocess.PIPE,
        text=True,
    )
    usage: list[tuple[float, float, int]] = []
    began = time.monotonic()
    with _watching(process, clients), tqdm(total=round(seconds), unit="s", disable=None) as bar:
        while process.poll() is None:
            at = time.monotonic() - began
            if at < seconds - 1.0:  # what it does after the last sample is not the loop
                usage.append((at, processor_s(process.pid), resident_kib(process.pid)))
            bar.update(round(at) - bar.n)
            time.sleep(2.0)
    assert process.stdout is not None
    document: dict[str, Any] = json.loads(process.stdout.read())
    if "loop" not in document:
        raise SystemExit(f"the run did not begin: {document}")
    return document, usage


@contextlib.contextmanager
def _watching(process: subprocess.Popen[str], clients: int | None) -> Iterator[None]:
    """So many clients on the page of a run; its other words are thrown away."""
    if clients is None:
        yield
        return
    assert process.stderr is not None
    address = next(line for line in process.stderr if line.startswith("http"))
    threading.Thread(target=process.stderr.read, daemon=True).start()
    time.sleep(2.0)  # the run has begun its log
    with Clients(address, clients):
        yield


def processor_s(pid: int) -> float:
    """Processor time that a process has taken [s]."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / _TICKS_PER_S


def resident_kib(pid: int) -> int:
    """Resident memory of a process [KiB]."""
    for line in Path(f"/proc/{pid}/status").read_text().splitlines():
        if line.startswith("VmRSS:"):
            return int(line.split()[1])
    return 0


def _print(document: dict[str, Any], usage: list[tuple[float, float, int]]) -> None:
    settled = [row for row in usage if row[0] > 5.0]
    first, last = settled[0], settled[-1]
    share = 100.0 * (last[1] - first[1]) / (last[0] - first[0])
    third = max(len(settled) // 3, 1)
    early = max(row[2] for row in settled[:third])
    late = max(row[2] for row in settled[-third:])
    loop = document["loop"]
    print(f"ticks                {loop['ticks']}")
    share_over = 100.0 * loop["overruns"] / max(loop["ticks"], 1)
    print(f"overruns             {loop['overruns']}, {share_over:.2f} %    (mark: below 1 %, at 10 Hz none)")
    print(
        f"late                 p50 {loop['late_ms_p50']:.2f}, p99 {loop['late_ms_p99']:.2f}, "
        f"max {loop['late_ms_max']:.2f} ms    (mark: p99 < 5 ms)"
    )
    print(f"processor            {share:.2f} % of one core    (mark: < 3 %)")
    print(f"resident memory      {early} KiB in the first third, {late} KiB in the last    (mark: flat)")
    print(f"link                 {document['link']}")


if __name__ == "__main__":
    sys.exit(main())
