"""A supervised run in processes of their own, sabotaged where a test asks for it, and what it has said so far."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any

from tests.live.bench import PROGRAM, ROOT, Bench, wait_for

LONG_S = 60.0  # for a machine that does other things


@dataclass
class Running:
    """A process of `rw-ekf run` under way."""

    bench: Bench
    config: str
    process: subprocess.Popen[str]
    errors: IO[str]

    @property
    def pid(self) -> int:
        """Number of the process that was started: the supervisor, where there is one."""
        return self.process.pid

    def stated(self, event: str) -> list[dict[str, Any]]:
        """The log lines of that event, so far."""
        text = Path(self.errors.name).read_text(encoding="utf-8")
        lines = [json.loads(line) for line in text.splitlines() if line.startswith("{") and line.endswith("}")]
        return [line for line in lines if line["event"] == event]

    def text(self) -> str:
        """All that it wrote to standard error."""
        return Path(self.errors.name).read_text(encoding="utf-8")

    def published(self) -> dict[str, Any]:
        """The state file; empty where there is none."""
        for path in self.bench.runs.glob("*.state.json"):
            document: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
            return document
        return {}

    def child(self, state: str = "TRACKING", besides: tuple[int, ...] = ()) -> int:
        """Number of the child that is in this state, none of those before it, waiting for one."""

        def found() -> int | None:
            now = self.published()
            there = now.get("run_state") == state and now["pid"] not in besides and is_there(now["pid"])
            return int(now["pid"]) if there else None

        self.wait(lambda: found() is not None)
        return int(self.published()["pid"])

    def wait(self, condition: Callable[[], bool]) -> None:
        """Wait for something as long as it may take."""
        wait_for(condition, LONG_S)

    def ended(self) -> int:
        """Its exit status, when it has ended."""
        return self.process.wait(LONG_S)


@contextmanager
def running(bench: Bench, *options: str, sabotage: str = "", **settings: Any) -> Iterator[Running]:
    """`rw-ekf run OPTIONS`; nothing outlives the with block. sabotage: Python that is run before, in that process."""
    config = str(bench.config(**settings.pop("changes", {})))
    command = [*PROGRAM]
    if sabotage:
        command = [
            sys.executable,
            "-W",
            "ignore",
            "-c",
            f"{sabotage}\nfrom rw_ekf.cli import main\nraise SystemExit(main())",
        ]
    command += ["run", "--config", config, "--log-format", "json", *options]
    with (bench.directory / "errors.txt").open("a") as errors:
        process = subprocess.Popen(
            command, stdout=subprocess.DEVNULL, stderr=errors, text=True, cwd=ROOT, start_new_session=True, **settings
        )
        try:
            yield Running(bench, config, process, errors)
        finally:
            for number in (process.pid, *_children(process.pid)):
                kill(number)
            process.wait()


def _children(pid: int) -> list[int]:
    try:
        return [int(n) for n in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]
    except OSError:
        return []


def kill(pid: int, number: signal.Signals = signal.SIGKILL) -> None:
    """Signal a process; nothing where there is none."""
    try:
        os.kill(pid, number)
    except ProcessLookupError:
        return


def is_there(pid: int) -> bool:
    """Whether a process of that number runs."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] not in "ZX"
    except OSError:
        return False
