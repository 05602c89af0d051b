"""What to do next, as sentences: which log would settle what is open, and what may be used already."""

from __future__ import annotations

import shlex
from collections.abc import Mapping, Sequence
from itertools import combinations
from pathlib import Path
from typing import Any

from rw_ekf.diagnosis.report.words import untestable_reasons
from rw_ekf.diagnosis.standing import standing_of
from rw_ekf.effects.catalogue import CATALOGUE
from rw_ekf.numbers import chance_text

_OPEN = 0.05  # probability of an explanation that is worth settling
_FIRST = {
    "adequate": "Nothing needs to be added: the model may go on as it is.",
    "effect": "Run with the augmented model. The effect's coefficient is then estimated online, with a sigma of its "
    "own; diagnosing another log with this model must say adequate, or find the next effect.",
    "walk": "Run with the augmented model. It has the rate at which dry friction wanders as process noise, by which "
    "every filter follows it; diagnosing another log with this model must say adequate, or find the next effect.",
    "unexplained": "No effect of the catalogue explains what is left: log what else changes with it, and record a log "
    "that repeats it.",
    "insufficient_excitation": "Drive the wheel through reversals, low speeds and coast-downs "
    "(`rw-ekf excite identification --config wheel.yaml`), and diagnose that log.",
}

_UNSETTLED = (
    "Something is missing here, and no effect stood every test in this log: record a longer one, slow and fast, both "
    "ways (`rw-ekf excite identification`), and diagnose the two together (`rw-ekf diagnose LOG LOG`)."
)


def next_steps(document: Mapping[str, Any]) -> list[str]:
    """Sentences, most important first; code in backticks. The document's own `advice` goes before everything."""
    verdict = document.get("verdict") or {}
    given = verdict.get("advice") or document.get("advice") or ()
    steps = [given] if isinstance(given, str) else [str(step) for step in given]
    kind = str(verdict.get("kind"))
    open_ones = [item for item in document.get("explanations") or () if item["posterior"] >= _OPEN]
    if kind == "unexplained" and open_ones:
        steps.append(_UNSETTLED)
    elif (
        kind in _FIRST
        and not (kind == "insufficient_excitation" and steps)
        and not (kind == "adequate" and (document.get("swallowed") or len(open_ones) > 1))
    ):
        steps.append(_FIRST["walk" if kind == "effect" and _only_walks(document) else kind])
    if len(open_ones) > 1:
        steps.append(_settle(open_ones))
    noise = document.get("torque_noise")
    if noise:
        steps.append(
            f"{noise['sentence'][:1].upper()}{noise['sentence'][1:]}. A log that goes slowly through there, both ways, "
            "several times (`rw-ekf excite S1`), with angle and temperature beside it, shows whether it is noise."
        )
    readings = document.get("reading_noise")
    if readings:
        steps.append(
            f"{readings['sentence'][:1].upper()}{readings['sentence'][1:]}. Some minutes each at constant speeds and "
            "currents, there and elsewhere, show whether it is the sensor: their scatter is its alone. A filter is "
            "told one noise of readings (`filter.speed_noise_rpm`): the larger one is safe."
        )
    if kind == "unexplained":
        steps += [
            f"On {shape['dependence']} would tell more: {shape['record']}." for shape in document.get("shapes") or ()
        ]
    for group in verdict.get("indistinguishable") or ():
        steps.append(_separation([str(name) for name in group]))
    if kind != "insufficient_excitation":
        for reason, effects in untestable_reasons(document.get("candidates") or ()).items():
            steps.append(f"{_listed(effects)} could not be tested: {reason}.")
    return steps


def _only_walks(document: Mapping[str, Any]) -> bool:
    """Whether all that was added is a dry friction that walks at random: no coefficient, but process noise."""
    added = [item for item in document.get("candidates") or () if standing_of(item) == "added"]
    return bool(added) and all("walk_rad_s2_per_sqrt_s" in (item.get("parameters") or {}) for item in added)


def _settle(explanations: Sequence[Mapping[str, Any]]) -> str:
    """The experiment that decides between explanations that stand."""
    names = [("+".join(item["effects"]) or "nothing beyond the model", item["posterior"]) for item in explanations]
    listed = ", ".join(f"{name} {chance_text(posterior)}" for name, posterior in names)
    return (
        f"Several explanations stand ({listed}). `rw-ekf excite --settle diagnosis.json --config wheel.yaml` designs "
        "the two minutes that tell them apart, and runs them; `rw-ekf diagnose` of both logs together then decides."
    )


def excitation_of(document: Mapping[str, Any]) -> dict[str, str]:
    """Effect -> what a log must contain to show it better: of what was named or is in doubt."""
    wanted = list((document.get("verdict") or {}).get("effects") or ())
    for group in (document.get("verdict") or {}).get("indistinguishable") or ():
        wanted += group
    wanted += [c.get("effect") for c in document.get("candidates") or () if standing_of(c) == "added"]
    return {str(name): CATALOGUE[name].excitation for name in dict.fromkeys(wanted) if name in CATALOGUE}


def _separation(group: list[str]) -> str:
    """What distinguishes the members of a confounded class, as the catalogue has it."""
    sentence = f"{_listed(group)} look the same in this log"
    hints: list[str] = []
    for one, other in combinations(group, 2):
        for name, from_what in ((one, other), (other, one)):
            hint = CATALOGUE[name].confounded.get(from_what) if name in CATALOGUE else None
            if hint:  # the other way round says the same
                hints.append(hint)
                break
    return f"{sentence}; what separates them: {'; '.join(dict.fromkeys(hints))}." if hints else f"{sentence}."


def _listed(names: list[str]) -> str:
    code = [f"`{name}`" for name in names]
    return code[0] if len(code) == 1 else f"{', '.join(code[:-1])} and {code[-1]}"


def commands(model: Path, log_name: str, options: Sequence[str] = ()) -> list[tuple[str, str]]:
    """(words, command) that use the augmented model from wherever one stands; options: the log was read with."""
    import yaml

    path = str(model.absolute())
    found_log = Path(log_name).absolute() if Path(log_name).exists() else Path(log_name)
    log, quoted = shlex.join([str(found_log), *options]), shlex.quote(path)
    key: str = yaml.safe_dump({"filter": {"model": path}}, width=10_000)
    return [
        ("Filter a log with it, the effect's coefficient a state of its own:", f"rw-ekf replay {log} --model {quoted}"),
        (
            "Look for what is left (it must say adequate, or name the next effect):",
            f"rw-ekf diagnose {log} --model {quoted}",
        ),
        ("Run the daemon with it:", f"rw-ekf run --config my-wheel.yaml --model {quoted}"),
        ("or for good, in the daemon's configuration:", key.rstrip()),
    ]
