"""Files that are whole or not there, in a directory where others have put things."""

from __future__ import annotations

import os
import secrets
from pathlib import Path

import pytest

from rw_ekf.errors import BadInputError
from rw_ekf.logs.atomic import atomic_path, write_text
from rw_ekf.logs.writer import RowWriter


def test_what_a_daemon_writes_replaces_a_link(tmp_path: Path) -> None:
    """follow=False: a link planted at the place is replaced by the file, what it led to stays; so does a pipe."""
    victim, place, pipe = tmp_path / "victim", tmp_path / "state.json", tmp_path / "pipe.json"
    victim.write_text("precious")
    place.symlink_to(victim)
    os.mkfifo(pipe)
    for path in (place, pipe):
        write_text(path, "new", follow=False)
        assert not path.is_symlink()
        assert path.read_text() == "new"
    assert victim.read_text() == "precious"


def test_a_link_of_ones_own_is_followed(tmp_path: Path) -> None:
    """A result that is named by a link goes where it leads, and the link stays."""
    (tmp_path / "deep").mkdir()
    (tmp_path / "out.csv").symlink_to("deep/middle.csv")
    (tmp_path / "deep" / "middle.csv").symlink_to("end.csv")
    write_text(tmp_path / "out.csv", "new")
    assert (tmp_path / "out.csv").is_symlink()
    assert (tmp_path / "deep" / "end.csv").read_text() == "new"


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can give a link away")
def test_a_link_of_another_user_is_not_followed(tmp_path: Path) -> None:
    """One sentence, and what it led to stays."""
    victim, place = tmp_path / "victim", tmp_path / "out.csv"
    victim.write_text("precious")
    place.symlink_to(victim)
    os.lchown(place, 65534, 65534)
    with pytest.raises(BadInputError, match="symbolic link of another user"):
        write_text(place, "new")
    assert victim.read_text() == "precious"


def test_the_temporary_name_is_not_the_same_twice_and_never_opened(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Names cannot be guessed; where one is guessed all the same, a link in its place is refused, not followed."""
    names = set()
    for _ in range(3):
        with atomic_path(tmp_path / "out.csv") as temporary:
            names.add(temporary.name)
    assert len(names) == 3
    victim = tmp_path / "victim"
    victim.write_text("precious")
    monkeypatch.setattr(secrets, "token_hex", lambda n: "guessed")
    (tmp_path / ".out.guessed.csv.tmp").symlink_to(victim)
    with pytest.raises(BadInputError, match="cannot be written"):
        write_text(tmp_path / "out.csv", "new")
    assert victim.read_text() == "precious"


def test_a_file_exchanged_before_the_rename_is_refused(tmp_path: Path) -> None:
    """What another program put in the place of the temporary file does not become the result."""

    def exchange() -> None:
        with atomic_path(tmp_path / "out.csv") as temporary:
            temporary.unlink()
            temporary.symlink_to("/etc/hostname")

    with pytest.raises(BadInputError, match="put something else"):
        exchange()
    assert list(tmp_path.iterdir()) == []


def test_a_new_log_follows_no_link(tmp_path: Path) -> None:
    """A link planted under the log's name, also one that leads nowhere: refused, nothing is made at its end."""
    (tmp_path / "run.csv").symlink_to(tmp_path / "victim")
    with pytest.raises(BadInputError, match="exists already"):
        RowWriter(tmp_path / "run.csv", ("a",))
    assert not (tmp_path / "victim").exists()
