"""What a verdict is worth: the outcome of one case, from the injected effects and the diagnosis document."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from typing import Any, Literal

from tools.proof.cases import Case

LAWS = ("learned_law", "change")  # what has no formula
Outcome = Literal["right", "right+extra", "half", "wrong", "unexplained", "missed", "accused", "insufficient", "failed"]
OUTCOMES: tuple[Outcome, ...] = (
    "right", "right+extra", "half", "wrong", "unexplained", "missed", "accused", "insufficient", "failed",
)  # fmt: skip


@dataclass
class Record:
    """One case and what came of it; goes into the JSON document as it is."""

    case: str
    mark: str
    outcome: Outcome
    expects: str
    expected: list[str]
    effects: list[str]
    kind: str | None  # of the verdict; None: no diagnosis came about
    named: list[str]
    indistinguishable: list[list[str]]
    statement: str
    seconds: float
    profile: str
    noise_rpm: float
    size_percent: float | None
    detectable: bool
    table_ratio: float | None
    excess_chi_square: float | None
    posterior: dict[str, float] = field(default_factory=dict)  # as the verdict gave it
    cold: bool = False  # the first log of its worker: its time is not counted
    before: dict[str, Any] | None = None
    after: dict[str, Any] | None = None
    reported_free_run_rpm: float | None = None  # free-run error of a fit that was told the true effects
    candidates: list[dict[str, Any]] = field(default_factory=list)
    wheel: dict[str, float] = field(default_factory=dict)  # what differs from a wheel without anything
    logged: dict[str, Any] = field(default_factory=dict)
    error: str | None = None

    @property
    def reported_ratio(self) -> float | None:
        """Free-run error after the diagnosis over that of the fit told the truth; None where either is missing."""
        found = None if self.after is None else self.after.get("free_run_rms_rpm")
        if found is None or not self.reported_free_run_rpm:
            return None
        return float(found) / self.reported_free_run_rpm


def judge(case: Case, verdict: dict[str, Any], gains: bool = False) -> Outcome:
    """Outcome of a verdict; gains: whether the free run over the held-out part is nearer with the model it gives.

    An injected effect counts as named where it stands in `effects`, or in a group of `indistinguishable` together with
    a named one. right: all injected effects and nothing else; right+extra: others too; half: of several injected
    effects not all. What is in no catalogue is right as unexplained, and as a law without a formula that predicts
    better. A healthy wheel is accused by a named effect and by "unexplained" alike.
    """
    kind = verdict["kind"]
    if kind == "insufficient_excitation":
        return "insufficient"
    if case.expects == "adequate":
        return "right" if kind == "adequate" else "accused"
    if case.expects == "unexplained":
        if gains and kind == "effect" and all(name in LAWS for name in verdict["effects"]):
            return "right"
        return {"unexplained": "right", "adequate": "missed"}.get(kind, "wrong")  # type: ignore[return-value]
    if kind == "adequate":
        return "missed"
    found, extra = matched(case.expected, verdict["effects"], verdict["indistinguishable"])
    if kind == "unexplained":
        return "unexplained"
    if len(found) == len(case.expected):
        return "right+extra" if extra else "right"
    return "half" if found else "wrong"


def _gains(document: dict[str, Any]) -> bool:
    old, new = ((document.get(key) or {}).get("free_run_rms_rpm") for key in ("before", "after"))
    return old is not None and new is not None and new < old


def matched(expected: tuple[str, ...], named: list[str], groups: list[list[str]]) -> tuple[dict[str, str], list[str]]:
    """Injected effect -> the named one that stands for it, and the named ones that stand for none."""
    free = list(dict.fromkeys(named))
    found: dict[str, str] = {}
    for effect in expected:
        if effect in free:
            found[effect] = effect
            free.remove(effect)
    for effect in expected:
        if effect in found:
            continue
        twin = next((other for group in groups if effect in group for other in group if other in free), None)
        if twin is not None:
            found[effect] = twin
            free.remove(twin)
    return found, free


def record_of(case: Case, document: dict[str, Any], seconds: float, **more: Any) -> Record:
    """The record of a case that was diagnosed."""
    verdict = document["verdict"]
    return Record(
        outcome=judge(case, verdict, _gains(document)),
        kind=verdict["kind"],
        named=list(verdict["effects"]),
        indistinguishable=[list(group) for group in verdict["indistinguishable"]],
        statement=verdict["statement"],
        posterior=dict(verdict.get("posterior") or {}),
        seconds=seconds,
        before=document.get("before"),
        after=document.get("after"),
        candidates=[_brief(candidate) for candidate in document.get("candidates", ())],
        **_facts(case),
        **more,
    )


def failure_of(case: Case, error: str, seconds: float, facts: dict[str, Any]) -> Record:
    """The record of a case whose diagnosis broke; facts: what is known of its detectability."""
    known = {"detectable": True, "table_ratio": None, "excess_chi_square": None, **facts}
    return Record(
        outcome="failed",
        kind=None,
        named=[],
        indistinguishable=[],
        statement="",
        seconds=seconds,
        error=error,
        **known,
        **_facts(case),
    )


def _facts(case: Case) -> dict[str, Any]:
    wheel = case.wheel._asdict()
    return {
        "case": case.name,
        "mark": case.mark,
        "expects": case.expects,
        "expected": list(case.expected),
        "effects": list(case.effects),
        "profile": case.profile,
        "noise_rpm": case.noise_rpm,
        "size_percent": case.size_percent,
        "wheel": {name: wheel[name] for name in ("motor_gain", "viscous", "coulomb", "static")},
        "logged": {
            "process_rpm": case.process_rpm,
            "grid_rpm": case.grid_rpm,
            "delay_s": case.delay_s,
            "jitter_s": case.jitter_s,
            "telemetry": case.telemetry,
            "angle": case.angle,
            "initial_rpm": case.initial_rpm,
            "seed": case.seed,
            "profile_seed": case.profile_seed,
        },
    }


def _brief(candidate: dict[str, Any]) -> dict[str, Any]:
    keys = ("effect", "statistic", "p_value", "heldout_gain_percent", "decision", "parameters")
    return {key: candidate.get(key) for key in keys}


def as_json(record: Record) -> dict[str, Any]:
    """The record as a JSON object."""
    return {**asdict(record), "told_ratio": record.reported_ratio}
