"""What a report says is said the same way everywhere: causes, gains, commands."""

from __future__ import annotations

import shlex
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from rw_ekf.diagnosis.report.next_steps import commands, next_steps
from rw_ekf.diagnosis.report.residual_panels import _marked
from rw_ekf.diagnosis.report.words import Units, gain_text, headline_of, percent_text
from rw_ekf.diagnosis.standing import Decision, Reason, explained_by
from rw_ekf.diagnosis.verdict.document import in_words
from rw_ekf.effects.catalogue import CATALOGUE

PANELS: Any = [SimpleNamespace(title=t) for t in ("time", "speed", "low speed", "current", "angle", "temperature")]


def marked(kind: str, *effects: str) -> list[str]:
    """Titles in bold where the low speed has the largest structure."""
    document = {"verdict": {"kind": kind, "effects": list(effects)}}
    means: Any = [[SimpleNamespace(structure=9.0 if p.title == "low speed" else 1.0)] for p in PANELS]
    return [PANELS[number].title for number in sorted(_marked(document, PANELS, means))]


def test_the_bold_panel_is_that_of_the_named_cause() -> None:
    """Whatever bends most, a named cause marks its own quantity; without a name the largest, in a good model none."""
    assert marked("effect", "viscous_temperature") == ["temperature"]
    assert marked("effect", "drag_spike", "quadratic_drag") == ["time", "speed"]
    assert marked("effect", "speed_quantisation") == []
    assert marked("unexplained") == ["low speed"]
    assert marked("adequate") == []


def test_the_bold_panel_of_what_is_unexplained_is_that_of_the_curve() -> None:
    """The first fitted curve goes before the largest means; a drive that is no wheel's current has a panel too."""
    document = {"verdict": {"kind": "unexplained"}, "shapes": [{"dependence": "current"}, {"dependence": "time"}]}
    means: Any = [[SimpleNamespace(structure=1.0)] for _ in PANELS]
    assert [PANELS[number].title for number in _marked(document, PANELS, means)] == ["current"]


def test_every_effect_of_the_catalogue_has_a_panel() -> None:
    """But for the one of the reading's grid, which depends on nothing."""
    shown = {name: effect.shown_against for name, effect in CATALOGUE.items() if effect.shown_against}
    assert set(CATALOGUE) - set(shown) == {"speed_quantisation"}
    assert set(shown.values()) == {panel.title for panel in PANELS}


def test_nothing_is_explained_by_what_was_rejected() -> None:
    """Only what stands in the model explains another candidate; of a rejected one it is said that it was rejected."""
    entries: list[dict[str, Any]] = [
        {"effect": "a", "decision": Decision(Reason.ADDED)},
        {"effect": "b", "decision": Decision(Reason.NOT_CONFIRMED, "on the held-out part")},
        {"effect": "c", "decision": explained_by("a", "b")},
        {"effect": "d", "decision": explained_by("b")},
        {"effect": "e", "decision": Decision(Reason.NOT_SIGNIFICANT)},
    ]
    in_words(entries)
    assert [entry["decision"] for entry in entries[2:]] == [
        "explained by a", "looks like b: not confirmed: on the held-out part", "not significant",
    ]  # fmt: skip


def test_a_gain_has_the_sign_and_digits_of_the_figures() -> None:
    """What the tile calls -8.3 % the tables call -8.3 %; a spike's gain says that it is that inside the event."""
    assert gain_text({"effect": "friction_lag", "heldout_gain_percent": 8.277}) == percent_text(-8.277)
    assert gain_text({"effect": "drag_spike", "heldout_gain_percent": 7.92}) == percent_text(-7.92) + " in it"


def test_commands_of_the_report_work_from_anywhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Log, model and column map are named so that the commands run from another folder; spaces are quoted."""
    here = tmp_path / "a place"
    here.mkdir()
    (here / "log.csv").touch()
    monkeypatch.chdir(here)
    found = commands(Path("out") / "augmented-model.yaml", "log.csv", ["--columns", "columns-emps.yaml"])
    lines = [shlex.split(command) for _, command in found]
    model = str(here / "out" / "augmented-model.yaml")
    assert lines[0] == ["rw-ekf", "replay", str(here / "log.csv"), "--columns", "columns-emps.yaml", "--model", model]
    assert lines[1][:3] == ["rw-ekf", "diagnose", str(here / "log.csv")]
    assert lines[2] == ["rw-ekf", "run", "--config", "my-wheel.yaml", "--model", model]


@pytest.mark.parametrize(("kind", "first"), [("effect", "Run with the augmented model"), ("adequate", "Several")])
def test_what_is_open_leads_to_the_experiment_that_settles_it(kind: str, first: str) -> None:
    """Where two explanations stand the next step is `excite --settle`; a model beside one is no "nothing to add"."""
    entries = [{"effects": ["offset_torque"], "posterior": 0.47}, {"effects": [], "posterior": 0.5}]
    steps = next_steps({"verdict": {"kind": kind}, "explanations": entries})
    assert steps[0].startswith(first)
    assert "offset_torque 47 %, nothing beyond the model 50 %" in steps[-1]
    assert "excite --settle" in steps[-1]
    alone = next_steps({"verdict": {"kind": kind}, "explanations": entries[1:]})
    assert not any("settle" in step for step in alone)


def test_a_walk_is_no_coefficient_and_noise_of_readings_has_its_experiment() -> None:
    """What comes next is said of what was found: a rate that filters follow, a sensor that may be worse in places."""
    walk = {"effect": "coulomb_drift", "decision": "added", "parameters": {"walk_rad_s2_per_sqrt_s": {"value": 0.003}}}
    other = {"effect": "offset_torque", "decision": "added", "parameters": {"torque_rad_s2": {"value": 0.1}}}
    alone, beside = (
        next_steps({"verdict": {"kind": "effect"}, "candidates": items})[0] for items in ([walk], [walk, other])
    )
    assert "process noise" in alone
    assert "coefficient" not in alone
    assert "coefficient" in beside
    noise = {"sentence": "readings are off by 2.3 rpm between 600 and 1200 rpm"}
    steps = next_steps({"verdict": {"kind": "unexplained"}, "reading_noise": noise})
    assert any(step.startswith("Readings are off by 2.3 rpm") and "constant speeds" in step for step in steps)


def test_a_headline_does_not_say_which_of_what_cannot_be_told_apart() -> None:
    """Both names where the log cannot tell, the likelier first; one where it can."""
    verdict: dict[str, Any] = {
        "kind": "effect",
        "effects": ["transport_delay"],
        "posterior": {"transport_delay": 0.4},
    }
    units = Units(wheel=True, inertia_kg_m2=None)
    assert headline_of({"verdict": verdict}, units) == "The model lacks transport delay"
    verdict["posterior"] = {"transport_delay": 0.4, "actuator_lag": 0.6}
    verdict["indistinguishable"] = [["transport_delay", "actuator_lag"]]
    assert headline_of({"verdict": verdict}, units) == "The model lacks actuator lag or transport delay"
