"""Compresses closed parts of a log in a process of its own: the loop and its memory do not notice."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

from rw_ekf.sinks.run_files import Note

_CHILD = """
import json, sys
sys.path[:], names = json.loads(sys.argv[1])
from rw_ekf.logs.part_compression import main
sys.exit(main(names))
"""
_CLOSE_WITHIN_S = 5.0
_END_WITHIN_S = 1.0


class Packer:
    """One process at a time. What cannot be compressed stays as it is, and reads all the same."""

    def __init__(self, note: Note, close_within_s: float = _CLOSE_WITHIN_S) -> None:
        """note: called for parts that stay plain. close_within_s: how long those at work are waited for at the end."""
        self._note = note
        self._close_within_s = close_within_s
        self._waiting: list[Path] = []
        self._parts: list[Path] = []  # those at work
        self._child: subprocess.Popen[bytes] | None = None

    def pack(self, parts: list[Path]) -> None:
        """Compress parts as soon as those before them are done."""
        self._waiting += parts
        self.look()

    def look(self) -> bool:
        """See whether the parts at work are done and begin with those that wait; False where there is nothing to do."""
        if self._child is not None and self._child.poll() is not None:
            if self._child.returncode != 0:
                self._say(f"exit status {self._child.returncode}")
            self._child = None
        if self._child is None and self._waiting:
            self._parts, self._waiting = self._waiting, []
            names = [str(part.absolute()) for part in self._parts]
            try:
                self._child = subprocess.Popen(
                    [sys.executable or "python3", "-P", "-c", _CHILD, json.dumps([sys.path, names])],
                    start_new_session=True,  # Ctrl-C is for the daemon; what was begun here is ended
                    stdin=subprocess.DEVNULL,
                    stdout=subprocess.DEVNULL,
                    stderr=subprocess.DEVNULL,
                )
            except OSError as error:
                self._say(error.strerror or str(error))
        return self._child is not None

    def close(self) -> None:
        """Wait a little for what is left to do, then end it: what is not done by then stays plain."""
        for _ in range(2):  # those at work, and those that wait
            if not self.look() or self._child is None:
                return
            try:
                self._child.wait(self._close_within_s)
            except subprocess.TimeoutExpired:
                break
        self._end()

    def _end(self) -> None:
        child, self._child, self._waiting = self._child, None, []
        if child is None:
            return
        child.terminate()
        try:
            child.wait(_END_WITHIN_S)
        except subprocess.TimeoutExpired:
            child.kill()
            child.wait()

    def _say(self, reason: str) -> None:
        left = [part.name for part in self._parts if part.exists()]
        if left:
            self._note("not_compressed", files=", ".join(left), reason=reason, do="they stay as they are, and read")
