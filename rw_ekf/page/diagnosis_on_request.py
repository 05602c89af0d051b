"""A run's report, one click from its page: the diagnosis of its log, made when it is requested and kept beside it."""

from __future__ import annotations

import secrets
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import IO, Any

from rw_ekf.logs.parts import beside

_MOST_TICKETS = 50
_VALID_S = 3600.0  # a page that stands open for longer requests again
_ENDS_WITHIN_S = 1.0  # else it is killed: a diagnosis keeps nothing that a second would save
_WORDS = 600  # of what a diagnosis that failed has printed


def report_path(log: Path) -> Path:
    """Where a run's report is, whether there is one or not."""
    return beside(log, "report") / "report.html"


class Reports:
    """Makes one report at a time, in a process of its own; hands out links to those that there are."""

    def __init__(self) -> None:
        self._child: subprocess.Popen[bytes] | None = None
        self._stated: IO[str] | None = None
        self._of: Path | None = None
        self._failed: dict[Path, str] = {}
        self._tickets: dict[str, tuple[Path, float]] = {}

    def begin(self, log: Path) -> None:
        """Begin to diagnose a run's log, unless a report is being made."""
        self._look()
        if self._child is None:
            self._failed.pop(log, None)
            self._of = log
            command = [sys.executable, "-m", "rw_ekf", "diagnose", str(log), "--out", str(report_path(log).parent)]
            self._stated = tempfile.TemporaryFile("w+", errors="replace")  # noqa: SIM115 - read when it has ended
            self._child = subprocess.Popen(
                command,
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=self._stated,
                start_new_session=True,
            )

    def state(self, log: Path) -> dict[str, Any]:
        """What there is of a run's report: `ready` with a link, `working`, `failed` with the reason, or `none`."""
        self._look()
        if self._child is not None and self._of == log:
            return {"report": "working"}
        if log in self._failed:
            return {"report": "failed", "text": self._failed[log]}
        path = report_path(log)
        return {"report": "ready", "link": f"report/{self._ticket(path)}"} if path.is_file() else {"report": "none"}

    def file(self, ticket: str) -> Path | None:
        """The report that a link is to; None for a link that never was, or is over."""
        path, until_s = self._tickets.get(ticket, (None, 0.0))
        return path if path is not None and time.monotonic() < until_s and path.is_file() else None

    def close(self) -> None:
        """End what is being made."""
        if self._child is not None and self._child.poll() is None:
            self._child.terminate()
            try:
                self._child.wait(_ENDS_WITHIN_S)
            except subprocess.TimeoutExpired:
                self._child.kill()
                self._child.wait()

    def _look(self) -> None:
        if self._child is None or self._of is None or self._stated is None or self._child.poll() is None:
            return
        with self._stated as stated:
            stated.seek(0)
            if self._child.returncode != 0:
                self._failed[self._of] = stated.read().strip()[-_WORDS:] or f"exit status {self._child.returncode}"
        self._child = self._of = None

    def _ticket(self, path: Path) -> str:
        """A name for a report in an address: a browser that follows a link sends no token."""
        now_s = time.monotonic()
        kept = [(name, item) for name, item in self._tickets.items() if item[1] > now_s]
        for name, (known, until_s) in kept:
            if known == path and until_s > now_s + 0.5 * _VALID_S:
                return name
        self._tickets = dict(kept[-_MOST_TICKETS + 1 :])
        ticket = secrets.token_urlsafe(16)
        self._tickets[ticket] = (path, now_s + _VALID_S)
        return ticket
