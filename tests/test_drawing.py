"""Pictures do not depend on what matplotlib was told elsewhere, and what they show does not depend on them."""

from __future__ import annotations

import os
from pathlib import Path

import matplotlib as mpl
import pytest

from rw_ekf.drawing import picture
from rw_ekf.errors import BadInputError, PictureError
from tests.commands.logs import profile_log
from tests.live.bench import ROOT, document_of, rw_ekf

BACKENDS = ("module://matplotlib_inline.backend_inline", "module://nowhere", "nosuch")


def test_texts_and_defaults_are_matplotlib_s_own_within_a_picture_only() -> None:
    """A user's LaTeX and line width do not reach into a picture, and stand again after it; a dollar is a dollar."""

    @picture
    def drawn() -> tuple[bool, float, bool]:
        return tuple(mpl.rcParams[key] for key in ("text.usetex", "lines.linewidth", "text.parse_math"))

    with mpl.rc_context({"text.usetex": True, "lines.linewidth": 9.0}):
        assert drawn() == (False, 1.5, False)
        assert (mpl.rcParams["text.usetex"], mpl.rcParams["lines.linewidth"]) == (True, 9.0)


def test_whatever_matplotlib_fails_of_is_one_sentence() -> None:
    """Any exception becomes a PictureError of one line; what the user can mend stays what it is."""

    @picture
    def fails(error: Exception) -> None:
        raise error

    with pytest.raises(PictureError, match=r"^the picture cannot be drawn \(ValueError: no\)$"):
        fails(ValueError("no\nand more of it"))
    with pytest.raises(BadInputError, match="a full disk"):
        fails(BadInputError("a full disk"))


@pytest.mark.parametrize("backend", BACKENDS)
def test_a_backend_that_is_not_there_is_not_asked_for(tmp_path: Path, backend: str) -> None:
    """A notebook's MPLBACKEND, inherited: the picture is drawn and not a word said."""
    out = tmp_path / "plan.png"
    done = rw_ekf("flyby", "--rates", "500,500,500", "--out", str(out), env={**os.environ, "MPLBACKEND": backend})
    assert (done.returncode, done.stderr) == (0, "")
    assert out.read_bytes().startswith(b"\x89PNG")


def test_a_picture_that_cannot_be_drawn_costs_the_picture_alone(tmp_path: Path) -> None:
    """With a matplotlibrc that is no text: status 1, one sentence, the table and the document as without a picture."""
    log, out = profile_log(tmp_path / "log.csv", samples=300), tmp_path / "rows.csv"
    (tmp_path / "matplotlibrc").write_bytes(b"\xff\xfe: 3\n")
    env = {**os.environ, "MATPLOTLIBRC": str(tmp_path)}
    options = ("--out", str(out), "--picture", str(tmp_path / "run.png"), "--json")
    done = rw_ekf("replay", str(log), *options, env=env)
    assert done.returncode == 1
    stated, sentence = done.stderr.splitlines()  # the first is matplotlib's own, and names the file
    assert str(tmp_path / "matplotlibrc") in stated
    assert sentence.startswith("rw-ekf: error: the picture cannot be drawn (UnicodeDecodeError")
    assert document_of(done.stdout)["logs"][0]["samples"] == 300
    assert sorted(path.name for path in tmp_path.iterdir()) == ["log.csv", "matplotlibrc", "rows.csv"]


def test_without_matplotlib_all_but_the_picture_is_as_it_was(tmp_path: Path) -> None:
    """A machine that has none: the table is printed, one sentence says what is not installed, status 1."""
    log = profile_log(tmp_path / "log.csv", samples=300)
    (tmp_path / "matplotlib.py").write_text("raise ModuleNotFoundError('no', name='matplotlib')\n", encoding="utf-8")
    env = {**os.environ, "PYTHONPATH": os.pathsep.join((str(tmp_path), str(ROOT)))}
    done = rw_ekf("replay", str(log), "--picture", str(tmp_path / "run.png"), env=env)
    assert done.returncode == 1
    assert "motor_gain" in done.stdout
    assert "the picture cannot be drawn: matplotlib is not installed: pip install matplotlib;" in done.stderr
    assert rw_ekf("replay", str(log), env=env).returncode == 0


@pytest.mark.parametrize(
    ("error", "words"),
    [
        (ModuleNotFoundError("no", name="matplotlib"), "matplotlib is not installed: pip install matplotlib"),
        (
            ImportError("libpng.so: cannot open", name="matplotlib._path"),
            r"matplotlib is damaged \(libpng.so: cannot open\): pip install --force-reinstall matplotlib",
        ),
        (ImportError("no symbol"), r"matplotlib is damaged \(no symbol\): pip install --force-reinstall matplotlib"),
        (
            ModuleNotFoundError("No module named 'PIL._imaging'", name="PIL._imaging"),
            "pip install --force-reinstall pillow",
        ),
    ],
)
def test_what_cannot_be_imported_is_told_with_what_to_install(error: ImportError, words: str) -> None:
    """Whether the package is not there or is a broken one: its name, and the command of pip that mends it."""

    @picture
    def fails() -> None:
        raise error

    with pytest.raises(PictureError, match=f"the picture cannot be drawn: .*{words}$"):
        fails()
