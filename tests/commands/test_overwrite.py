"""No command writes over what it reads."""

from __future__ import annotations

from pathlib import Path

import pytest

from rw_ekf.cli import main
from rw_ekf.logs.part_compression import pack
from rw_ekf.logs.parts import part_path
from tests.commands.logs import profile_log


@pytest.mark.parametrize(
    "command",
    [
        ("replay", "LOG", "--out", "LOG"),
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


def test_no_part_of_a_log_is_written_over_nor_its_name_taken(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A run whose first part is compressed: neither another part nor the run's own name can be written to."""
    log = profile_log(tmp_path / "run.csv", samples=300)
    second = part_path(log, 2)
    second.write_bytes(log.read_bytes())
    pack(log)
    before = second.read_bytes()
    for out in (log, second):
        assert main(["export", str(log), str(out)]) == 2
        assert f"{out.name}: is also read" in capsys.readouterr().err
    assert second.read_bytes() == before
    assert not log.exists()
