"""What has been found so far, in commission.json of the output directory: a rerun continues after the last step."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from rw_ekf.errors import ConfigError
from rw_ekf.json_output import json_text
from rw_ekf.logs.atomic import make_folder, write_text
from rw_ekf.plain_file import read_plain

SCHEMA = "rw_ekf.commission/1"
DOCUMENT = "commission.json"
STEPS = ("find", "limits", "still", "sign", "delay", "identification", "model")
_MOST_BYTES = 1_000_000


class Progress:
    """Findings by step, each written to the disk as it is made."""

    def __init__(self, directory: Path, content: Mapping[str, Any] | None = None) -> None:
        self.directory = directory
        self._content: dict[str, Any] = {"schema": SCHEMA, "wheel_s": 0.0, "done": False, "files": None}
        self._content |= dict.fromkeys(STEPS) | dict(content or {})

    @classmethod
    def of(cls, directory: Path) -> Progress:
        """Go on from what stands there, or begin. Raises BadInputError, ConfigError for a file that is none of ours."""
        make_folder(directory)
        path = directory / DOCUMENT
        if not path.exists():
            return cls(directory)
        try:
            content = json.loads(read_plain(path, _MOST_BYTES))
        except (OSError, ValueError, RecursionError) as error:
            raise ConfigError(f"{path}: cannot be read ({error}): remove it to begin anew") from None
        if not _is_ours(content):
            raise ConfigError(f"{path}: is no {SCHEMA} document: remove it, or name another --out")
        return cls(directory, content)

    def __getitem__(self, step: str) -> Any:
        return self._content[step]

    def keep(self, step: str, finding: object) -> None:
        """Note a finding, on the disk before anything continues. Raises BadInputError where it cannot be written."""
        self._content[step] = finding
        write_text(self.directory / DOCUMENT, json_text(self._content))

    def forget_from(self, step: str) -> None:
        """What was found from that step on no longer holds."""
        self._content |= dict.fromkeys(STEPS[STEPS.index(step) :]) | {"done": False, "files": None}

    def spent(self, seconds: float) -> None:
        """Count the time at the wheel."""
        self._content["wheel_s"] += seconds

    def document(self) -> dict[str, Any]:
        """All of it."""
        return dict(self._content)


def _is_ours(content: object) -> bool:
    if not isinstance(content, dict) or content.get("schema") != SCHEMA:
        return False
    steps = all(content.get(step) is None or isinstance(content[step], dict) for step in STEPS)
    number = isinstance(content.get("wheel_s"), int | float)
    return steps and number and isinstance(content.get("files"), dict | None) and isinstance(content.get("done"), bool)
