"""Kill a running daemon at random moments, and look whether anything it writes is ever torn.

    python -m tools.measure.kills --times 1000 [--seed 1]

A wheel is simulated on a pty; daemon after daemon runs on it at 20 Hz, in one directory, with parts of half a second,
so that there is always a file that is begun, closed, compressed or replaced, and gets SIGKILL at a random moment of its
start or its run. After each kill every file must read: state, learned and start model, metadata and events whole, the
log to its last whole line and in order.
"""

from __future__ import annotations

import argparse
import contextlib
import csv
import io
import json
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import yaml
from tqdm import tqdm

import rw_ekf.cli
import rw_ekf.commands.run
import rw_ekf.live.daemon
from rw_ekf.errors import EmptyLogError, RwEkfError
from rw_ekf.logs.log_text import LogText
from rw_ekf.logs.metadata import read_metadata
from rw_ekf.logs.parts import PartName, parts_of
from rw_ekf.logs.reader import read_log
from rw_ekf.wheel.model_file import read_model

_STARTS = 0.2  # share of the kills that come during the start
_START_S = 1.0
_RUN_S = 2.0  # the longest life after the first sample
_PATIENCE_S = 60.0
_CUT = "the last line is truncated"


@dataclass
class Toll:
    """What many kills left behind."""

    kills: int = 0
    ended_before: int = 0  # daemons that did not live to be killed: then nothing was tried
    samples: int = 0
    parts: int = 0
    compressed: int = 0
    without_rows: int = 0  # killed before the first one
    cut_lines: int = 0  # logs whose last line was not whole
    temporaries: int = 0  # hidden files that were to replace another
    torn: list[str] = field(default_factory=list)


def main() -> int:
    """Print what was found; exit status 1 where anything was torn, or a daemon ended by itself."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--times", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=1)
    args = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="rw-ekf-kills-") as name:
        toll = kill_often(Path(name), args.times, args.seed)
    for text in toll.torn:
        print(text)
    for name, value in vars(toll).items():
        print(f"{name.replace('_', ' '):18}{len(value) if isinstance(value, list) else value:8}")
    return 1 if toll.torn or toll.ended_before else 0


def kill_often(directory: Path, times: int, seed: int) -> Toll:
    """Let so many daemons live for a random while, one after the other in `directory`."""
    toll, rng = Toll(), random.Random(seed)
    looked_at: set[str] = set()
    runs = directory / "runs"
    with _wheel(directory) as config:
        for _ in tqdm(range(times), unit="kills", disable=None):
            pid = _daemon(config)
            if rng.random() < _STARTS:
                time.sleep(rng.uniform(0.0, _START_S))
            else:
                _await_rows(runs)
                time.sleep(rng.uniform(0.0, _RUN_S))
            os.kill(pid, signal.SIGKILL)
            _, status = os.waitpid(pid, 0)
            toll.kills += 1
            toll.ended_before += not os.WIFSIGNALED(status)
            look(runs, toll, looked_at)
            _forget_runs(runs)
    return toll


@contextlib.contextmanager
def _wheel(directory: Path) -> Iterator[Path]:
    """A simulated wheel, and the configuration of its daemon."""
    link, config = directory / "wheel", directory / "wheel.yaml"
    content = {
        "wheel": {"port": str(link)},
        "limits": {"current_A": 0.6},
        "loop": {"rate_hz": 20.0},
        "command": {"profile": "random-sines", "amplitude_A": 0.1, "period_s": 4.0},
        "output": {"directory": str(directory / "runs"), "part_hours": 0.5 / 3600.0, "estimates_every_s": 0.2},
    }
    config.write_text(yaml.safe_dump(content), encoding="utf-8")
    command = [sys.executable, "-W", "ignore", "-m", "rw_ekf", "simulate", "--link", str(link)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True) as wheel:
        try:
            assert wheel.stdout is not None
            wheel.stdout.readline()
            yield config
        finally:
            wheel.terminate()


def _daemon(config: Path) -> int:
    """Begin a daemon in a fork of this process, which has imported what it needs; its process id."""
    pid = os.fork()
    if pid == 0:
        try:
            quiet = os.open(os.devnull, os.O_WRONLY)
            os.dup2(quiet, 1)
            os.dup2(quiet, 2)
            rw_ekf.cli.main(["run", "--config", str(config)])
        finally:
            os._exit(0)
    return pid


def _await_rows(runs: Path) -> None:
    """Wait until a run has written samples."""
    end_s = time.monotonic() + _PATIENCE_S
    while time.monotonic() < end_s:
        logs = [path for path in runs.glob("*.csv") if not path.name.endswith(".estimates.csv")]
        if any(path.read_bytes().count(b"\n") > 1 for path in logs):
            return
        time.sleep(0.01)


def _forget_runs(runs: Path) -> None:
    """Remove the files of runs that were looked at; what outlives a run stays."""
    for path in runs.iterdir() if runs.is_dir() else ():
        if not path.name.endswith((".state.json", ".learned.yaml")):
            path.unlink(missing_ok=True)  # what compresses the dead daemon's parts may still be at work


def look(runs: Path, toll: Toll, looked_at: set[str]) -> None:
    """Read every file in a directory of runs, but those of runs `looked_at`, and count."""
    if not runs.is_dir():
        return
    names = sorted(path.name for path in runs.iterdir())
    names = [name for name in names if not any(name.lstrip(".").startswith(f"{stem}.") for stem in looked_at)]
    toll.temporaries += sum(name.startswith(".") and not name.endswith(".zst") for name in names)
    for name in names:
        try:
            _look_at(runs / name)
        except (RwEkfError, ValueError, yaml.YAMLError) as error:
            toll.torn.append(f"{name}: {error}")
    parts = [part for part in map(PartName.of, names) if part is not None and not part.estimates]
    for stem in sorted({part.stem for part in parts}):
        _look_at_run(runs / f"{stem}.csv", toll)
        _look_at_rows(runs / f"{stem}.estimates.csv", toll)
        looked_at.add(stem)


def _look_at(path: Path) -> None:
    """Read a file that is replaced whole, or grows by whole lines. Raises what says that it is torn."""
    if path.name.startswith("."):
        return
    if path.name.endswith((".learned.yaml", ".start.yaml", ".model.yaml")):
        read_model(path)
    elif path.name.endswith(".meta.yaml"):
        read_metadata(path)
    elif path.name.endswith(".state.json"):
        json.loads(path.read_text(encoding="utf-8"))["schema"]
    elif path.name.endswith(".events.jsonl"):
        text = path.read_text(encoding="utf-8")
        for line in text.splitlines():
            json.loads(line)
        if text and not text.endswith("\n"):
            raise ValueError("its last line is cut")


def _look_at_run(log: Path, toll: Toll) -> None:
    try:
        read = read_log(log)
    except EmptyLogError:
        toll.without_rows += 1
        return
    except RwEkfError as error:
        toll.torn.append(str(error))
        return
    files = parts_of(log).files
    toll.samples += len(read)
    toll.parts += len(files)
    toll.compressed += sum(file.suffix == ".zst" for file in files)
    toll.cut_lines += sum(_CUT in text for text in read.warnings)
    toll.torn += [text for text in read.warnings if "damaged" in text or "backward" in text or "is not there" in text]


def _look_at_rows(first: Path, toll: Toll) -> None:
    """Every row of the estimates has its fields; the last may be cut."""
    for part in parts_of(first).files:
        try:
            text = part.read_text(encoding="utf-8") if part.suffix == ".csv" else _unpacked(part)
        except FileNotFoundError:  # compressed just now
            text = _unpacked(part.with_name(f"{part.name}.zst"))
        rows = list(csv.reader(io.StringIO(text)))
        cut = bool(text) and not text.endswith("\n")
        toll.cut_lines += cut
        if len({len(row) for row in rows[: len(rows) - cut]}) > 1:
            toll.torn.append(f"{part.name}: a row has not the fields of the header")


def _unpacked(part: Path) -> str:
    text = LogText.unpack(part, "zstd", part.name)
    if text.torn is not None:
        raise ValueError(f"{part.name}: {text.torn}")
    return (text.unpacked or b"").decode()


if __name__ == "__main__":
    sys.exit(main())
