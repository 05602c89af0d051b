"""The documentation as a site: it builds without a warning, its notebooks run, and its pages need no network."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from tests.live.bench import ROOT

FETCHED = re.compile(r"""<(?:script|img|link|iframe|source)\b[^>]*\b(?:src|href)=["'](https?:[^"']*)""")


@pytest.mark.slow
def test_the_site_builds_with_its_notebooks_and_fetches_nothing(tmp_path: Path) -> None:
    """Warnings are errors; what notebooks assert holds; no page has a script, a picture or a style from elsewhere."""
    site = tmp_path / "site"
    config = ROOT / "tools" / "site" / "mkdocs.yml"
    done = subprocess.run(
        [sys.executable, "-m", "mkdocs", "build", "-q", "-f", str(config), "-d", str(site)],
        capture_output=True, text=True, check=False, cwd=ROOT, env={**os.environ, "NO_MKDOCS_2_WARNING": "1"},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr[-3000:]
    pages = {path.relative_to(site).as_posix(): path.read_text(encoding="utf-8") for path in site.rglob("*.html")}
    assert [(name, found) for name, text in pages.items() for found in FETCHED.findall(text)] == []
    for name in ("first-steps", "foreign-log", "gallery"):
        assert "data:image/png;base64" in pages[f"notebooks/{name}.html"]
    assert "<math" in pages["model.html"]
    assert "rw_ekf.diagnose" in pages["api.html"]
    assert "rw-ekf compare" in pages["commands.html"]
    assert (site / "search" / "search_index.js").exists()
