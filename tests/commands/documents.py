"""Documents of the command line, checked key by key: replay, run and diagnosis (docs/contract.md)."""

from __future__ import annotations

import math
from typing import Any

from rw_ekf.effects.catalogue import CATALOGUE
from tests.live.bench import document_of

STATE = ("speed_rad_s", "motor_gain", "viscous", "coulomb", "static")
PHYSICAL = {"motor_constant_Nm_A", "viscous_Nms", "coulomb_Nm", "static_Nm"}
INNOVATION = {"rms_rpm", "mean_rpm", "nis_mean", "nis_inside_95"}
ENTRY = {
    "log", "samples", "duration_s", "missing", "rejected", "state", "std", "covariance", "identifiable", "effects",
    "physical", "inertia_kg_m2", "inertia_from", "as_it_went", "innovation", "warnings",
}  # fmt: skip
LINK = {"requests", "timeouts", "stale", "damaged", "reconnects"}
LOOP = {"ticks", "overruns", "late_ms_p50", "late_ms_p99", "late_ms_max"}
VERDICTS = {"adequate", "effect", "unexplained", "insufficient_excitation"}
METRICS = {
    "one_step_rms_rpm", "horizon_1s_rms_rpm", "horizon_20s_rms_rpm", "free_run_rms_rpm", "nis_mean", "torque_rms_mNm",
}  # fmt: skip
DIAGNOSIS = {"schema", "log", "samples", "rate_hz", "split", "verdict", "candidates", "before", "after", "model"}


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


def diagnosis_document(text: str) -> dict[str, Any]:
    """Parse a diagnosis document and check every key, type and number of it, and that its parts agree."""
    document = document_of(text)
    assert set(document) >= DIAGNOSIS | {"warnings"}
    assert document["schema"] == "rw_ekf.diagnosis/1"
    assert isinstance(document["log"], str)
    assert type(document["samples"]) is int
    assert document["rate_hz"] is None or (is_number(document["rate_hz"]) and document["rate_hz"] > 0)
    check_split(document["split"])
    verdict = document["verdict"]
    check_verdict(verdict)
    for candidate in document["candidates"]:
        check_candidate(candidate)
    named = [candidate["effect"] for candidate in document["candidates"]]
    assert sorted(named) == (sorted(CATALOGUE) if verdict["kind"] != "insufficient_excitation" else [])
    added = {candidate["effect"] for candidate in document["candidates"] if candidate["decision"] == "added"}
    assert added == set(verdict["effects"])
    for part in ("before", "after"):
        assert set(document[part]) == METRICS
        assert all(value is None or is_number(value) for value in document[part].values())
    assert (document["model"] == "augmented-model.yaml") if verdict["effects"] else (document["model"] is None)
    assert all(isinstance(warning, str) and warning for warning in document["warnings"])
    return document


def check_split(split: dict[str, Any]) -> None:
    """`split`: stretches of time in order, each with its end behind its begin; none both fitted and held out."""
    assert set(split) == {"kind", "fit_s", "heldout_s"}
    assert split["kind"] in {"blocks", "halves"}
    for part in ("fit_s", "heldout_s"):
        assert all(len(span) == 2 and all(map(is_number, span)) and span[0] <= span[1] for span in split[part])


def check_verdict(verdict: dict[str, Any]) -> None:
    """`verdict`: a kind, effects of the catalogue if and only if it is "effect", one sentence or more."""
    assert set(verdict) == {"kind", "effects", "indistinguishable", "posterior", "statement"}
    assert verdict["kind"] in VERDICTS
    assert bool(verdict["effects"]) == (verdict["kind"] == "effect")
    assert set(verdict["effects"]) <= set(CATALOGUE)
    for group in verdict["indistinguishable"]:
        assert 2 <= len(group) <= 3
        assert set(group) <= set(CATALOGUE)
    assert set(verdict["posterior"]) <= {*CATALOGUE, "none", "something_else"}
    assert all(is_number(chance) and 0.0 <= chance <= 1.0 for chance in verdict["posterior"].values())
    assert set(verdict["effects"]) <= set(verdict["posterior"])
    assert verdict["statement"].endswith(".")
    assert "\n" not in verdict["statement"]


def check_candidate(candidate: dict[str, Any]) -> None:
    """One element of `candidates`; numbers or null, nothing else."""
    keys = {"effect", "parameters", "statistic", "p_value", "posterior", "heldout_gain_percent", "decision"}
    assert keys <= set(candidate)
    for parameter in candidate["parameters"].values():
        assert set(parameter) == {"value", "std", "unit"}
        assert is_number(parameter["value"]) or isinstance(parameter["value"], str)
        assert parameter["std"] is None or is_number(parameter["std"])
        assert isinstance(parameter["unit"], str)
    for key in ("statistic", "p_value", "heldout_gain_percent"):
        assert candidate[key] is None or is_number(candidate[key])
    assert candidate["p_value"] is None or 0.0 <= candidate["p_value"] <= 1.0
    assert isinstance(candidate["decision"], str)
    assert candidate["decision"]


def is_number(value: object) -> bool:
    """A finite number, and no boolean."""
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
