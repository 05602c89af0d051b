"""No command writes over what it reads."""

from __future__ import annotations

from pathlib import Path

import pytest

from rw_ekf.cli import main
from tests.commands.logs import profile_log


@pytest.mark.parametrize(
    "command",
    [
        ("replay", "LOG", "--out", "LOG"),
        ("replay", "LOG", "--picture", "LOG"),
        ("fit", "LOG", "--out", "LOG"),
        ("export", "LOG", "LOG"),
    ],
)
def test_a_log_is_not_written_over_by_what_reads_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], command: tuple[str, ...]
) -> None:
    """Output named like the input: exit status 2, a sentence with the file's name, and the log as it was."""
    log = profile_log(tmp_path / "run.csv", samples=300)
    before = log.read_bytes()
    assert main([str(log) if word == "LOG" else word for word in command]) == 2
    assert "run.csv: is also read" in capsys.readouterr().err
    assert log.read_bytes() == before
