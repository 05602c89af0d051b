"""Where the files of a fleet are: `FleetFolder`.

index.json                                         the logs, by wheel and time (`rw_ekf.fleet.index`)
manifest.jsonl                                     what was done (`rw_ekf.fleet.manifest`)
results/wheel=W/day=2026-01-31/part-HASH.parquet   a row for each day of a log (`rw_ekf.fleet.result_rows`)
diagnoses.json                                     windows that were diagnosed (`rw_ekf.fleet.diagnoses`)
diagnoses/wheel=W/day=2026-01-31/diagnosis-HASH.*  each one's document, and the model it found
trends.json, fleet.html                            what `trends` and `view` make of them
"""

from __future__ import annotations

import contextlib
import fcntl
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from urllib.parse import quote

from rw_ekf.errors import BadInputError
from rw_ekf.logs.atomic import make_folder

NAME = "fleet"
_HASH_DIGITS = 20  # of a sha256 in a file's name: 80 bits, which no 1e9 files of one fleet share by chance


class FleetFolder:
    """The folder of a fleet."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.index = path / "index.json"  # the logs
        self.manifest = path / "manifest.jsonl"  # what was done
        self.results = path / "results"  # the root of the partitions
        self.diagnoses = path / "diagnoses"  # the root of the diagnosed windows
        self.diagnosed = path / "diagnoses.json"  # the document of `diagnose`
        self.trends = path / "trends.json"  # the document of `trends`
        self.page = path / "fleet.html"  # the page of `view`

    @contextmanager
    def locked(self) -> Iterator[None]:
        """While this lasts, nobody else runs this fleet. Raises BadInputError where somebody does."""
        make_folder(self.path)
        descriptor = os.open(self.path / ".lock", os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o666)
        try:
            try:
                fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                raise BadInputError(
                    f"{self.path}: another `fleet run` or `diagnose` is at work here: wait for its end"
                ) from None
            except OSError:  # a network file system without locks: two runs write the same files with the same bytes
                pass
            yield
        finally:
            with contextlib.suppress(OSError):
                os.close(descriptor)


def fleet_folder(directory: str | Path, out: str | Path | None = None) -> FleetFolder:
    """The fleet's folder of a directory of logs, or that directory itself where it is one already."""
    here = Path(directory)
    if out is not None:
        return FleetFolder(Path(out))
    return FleetFolder(here) if (here / "index.json").is_file() else FleetFolder(here / NAME)


def part_path(results: str | Path, wheel: str, day: str, input_hash: str) -> Path:
    """Where a log's rows of one day stand."""
    return _of_day(results, wheel, day) / f"part-{input_hash[:_HASH_DIGITS]}.parquet"


def diagnosis_path(diagnoses: str | Path, wheel: str, day: str, input_hash: str) -> Path:
    """Where the document of a diagnosed window stands."""
    return _of_day(diagnoses, wheel, day) / f"diagnosis-{input_hash[:_HASH_DIGITS]}.json"


def _of_day(root: str | Path, wheel: str, day: str) -> Path:
    return Path(root) / f"wheel={quote(wheel, safe='')}" / f"day={day}"
