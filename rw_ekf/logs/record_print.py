"""A fingerprint of a record by which a log is known again, under another name, in another form, or in a longer copy."""

from __future__ import annotations

import hashlib
import math
import struct
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rw_ekf.logs.parts import stem_of

if TYPE_CHECKING:
    from rw_ekf.logs.wheel_log import WheelLog

_READINGS = 100  # noisy ones: no two records begin with a hundred of the same, at the same times
_LEAST = 10


class RecordPrint:
    """Made of the first readings that are other than the one before, with their times, one by one."""

    def __init__(self) -> None:
        self._hash = hashlib.sha256()
        self._readings = 0
        self._before: float | None = None

    def add(self, time_s: float, speed_rad_s: float | None) -> None:
        """Take the next row."""
        if self._readings == _READINGS or speed_rad_s is None or math.isnan(speed_rad_s):
            return
        if speed_rad_s != self._before:
            self._before = speed_rad_s
            self._readings += 1
            self._hash.update(struct.pack("<dd", time_s, speed_rad_s))

    @property
    def full(self) -> bool:
        """Whether more rows change nothing."""
        return self._readings == _READINGS

    @property
    def text(self) -> str | None:
        """The fingerprint; None where there is too little to know a record by."""
        return None if self._readings < _LEAST else self._hash.hexdigest()[:32]


def print_of(log: WheelLog) -> str | None:
    """Fingerprint of a log."""
    record = RecordPrint()
    for time_s, speed_rad_s in zip(log.time_s, log.speed_rad_s, strict=True):
        record.add(float(time_s), float(speed_rad_s))
        if record.full:
            break
    return record.text


def made_of(source: Mapping[str, Any], log: WheelLog) -> str | None:
    """Say that a model, whose `source` this is, was made of this very log; None where it was not, or does not say.

    It is known by the record's fingerprint, whatever the log is called by now; by its name where a model of an older
    version has none.
    """
    name, record = Path(str(source.get("log") or "")).name, source.get("record")
    by_name = bool(name) and stem_of(name) == stem_of(Path(log.name).name)
    if not (by_name if record is None else record == print_of(log)):
        return None
    return (
        f"{log.name}: the model given was made of this very log ({name}): its readings count twice, and the "
        "sigmas are too small; leave the model out, or give one of another record"
    )
