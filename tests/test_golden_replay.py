"""Golden replay: a change of any number of the filter shows up in review.

These numbers prove "unchanged", not "right"; tests/filter/ and tests/identify/ prove right. To accept a change:
`pytest tests/test_golden_replay.py --refresh-golden`, in a commit of its own that says why.
"""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rw_ekf.cli import main
from tests.commands.documents import replay_document
from tests.commands.logs import write_log
from tests.truth import run_of

GOLDEN = Path(__file__).parent / "golden"
RTOL = 1e-6  # across processors and compilers; a sigma is never known that well
SKIPPED = {"log", "seconds"}
# The log is made here, from a seed, of operations that IEEE arithmetic fixes; its readings are put on the wire's grid.
HEADER = "time_s,speed_rad_s,current_command_A,command_delay_s,segment"


def golden_log(path: Path, profile: str, seed: int) -> Path:
    """Two minutes with late commands, gaps, a spike and a new segment."""
    run, n = run_of(profile, seed), 1200
    speed = np.round(run.reading_rad_s[:n] / (np.pi / 60.0)) * (np.pi / 60.0)
    speed[300:305] = np.nan
    speed[450] += 40.0
    delay = 0.008 + 0.004 * (np.arange(n, dtype=np.float64) % 3)
    segment = (np.arange(n) >= 800).astype(np.float64)
    time_s = np.round(run.time_s[:n] - 60.0 * segment, 6)
    return write_log(path, [time_s, speed, run.current_A[:n], delay, segment], HEADER)


def difference(expected: Any, found: Any, place: str = "") -> str | None:
    """Where two documents first differ, in words; None where they agree."""
    if isinstance(expected, dict) and isinstance(found, dict):
        if list(expected) != list(found):
            return f"{place}: keys {list(expected)} became {list(found)}"
        pairs = [(f"{place}.{key}".lstrip("."), expected[key], found[key]) for key in expected]
    elif isinstance(expected, list) and isinstance(found, list):
        if len(expected) != len(found):
            return f"{place}: {len(expected)} items became {len(found)}"
        pairs = [(f"{place}[{i}]", *both) for i, both in enumerate(zip(expected, found, strict=True))]
    elif isinstance(expected, float) and isinstance(found, int | float):
        same = math.isclose(expected, found, rel_tol=RTOL, abs_tol=1e-15)
        return None if same else f"{place}: {expected!r} became {found!r}"
    else:
        return None if expected == found else f"{place}: {expected!r} became {found!r}"
    return next((stated for where, one, two in pairs if (stated := difference(one, two, where))), None)


def without(document: Any, names: set[str]) -> Any:
    """The document without what depends on place and time."""
    if isinstance(document, dict):
        return {key: without(value, names) for key, value in document.items() if key not in names}
    if isinstance(document, list):
        return [without(item, names) for item in document]
    return document


@pytest.mark.parametrize(("profile", "seed"), [("P1", 11), ("P2", 12), ("S2", 13)])
def test_replay_says_what_it_always_said(
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    pytestconfig: pytest.Config,
    profile: str,
    seed: int,
) -> None:
    """Every number of the document agrees with the committed one; the first that does not is named."""
    log = golden_log(tmp_path / "log.csv", profile, seed)
    assert main(["replay", str(log), "--json"]) == 0
    found = without(replay_document(capsys.readouterr().out), SKIPPED)
    path = GOLDEN / f"replay_{profile}_{seed}.json"
    if pytestconfig.getoption("--refresh-golden"):
        GOLDEN.mkdir(exist_ok=True)
        path.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")
        pytest.skip(f"{path.name} was written anew: commit it alone, and say why")
    stated = difference(json.loads(path.read_text(encoding="utf-8")), found)
    assert stated is None, f"{path.name}: {stated}"


def test_the_comparison_names_the_first_field_that_differs() -> None:
    """A number off by more than the tolerance, another count, another key: each is named with its place."""
    one = {"a": [1.0, {"b": 2.0}], "n": 3}
    assert difference(one, {"a": [1.0, {"b": 2.0 * (1 + 1e-9)}], "n": 3}) is None
    assert difference(one, {"a": [1.0, {"b": 2.1}], "n": 3}) == "a[1].b: 2.0 became 2.1"
    assert difference(one, {"a": [1.0, {"b": 2.0}], "n": 4}) == "n: 3 became 4"
    assert difference(one, {"a": [1.0, {"c": 2.0}], "n": 3}) == "a[1]: keys ['b'] became ['c']"
    assert difference(one, {"a": [1.0], "n": 3}) == "a: 2 items became 1"
