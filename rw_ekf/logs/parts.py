"""The parts of a run's log: STEM.csv, STEM.part002.csv, ..., each as it was written or compressed since.

STEM.csv names the run: all its parts, whatever form each of them has. The directory of a bag of ROS 2 names its files.
Every other name is that file and no other.
"""

from __future__ import annotations

import os
import re
from dataclasses import dataclass
from pathlib import Path

FORMS = (".csv", ".csv.zst", ".csv.gz", ".parquet")  # of a part; where there are two, the first is read
_ESTIMATES = ".estimates"
_PART = re.compile(
    r"(?P<stem>.+?)(?:\.part(?P<number>\d{3,}))?(?P<kind>\.estimates)?(?P<form>\.csv(?:\.zst|\.gz)?|\.parquet)"
)


@dataclass(frozen=True)
class PartName:
    """What the name of a part says."""

    stem: str  # of the run
    number: int  # from 1
    estimates: bool  # else the log
    form: str  # one of FORMS

    @classmethod
    def of(cls, name: str) -> PartName | None:
        """Take a file's name apart; None where it can be no part of anything. A first part bears no number."""
        match = _PART.fullmatch(name)
        if match is None:
            return None
        number = int(match["number"] or 1)
        return cls(match["stem"], number, match["kind"] is not None, match["form"])


def stem_of(path: str | Path) -> Path:
    """Path of a run without what distinguishes its files: runs/STEM.part002.csv.zst -> runs/STEM."""
    path = Path(path)
    name = PartName.of(path.name)
    return path.with_suffix("") if name is None else path.with_name(name.stem)


def beside(log: str | Path, ending: str) -> Path:
    """Path of another file of a log's run: runs/STEM.part002.csv.zst, "meta.yaml" -> runs/STEM.meta.yaml."""
    stem = stem_of(log)
    return stem.with_name(f"{stem.name}.{ending}")


def part_path(first: Path, number: int) -> Path:
    """Name a part of the log, or of the estimates, whose first part is `first`."""
    name = PartName.of(first.name)
    if number == 1 or name is None:
        return first
    return first.with_name(f"{name.stem}.part{number:03d}{_ESTIMATES if name.estimates else ''}{name.form}")


@dataclass(frozen=True)
class Parts:
    """The files that a path names, in the order they were written."""

    files: tuple[Path, ...]
    warnings: tuple[str, ...] = ()


def parts_of(path: Path) -> Parts:
    """Find the files that `path` names: those of a run or a bag, else `path` alone, be it there or not."""
    if bag := files_of_bag(path):
        return Parts(bag)
    if path in (bag := files_of_bag(path.parent)) and len(bag) > 1:
        return Parts((path,), (f"{path}: is one of {len(bag)} files of a bag: {path.parent} stands for them all",))
    wanted = PartName.of(path.name)
    if wanted is None or not path.name:
        return Parts((path,))
    found = _beside(path, wanted)
    if wanted.form != FORMS[0] or wanted.number > 1:
        others = len(found) - (wanted.number in found)
        stated = (
            f"{path}: is part {wanted.number} of {others + 1} of a run: its first part named .csv stands for them all"
        )
        return Parts((path,), (stated,) if others and path.exists() else ())
    if not found:
        return Parts((path,))
    return Parts(tuple(found[number] for number in sorted(found)))


def files_of_bag(directory: Path) -> tuple[Path, ...]:
    """The files of a bag of ROS 2 in the order in which they were recorded; none where a directory holds no bag."""
    if not (directory / "metadata.yaml").is_file():
        return ()
    found = [path for form in ("*.db3", "*.mcap") for path in directory.glob(form)]
    return tuple(sorted(found, key=lambda path: (len(path.name), path.name)))  # bag_9 before bag_10


def _beside(path: Path, wanted: PartName) -> dict[int, Path]:
    """Each part of the same run and kind in that directory, by number."""
    found: dict[int, Path] = {}
    try:
        with os.scandir(path.parent) as entries:
            names = [entry.name for entry in entries if entry.name.startswith(wanted.stem)]
    except OSError:
        return found
    for name in names:
        part = PartName.of(name)
        if part is None or (part.stem, part.estimates) != (wanted.stem, wanted.estimates):
            continue
        here = found.get(part.number)
        if here is None or FORMS.index(part.form) < FORMS.index(_form(here)):
            found[part.number] = path.with_name(name)
    return found


def _form(path: Path) -> str:
    name = PartName.of(path.name)
    assert name is not None
    return name.form
