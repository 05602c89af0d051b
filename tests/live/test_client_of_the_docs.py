"""The Python client of docs/compensation-on-the-wheel.md, as it stands there, against a daemon on a pty."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

from tests.live.bench import ROOT, served_wheel, wait_for
from tests.live.daemon import Notes, run

PAGE = ROOT / "docs" / "compensation-on-the-wheel.md"


def test_the_client_of_the_docs_drives_a_wheel(tmp_path: Path) -> None:
    """Ten lines of Python, copied from the page: the wheel is asked for 300 rpm, and the client ends with the run."""
    (text,) = re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    assert len([line for line in text.splitlines() if line]) <= 10
    script, path, notes = tmp_path / "client.py", tmp_path / "s", Notes()
    script.write_text(text)
    clients: list[subprocess.Popen[str]] = []

    def connect() -> None:
        command = [sys.executable, str(script), str(path)]
        clients.append(subprocess.Popen(command, stderr=subprocess.PIPE, text=True))

    def driven() -> None:
        wait_for(lambda: any(current_A > 0.03 for current_A in bench.recorder.writes_A()))

    compensation = {"scheme": "pid_current", "socket": str(path)}
    with served_wheel(tmp_path) as bench:
        events = ((0.2, connect), (0.3, driven))
        run(bench, 4.0, *events, notes=notes, command={"profile": "zero"}, compensation=compensation)
    _, stated = clients[0].communicate(timeout=60.0)
    assert clients[0].returncode == 0 or "BrokenPipeError" in stated, stated  # it was about to ask when the run ended
    assert notes.events.count("request_client") == 1
    assert "request_refused" not in notes.events
    assert max(bench.recorder.writes_A()) > 0.03
