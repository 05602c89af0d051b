"""Messages of robots as rows of numbers: ROS types by their definitions, JSON as it is."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from rw_ekf.logs.foreign.groups import Group, channels_of

_LONGEST = 64  # values of an array that become columns; pictures and point clouds are left out
_STAMP_KEYS = (("sec", "nanosec"), ("sec", "nsec"), ("secs", "nsecs"))
# By kind of message, as its definition says; an effort is left out: a torque there, it is a current in many a driver.
_UNITS = {"sensor_msgs/JointState": {"position": "rad", "velocity": "rad/s"}}


class Row(NamedTuple):
    """One message."""

    stamp_s: float | None  # what it says itself of when it was measured [s]
    values: dict[str, float]


class Topic:
    """The messages of one topic, as they come."""

    def __init__(self, name: str, kind: str = "", remarks: dict[str, str] | None = None) -> None:
        self.name = name
        self.units = _UNITS.get(kind.replace("/msg/", "/"), {})
        self.remarks = remarks or {}  # by value: what the schema says of it in prose
        self.rows: list[Row] = []
        self.logged_s: list[float] = []

    def add(self, logged_ns: int, message: Any) -> None:
        """Add a message that was written to the log at this time."""
        self.rows.append(row_of(message))
        self.logged_s.append(logged_ns / 10**9)

    def group(self) -> Group:
        """On the times that its messages bear, if all have one; else on those when they were logged."""
        stamps = [row.stamp_s for row in self.rows]
        times = [self.logged_s[i] if stamp is None else stamp for i, stamp in enumerate(stamps)]
        channels = channels_of([row.values for row in self.rows])
        return Group(
            self.name,
            np.array(self.logged_s if None in stamps else times, dtype=np.float64),
            channels,
            units={key: unit for key in channels for field, unit in self.units.items() if key.split(".")[0] == field},
            remarks=self.remarks,
        )


def row_of(message: Any) -> Row:
    """Numbers of a message by their path, `pose.position.x`, `data[0]`; texts and long arrays are left out.

    Arrays beside an array `name` of as many texts go by these, as in a JointState: `velocity.wheel`; of one joint
    alone `velocity`.
    """
    values: dict[str, float] = {}
    _flatten(_plain(message), "", values)
    return Row(_stamp(_plain(message)), values)


def _plain(value: Any) -> Any:
    """A ROS message as a mapping of its fields; anything else as it is."""
    fields = getattr(value, "__dataclass_fields__", None)
    return value if fields is None else {key: getattr(value, key) for key in fields if not key.startswith("__")}


def _flatten(fields: Any, path: str, found: dict[str, float]) -> None:
    if not isinstance(fields, Mapping):  # JSON may be a number or an array alone
        fields = {"data": fields}
    names = fields.get("name")
    joints = list(names) if isinstance(names, list) and all(isinstance(name, str) for name in names) else []
    for key, value in fields.items():
        plain, place = _plain(value), f"{path}{key}"
        if key in ("header", "stamp"):
            continue
        if isinstance(plain, Mapping):
            _flatten(plain, f"{place}.", found)
        elif isinstance(plain, bool | int | float | np.number | np.bool_):
            found[place] = float(plain)
        elif plain is None:
            found[place] = float("nan")
        elif isinstance(plain, list | tuple | np.ndarray) and len(plain) <= _LONGEST:
            labels = (
                [f".{joint}" for joint in joints]
                if len(joints) == len(plain)
                else [f"[{i}]" for i in range(len(plain))]
            )
            for label, element in zip([""] if len(joints) == len(plain) == 1 else labels, plain, strict=True):
                if isinstance(inner := _plain(element), Mapping):
                    _flatten(inner, f"{place}{label}.", found)
                elif isinstance(inner, bool | int | float | np.number | np.bool_):
                    found[f"{place}{label}"] = float(inner)


def _stamp(fields: Any) -> float | None:
    """The time in `header.stamp`, `stamp` or `timestamp`, of seconds and nanoseconds; None for none, or zero."""
    if not isinstance(fields, Mapping):
        return None
    header = _plain(fields.get("header"))
    for holder, key in ((header, "stamp"), (fields, "stamp"), (fields, "timestamp")):
        stamp = _plain(holder.get(key)) if isinstance(holder, Mapping) else None
        for seconds, nanoseconds in _STAMP_KEYS:
            if isinstance(stamp, Mapping) and seconds in stamp and nanoseconds in stamp:
                return ((int(stamp[seconds]) * 10**9 + int(stamp[nanoseconds])) / 10**9) or None
    return None
