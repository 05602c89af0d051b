"""The documentation does not rot: links lead somewhere, code that is named exists, figures can be drawn again."""

from __future__ import annotations

import importlib.util
import re
from pathlib import Path

import pytest

from tools.figures import DIRECTORY, FIGURES, draw

ROOT = Path(__file__).parents[1]
PAGES = [ROOT / "README.md", ROOT / "CHANGELOG.md", *sorted((ROOT / "docs").rglob("*.md"))]
SOURCES = [path for top in ("rw_ekf", "drivers", "tools", "tests", "config") for path in (ROOT / top).rglob("*.*")]
FOLDERS = r"(?:rw_ekf|drivers|tools|tests|config|docs)"


def prose(page: Path) -> str:
    """A page without its fenced blocks."""
    return re.sub(r"^```.*?^```", "", page.read_text(encoding="utf-8"), flags=re.MULTILINE | re.DOTALL)


def anchors(page: Path) -> set[str]:
    """What GitHub makes of a page's headings."""
    headings = re.findall(r"^#+ (.*)$", prose(page), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


def is_there(target: str, at: Path) -> bool:
    """Whether a relative link, with or without an anchor, leads from `at` to a file and a heading in it."""
    name, _, anchor = target.partition("#")
    path = (at.parent / name).resolve() if name else at
    return path.exists() and (not anchor or anchor in anchors(path))


@pytest.mark.parametrize("page", PAGES, ids=lambda path: str(path.relative_to(ROOT)))
def test_every_link_leads_somewhere(page: Path) -> None:
    """Relative links and pictures name a file that exists, and a heading in it."""
    targets = re.findall(r"\]\(([^)\s]+)\)", prose(page))
    assert [t for t in targets if not t.startswith(("http:", "https:")) and not is_there(t, page)] == []


@pytest.mark.parametrize("page", PAGES, ids=lambda path: str(path.relative_to(ROOT)))
def test_the_code_that_a_page_names_exists(page: Path) -> None:
    """Paths, bare module names, and modules to run with `python -m`; ID stands for any effect."""
    text = page.read_text(encoding="utf-8")
    missing = [
        name
        for name in re.findall(rf"(?<![\w/.-]){FOLDERS}/[\w/.*-]*[\w/*]", text)
        if not any(ROOT.glob(name.replace("ID", "*").rstrip("/")))
    ]
    names = {path.name for path in SOURCES}
    missing += [name for name in re.findall(r"`([a-z]\w*\.py)`", text) if name not in names]
    missing += [name for name in re.findall(r"python -m (tools[\w.]*)", text) if importlib.util.find_spec(name) is None]
    assert missing == []


def test_the_pages_that_the_code_names_exist() -> None:
    """Pages, and headings behind a #, in docstrings, comments and messages."""
    missing = []
    for path in SOURCES:
        if path.suffix in {".py", ".yaml"}:
            found = re.findall(r"docs/[\w/-]+\.md(?:#[\w-]+)?", path.read_text(encoding="utf-8"))
            missing += [(path.name, name) for name in found if not is_there(name, ROOT / "README.md")]
    assert missing == []


def test_every_page_is_in_the_index() -> None:
    """docs/README.md leads to each page of docs/."""
    index = (ROOT / "docs" / "README.md").read_text(encoding="utf-8")
    pages = {path.name for path in (ROOT / "docs").glob("*.md")} - {"README.md"}
    assert {name for name in pages if f"]({name}" not in index} == set()


def test_every_folder_of_code_is_in_the_index() -> None:
    """docs/README.md says of each folder of the program what is inside."""
    index = (ROOT / "docs" / "README.md").read_text(encoding="utf-8")
    there = {
        str(path.parent.relative_to(ROOT))
        for top in ("rw_ekf", "drivers", "tools")
        for path in ROOT.glob(f"{top}/*/__init__.py")
        if not path.parent.is_symlink()
    }
    assert set(re.findall(r"^\| `([\w/]+)/` \|", index, re.MULTILINE)) == there


def test_the_figures_can_be_drawn_again(tmp_path: Path) -> None:
    """Each figure is drawn without a word, is small, stands in docs/figures, and is shown on a page."""
    shown = "".join(page.read_text(encoding="utf-8") for page in PAGES)
    drawn = draw(tmp_path)
    assert {path.name for path in drawn} == {path.name for path in DIRECTORY.iterdir()}
    assert len(drawn) == len(FIGURES)
    for path in drawn:
        assert 1_000 < path.stat().st_size < 60_000
        assert f"figures/{path.name})" in shown
