"""What to do next: in words from the verdict, with the excitation that the catalogue names for each effect."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import combinations
from typing import Any

from rw_ekf.diagnosis.report.words import standing_of, untestable_reasons
from rw_ekf.effects.catalogue import CATALOGUE

_FIRST = {
    "adequate": "Nothing needs to be added: the model may go on as it is.",
    "effect": "Run with the augmented model. The effect's coefficient is then estimated online, with a sigma of its "
    "own; diagnosing another log with this model must say adequate, or find the next effect.",
    "unexplained": "No effect of the catalogue explains what is left. The residual's largest dependence is set in bold "
    "in the picture of the residual: log what else changes with it (angle, temperature), and record a log that "
    "repeats it.",
    "insufficient_excitation": "Drive the wheel through reversals, low speeds and coast-downs "
    "(`rw-ekf excite identification --config wheel.yaml`), and diagnose that log.",
}


def next_steps(document: Mapping[str, Any]) -> list[str]:
    """Sentences, most important first; code in backticks. The document's own `advice` goes before everything."""
    verdict = document.get("verdict") or {}
    given = verdict.get("advice") or document.get("advice") or ()
    steps = [given] if isinstance(given, str) else [str(step) for step in given]
    kind = str(verdict.get("kind"))
    if kind in _FIRST:
        steps.append(_FIRST[kind])
    for group in verdict.get("indistinguishable") or ():
        steps.append(_separation([str(name) for name in group]))
    if kind != "insufficient_excitation":
        for reason, effects in untestable_reasons(document.get("candidates") or ()).items():
            steps.append(f"{_listed(effects)} could not be tested: {reason}.")
    return steps


def excitation_of(document: Mapping[str, Any]) -> dict[str, str]:
    """Effect -> what a log must contain to show it better: of what was named or is in doubt."""
    wanted = list((document.get("verdict") or {}).get("effects") or ())
    for group in (document.get("verdict") or {}).get("indistinguishable") or ():
        wanted += group
    wanted += [c.get("effect") for c in document.get("candidates") or () if standing_of(c) == "added"]
    return {str(name): CATALOGUE[name].excitation for name in dict.fromkeys(wanted) if name in CATALOGUE}


def _separation(group: list[str]) -> str:
    """What tells the members of a confounded class apart, as the catalogue has it."""
    said = f"{_listed(group)} look the same in this log"
    hints: list[str] = []
    for one, other in combinations(group, 2):
        for name, from_what in ((one, other), (other, one)):
            hint = CATALOGUE[name].confounded.get(from_what) if name in CATALOGUE else None
            if hint:  # the other way round says the same
                hints.append(hint)
                break
    return f"{said}; what separates them: {'; '.join(dict.fromkeys(hints))}." if hints else f"{said}."


def _listed(names: list[str]) -> str:
    code = [f"`{name}`" for name in names]
    return code[0] if len(code) == 1 else f"{', '.join(code[:-1])} and {code[-1]}"
