"""The page of a run that is just being started: a process beside it, which ends with it."""

from __future__ import annotations

import contextlib
import importlib.util
import os
import subprocess
import sys
from collections.abc import Collection, Iterator

from rw_ekf.errors import BadInputError

_ENDS_WITHIN_S = 60.0  # as long as its button waits for `rw-ekf stop`, which ended the run; else in a second


@contextlib.contextmanager
def page_beside(folders: Collection[str], config: str, listen: str | None) -> Iterator[None]:
    """Serve the runs of folders while the block lasts; nothing for no place to listen at.

    Its address goes to standard error. Raises BadInputError where what serves it is not installed; a page that fails
    later says so there, and the run continues.
    """
    if listen is None:
        yield
        return
    if any(importlib.util.find_spec(module) is None for module in ("starlette", "uvicorn")):
        raise BadInputError('--view: what serves the page is not installed: pip install "rw-ekf[view]"')
    for folder in folders:
        os.makedirs(folder, exist_ok=True)
    command = [sys.executable, "-m", "rw_ekf", "view", *folders, "--config", config, "--listen", listen, "--of-run"]
    ours = os.getpid()
    child = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=sys.stderr.fileno(), start_new_session=True)
    try:
        yield
    finally:
        if os.getpid() == ours:  # a run that a supervisor has forked leaves the page to it
            child.terminate()
            with contextlib.suppress(subprocess.TimeoutExpired):
                child.wait(_ENDS_WITHIN_S)
            if child.poll() is None:
                child.kill()
                child.wait()
