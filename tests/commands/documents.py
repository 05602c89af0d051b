"""The replay document, checked key by key against the contract (section 5, and section 10 for a run)."""

from __future__ import annotations

import math
from typing import Any

from tests.loop.bench import document_of

STATE = ("speed_rad_s", "motor_gain", "viscous", "coulomb", "static")
PHYSICAL = {"motor_constant_Nm_A", "viscous_Nms", "coulomb_Nm", "static_Nm"}
INNOVATION = {"rms_rpm", "mean_rpm", "nis_mean", "nis_inside_95"}
ENTRY = {
    "log", "samples", "duration_s", "missing", "rejected", "state", "std", "covariance", "identifiable", "effects",
    "physical", "innovation", "warnings",
}  # fmt: skip
LINK = {"requests", "timeouts", "stale", "damaged", "reconnects"}
LOOP = {"ticks", "overruns", "late_ms_p50", "late_ms_p99", "late_ms_max"}


def replay_document(text: str) -> dict[str, Any]:
    """Parse a replay document and check every key, type and number of it."""
    document = document_of(text)
    assert document["schema"] == "rw_ekf.replay/1"
    assert set(document["seconds"]) == {"read", "filter", "write"}
    assert all(is_number(value) and value >= 0 for value in document["seconds"].values())
    assert isinstance(document["logs"], list)
    assert document["logs"]
    for entry in document["logs"]:
        check_entry(entry)
    return document


def run_document(text: str) -> dict[str, Any]:
    """Parse a run's document: that of a replay, with `link` and `loop`."""
    document = replay_document(text)
    assert len(document["logs"]) == 1
    assert set(document["link"]) == LINK
    assert all(type(value) is int and value >= 0 for value in document["link"].values())
    assert set(document["loop"]) == LOOP
    assert all(is_number(value) and value >= 0 for value in document["loop"].values())
    assert type(document["loop"]["ticks"]) is int
    assert type(document["loop"]["overruns"]) is int
    return document


def check_entry(entry: dict[str, Any]) -> None:
    """One element of `logs`."""
    assert set(entry) == ENTRY
    assert isinstance(entry["log"], str)
    for name in ("samples", "missing", "rejected"):
        assert type(entry[name]) is int
        assert entry[name] >= 0
    assert is_number(entry["duration_s"])
    for name in ("state", "std"):
        assert tuple(entry[name]) == STATE
        assert all(is_number(value) for value in entry[name].values())
    assert all(value >= 0 for value in entry["std"].values())
    covariance = entry["covariance"]
    assert [len(row) for row in covariance] == [5] * 5
    assert all(is_number(value) for row in covariance for value in row)
    for i, name in enumerate(STATE):
        assert math.isclose(covariance[i][i], entry["std"][name] ** 2, rel_tol=1e-9, abs_tol=1e-300)
        assert all(math.isclose(covariance[i][j], covariance[j][i], rel_tol=1e-9) for j in range(5))
    assert set(entry["identifiable"]) == set(STATE[1:])
    assert all(type(value) is bool for value in entry["identifiable"].values())
    for effect in entry["effects"].values():
        assert set(effect) == {"value", "std", "unit"}
    assert set(entry["physical"]) == PHYSICAL
    assert all(value is None or is_number(value) for value in entry["physical"].values())
    assert set(entry["innovation"]) == INNOVATION
    assert all(value is None or is_number(value) for value in entry["innovation"].values())
    assert all(isinstance(text, str) and text for text in entry["warnings"])


def is_number(value: object) -> bool:
    """A finite number, and no boolean."""
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
