"""docs/contract.md as data, for tests that hold the code to it."""

from __future__ import annotations

import json
import re
from functools import cache
from pathlib import Path
from typing import Any

PAGE = Path(__file__).parents[1] / "docs" / "contract.md"
# Keys that a document may have or lack (the contract says when), and objects whose keys are the wheel's own.
OPTIONAL = {
    "logs", "threshold", "alarms", "compensation", "residual_rms_rpm", "converged", "iterations", "starts", "outliers",
    "coast_down_s", "driven_s", "break_aways", "avoid", "settle",
}  # fmt: skip
OPEN = {
    "state", "std", "effects", "parameters", "truth", "configuration", "model", "posterior", "map", "from", "not_sent",
}  # fmt: skip


@cache
def section(title: str) -> str:
    """The text under a heading of the contract, up to the next of its level."""
    text = PAGE.read_text(encoding="utf-8")
    found = re.search(rf"^(##+) {re.escape(title)}\n(.*?)(?=^\1 |\Z)", text, re.MULTILINE | re.DOTALL)
    assert found is not None, f"no section {title!r}"
    return found[2]


def rows(title: str) -> list[list[str]]:
    """Cells of the table rows of a section, headers and rules left out."""
    tables = re.findall(r"(?:^\|.*\n)+", section(title), re.MULTILINE)
    lines = [line for table in tables for line in table.splitlines()[2:]]
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in lines]


def quoted(text: str) -> list[str]:
    """What stands in backticks."""
    return re.findall(r"`([^`]+)`", text)


@cache
def examples(schema: str) -> list[dict[str, Any]]:
    """The example documents of a schema."""
    found = [json.loads(text) for text in re.findall(r"```json\n(.*?)```", section("Documents"), re.DOTALL)]
    return [example for example in found if example["schema"] == schema]


def check_document(document: dict[str, Any]) -> None:
    """A document has the keys that the contract shows for its schema, at every depth."""
    shown = examples(document["schema"])
    assert shown, f"{document['schema']} is not in the contract"
    stated = [strangers(document, example) for example in shown]
    assert [] in stated, stated


def strangers(found: Any, example: Any, at: str = "") -> list[str]:
    """Keys that one of the two has and the other lacks."""
    if isinstance(found, dict) and isinstance(example, dict):
        wrong = [f"{at}.{key}" for key in (found.keys() ^ example.keys()) - OPTIONAL]
        for key in found.keys() & example.keys() - OPEN:
            wrong += strangers(found[key], example[key], f"{at}.{key}")
        return wrong
    if isinstance(found, list) and isinstance(example, list) and example:
        return [text for item in found for text in strangers(item, example[0], f"{at}[]")]
    return []
