"""The rows of a report's tables, once for the terminal, the page and its bars."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from rw_ekf.diagnosis.report.words import (
    gain_text,
    p_value_text,
    plain_name,
    probability_text,
    ranked,
    statistic_text,
    untestable_reasons,
)
from rw_ekf.diagnosis.standing import Reason, Standing, standing_of
from rw_ekf.diagnosis.thresholds import INDISTINGUISHABLE
from rw_ekf.numbers import MISSING, Rounded, number_of, number_text, rounded

_STUB = 1.04  # evidence that is less is drawn as that: the scale is logarithmic, from one
_LEAST_SCALE, _ROOM = 20.0, 1.6


@dataclass(frozen=True)
class ParameterRow:
    """A parameter of an effect."""

    effect: str
    name: str
    digits: Rounded
    unit: str
    has_std: bool
    note: str  # beside its name: when an event was, since the log's start

    @property
    def value(self) -> str:
        """The value alone."""
        return self.digits.value + self.digits.power

    @property
    def sigma(self) -> str:
        """Its standard deviation; a word where it has none."""
        return self.digits.sigma + self.digits.power or (MISSING if self.has_std else "fixed")

    @property
    def text(self) -> str:
        """`-0.0301 +- 0.0010 1/K`; a name or a fixed constant without a sigma."""
        return f"{self.digits.text} {self.unit}".rstrip()


def parameter_row(effect: str, name: str, parameter: Mapping[str, Any], start_s: float = 0.0) -> ParameterRow:
    """A row of what the document says of one. start_s: the log's own time at its start."""
    value, std = parameter.get("value"), number_of(parameter.get("std"))
    number, note = number_of(value), ""
    if number is None:
        ends = " to ".join(number_text(end, 4) for end in value) if isinstance(value, list) else MISSING
        digits = Rounded(value if isinstance(value, str) else ends)
    else:
        digits = Rounded(number_text(number, 4)) if std is None else rounded(number, std)
        if name.startswith(("onset_s", "begins_at")) and start_s != 0.0:
            note = f"{number - start_s:.1f} s after the log's start"
    return ParameterRow(effect, name, digits, str(parameter.get("unit") or ""), parameter.get("std") is not None, note)


@dataclass(frozen=True)
class CandidateRow:
    """A candidate of the catalogue, tested or not."""

    effect: str
    standing: Standing
    statistic: str
    evidence: float  # length of its bar, of the scale's
    threshold: float | None  # the same of what it must reach; None: nothing to show
    probability: str
    p_value: str
    gain: str
    decision: str
    parameters: tuple[ParameterRow, ...]

    @property
    def name(self) -> str:
        """Its id as a person says it."""
        return plain_name(self.effect)


@dataclass(frozen=True)
class EvidenceScale:
    """Logarithmic, from 1 to `most`."""

    most: float

    def share(self, statistic: object) -> float:
        """Where a statistic lies, of the whole length; what is missing or hardly above nothing is a stub."""
        return math.log(max(number_of(statistic) or 0.0, _STUB)) / math.log(self.most)

    def ticks(self) -> list[tuple[float, str]]:
        """Powers of ten, few enough for their labels: where each lies, and what it is called."""
        decades = range(math.floor(math.log10(self.most)) + 1)
        return [
            (decade * math.log(10.0) / math.log(self.most), f"{10**decade}" if decade < 5 else f"1e{decade}")
            for decade in decades[:: 1 + len(decades) // 6]
        ]


def evidence_scale(candidates: Sequence[Mapping[str, Any]]) -> EvidenceScale:
    """The scale that has room for all of them."""
    numbers = [number_of(candidate.get(key)) or 0.0 for candidate in candidates for key in ("statistic", "threshold")]
    return EvidenceScale(_ROOM * max([_LEAST_SCALE, *numbers]))


def candidate_rows(document: Mapping[str, Any], start_s: float = 0.0) -> list[CandidateRow]:
    """What was added, what else was tested by falling evidence, what was not tested. start_s: as in `parameter_row`."""
    candidates = list(document.get("candidates") or ())
    scale = evidence_scale(candidates)
    reasons = {name: reason for reason, names in untestable_reasons(candidates).items() for name in names}
    untested = [candidate for candidate in candidates if standing_of(candidate) == "untestable"]
    return [_candidate_row(candidate, scale, reasons, start_s) for candidate in [*ranked(candidates), *untested]]


def _candidate_row(
    candidate: Mapping[str, Any], scale: EvidenceScale, reasons: Mapping[str, str], start_s: float
) -> CandidateRow:
    effect, threshold = str(candidate.get("effect")), number_of(candidate.get("threshold"))
    standing = standing_of(candidate)
    parameters = (candidate.get("parameters") or {}).items()
    untested = standing == "untestable"
    return CandidateRow(
        effect,
        standing,
        statistic_text(candidate.get("statistic")),
        scale.share(candidate.get("statistic")),
        scale.share(threshold) if threshold is not None and threshold > 1.0 and not untested else None,
        probability_text(candidate.get("posterior")),
        p_value_text(candidate.get("p_value")),
        gain_text(candidate),
        Reason.UNTESTABLE.value.format(reasons[effect]) if untested else str(candidate.get("decision") or ""),
        tuple(
            parameter_row(effect, name, parameter, start_s)
            for name, parameter in parameters
            if not isinstance(parameter.get("value"), list) or name.startswith("range")  # a curve is a picture
        ),
    )


def added_parameters(rows: Sequence[CandidateRow]) -> list[ParameterRow]:
    """The parameters of what was added."""
    return [parameter for row in rows if row.standing == "added" for parameter in row.parameters]


def friction_rows(document: Mapping[str, Any]) -> list[tuple[str, str, str]]:
    """(name, before, after) of the four parameters; empty where they are not known, an empty text where nothing was."""
    parameters = document.get("parameters") or {}
    before, after = parameters.get("before") or {}, parameters.get("after") or {}

    def text(found: Mapping[str, Any], name: str) -> str:
        return parameter_row("", name, found[name]).text if found else ""

    return [(plain_name(name), text(before, name), text(after, name)) for name in before]


@dataclass(frozen=True)
class HypothesisRow:
    """A hypothesis of the ledger, and what became of it."""

    effects: tuple[str, ...]
    behind: str  # log of how much less likely it is than the likeliest
    words: str
    stands: bool

    @property
    def name(self) -> str:
        """Its effects as a person says them."""
        return " and ".join(plain_name(effect) for effect in self.effects) or "the model alone"


def hypothesis_rows(document: Mapping[str, Any]) -> list[HypothesisRow]:
    """The hypotheses that were fitted, the likeliest first."""
    rows = list(document.get("ledger") or ())
    standing = next((float(row["behind"]) for row in rows if row["stands"]), -math.inf)
    return [
        HypothesisRow(
            tuple(row["effects"]),
            number_text(round(float(row["behind"]), 1), 3),
            _became(row, float(row["behind"]) - standing),
            bool(row["stands"]),
        )
        for row in rows
    ]


def _became(row: Mapping[str, Any], behind: float) -> str:
    """Why it stands, or why not; behind: what stands, in log-likelihood."""
    checks: Sequence[Mapping[str, Any]] = row["checks"]
    failed = next((check for check in checks if not check["passed"]), None)
    if failed is not None:
        limit = "" if failed["limit"] is None else f", the limit is {number_text(failed['limit'])}"
        value = "" if failed["value"] is None else f" ({number_text(failed['value'])}{limit})"
        of = f" of {failed['effect']}" if failed["effect"] else ""
        return f"{failed['check']}{of}{value}: {failed['words']}"
    if row["stands"]:
        return f"stands: passes {len(checks)} checks" if checks else "stands: nothing that is likelier passes"
    if row["as_one_by_construction"]:
        return "one with what stands by the record's construction"
    return "hardly to be told from what stands" if behind < INDISTINGUISHABLE else "less likely"
