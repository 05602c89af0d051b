"""The proof of the diagnosis in its reduced form, and its own scales: cases, verdicts, what can be seen at all."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rw_ekf.diagnosis.log_diagnosis import diagnose_log
from rw_ekf.drivers.sim.plant_effects import CATALOGUE_IDS
from rw_ekf.errors import BadInputError
from rw_ekf.logs.reader import read_log
from tools.proof import tables as proof_tables
from tools.proof.cases import Case
from tools.proof.judge import judge, record_of
from tools.proof.marks import MARKS, case_called, cases_of
from tools.proof.plants import SEEN_CHI_SQUARE, excess_chi_square, log_of, save_log
from tools.proof.prove import Job, prove
from tools.proof.sizes import SHARES

SEED = 1

# One of each kind; numbers are those of `python -m tools.proof.prove --list`.
REDUCED = (
    "id-1rpm-014",  # drag_spike; every effect at one size in tests/wheel/test_walk.py
    "p12-1rpm-000",  # offset_torque on P1
    "healthy-000",  # identification
    "healthy-001",  # P1
    "healthy-003",  # S1
    "outside-000",  # of what the catalogue does not know
    "pairs-000",  # offset_torque and quadratic_drag
)


def verdict(kind: str, *effects: str, groups: tuple[tuple[str, ...], ...] = ()) -> dict[str, Any]:
    """The verdict of a diagnosis document."""
    named = [list(group) for group in groups]
    return {"kind": kind, "effects": list(effects), "indistinguishable": named, "statement": "so it is"}


@pytest.fixture(scope="module")
def delayed() -> Case:
    """A wheel whose commands come late."""
    return next(case for case in cases_of("id-1rpm", 19, SEED) if case.expected == ("transport_delay",))


@pytest.fixture(scope="module")
def paired() -> Case:
    """A wheel with an offset and windage."""
    return cases_of("pairs", 1, SEED)[0]


@pytest.mark.slow
@pytest.mark.parametrize("name", REDUCED)
def test_what_nobody_declared_is_named(name: str) -> None:
    """The plant's effect, or its absence, or that it is in no catalogue, comes back from the log alone."""
    record = prove(case_called(name, SEED), Job(reported=False))
    assert record.error is None, record.error
    assert record.outcome == "right", f"{record.case}: {proof_tables.stated(record)}: {record.statement}"


@pytest.mark.parametrize(
    ("kind", "effects", "groups", "outcome"),
    [
        ("effect", ("transport_delay",), (), "right"),
        ("effect", ("actuator_lag",), (("transport_delay", "actuator_lag"),), "right"),
        ("effect", ("actuator_lag",), (), "wrong"),
        ("effect", ("offset_torque",), (("transport_delay", "actuator_lag"),), "wrong"),
        ("effect", ("transport_delay", "offset_torque"), (), "right+extra"),
        ("effect", ("transport_delay", "actuator_lag"), (("transport_delay", "actuator_lag"),), "right+extra"),
        ("unexplained", (), (), "unexplained"),
        ("adequate", (), (), "missed"),
        ("insufficient_excitation", (), (), "insufficient"),
    ],
)
def test_an_effect_counts_as_named_by_itself_or_by_its_group(
    delayed: Case, kind: str, effects: tuple[str, ...], groups: tuple[tuple[str, ...], ...], outcome: str
) -> None:
    """A group counts only where a member of it is named, and each named effect stands for one injected effect."""
    assert judge(delayed, verdict(kind, *effects, groups=groups)) == outcome


def test_of_a_pair_both_must_be_named(paired: Case) -> None:
    """One of two is half; one name cannot stand for both, even where a group holds them together."""
    both = ("offset_torque", "quadratic_drag")
    assert judge(paired, verdict("effect", *both)) == "right"
    assert judge(paired, verdict("effect", "offset_torque")) == "half"
    assert judge(paired, verdict("effect", "offset_torque", groups=(both,))) == "half"
    assert judge(paired, verdict("effect", "cubic_drag")) == "wrong"


def test_a_healthy_wheel_is_accused_by_any_finding_and_the_unknown_must_stay_unknown() -> None:
    """Both accuse a healthy wheel. Outside the catalogue that is right, or a law that predicts better and no name."""
    healthy, outside = cases_of("healthy", 1, SEED)[0], cases_of("outside", 1, SEED)[0]
    assert [judge(healthy, verdict(kind)) for kind in ("adequate", "effect", "unexplained")] == [
        "right", "accused", "accused",
    ]  # fmt: skip
    assert [judge(outside, verdict(kind)) for kind in ("adequate", "effect", "unexplained")] == [
        "missed", "wrong", "right",
    ]  # fmt: skip
    assert judge(outside, verdict("effect", "learned_law"), gains=True) == "right"
    assert judge(outside, verdict("effect", "learned_law"), gains=False) == "wrong"
    assert judge(outside, verdict("effect", "learned_law", "cubic_drag"), gains=True) == "wrong"


def test_the_proof_covers_the_catalogue_at_every_size() -> None:
    """The mark of 95 % stands on 200 logs or more: every effect at every size, within 3 to 10 % of c."""
    cases = cases_of("id-1rpm", MARKS["id-1rpm"].count, SEED)
    assert len(cases) >= 200
    assert {(case.expected[0], case.size_percent) for case in cases} == {
        (effect, 100.0 * share) for effect in CATALOGUE_IDS for share in SHARES
    }
    for case in cases:
        p, c = case.parameters, case.wheel.coulomb
        assert p.ripple_1_order == 1.0
        for torque in (p.offset_rad_s2, p.ripple_1_rad_s2, p.spike_rad_s2, p.external_rad_s2):
            assert torque == 0.0 or 0.0299 <= abs(torque) / c <= 0.1001


def test_a_case_depends_on_its_name_and_the_seed_alone() -> None:
    """The same case comes from the list, from its name and from its number; another seed draws another wheel."""
    case = cases_of("id-5rpm", 8, SEED)[7]
    assert case_called(case.name, SEED) == case == case_called("id-5rpm-007", SEED)
    assert case_called("id-5rpm-007", SEED + 1).wheel != case.wheel
    with pytest.raises(BadInputError):
        case_called("id-5rpm-007-no_such_effect", SEED)


def test_a_saved_log_reads_as_the_log_in_memory(tmp_path: Path) -> None:
    """--save-log: what the command reads is what the proof judged, to the last bit."""
    case = case_called("pairs-002", SEED)
    log = log_of(case)
    save_log(log, str(tmp_path / "log.csv"))
    read = read_log(tmp_path / "log.csv")
    for name in ("time_s", "speed_rad_s", "current_A", "command_delay_s", "segment"):
        assert np.array_equal(getattr(read, name), getattr(log, name)), name
    for name, values in log.channels.items():
        assert np.array_equal(read.channels[name], values), name


def test_what_a_healthy_wheel_can_imitate_is_no_evidence() -> None:
    """The excess chi-square of a linear effect grows with its square and falls with the noise's, and an effect that is
    a parameter of the model, more viscous friction, leaves nothing."""
    case = replace(case_called("id-1rpm-002", SEED), grid_rpm=0.0, process_rpm=0.0)
    size = case.parameters.quadratic_drag_1_rad
    single, double = (
        excess_chi_square(replace(case, effects=(f"quadratic_drag:coefficient_1_rad={factor * size}",)))
        for factor in (1.0, 2.0)
    )
    noisy = excess_chi_square(replace(case, noise_rpm=5.0))
    assert single is not None
    assert double == pytest.approx(4.0 * single, rel=0.2)
    assert noisy == pytest.approx(single / 25.0, rel=1e-6)
    assert single > SEEN_CHI_SQUARE
    # b is linear in temperature here while the temperature stands still: a wheel with another b.
    still = case.wheel._replace(ambient_cycle_degC=0.0, heating_degC_s_rad=0.0, heating_degC_A2=0.0, ambient_degC=25.0)
    nothing = excess_chi_square(replace(case, wheel=still, effects=("viscous_temperature:slope_1_K=-0.02",)))
    assert nothing is not None
    assert nothing < 1e-3


def test_tables_count_every_record_once(delayed: Case) -> None:
    """The confusion table's rows add up, and the lag that stands for the delay is counted as the delay."""
    named = verdict("effect", "actuator_lag", groups=(("transport_delay", "actuator_lag"),))
    facts = {"detectable": True, "table_ratio": 2.0, "excess_chi_square": 100.0}
    metrics = {"free_run_rms_rpm": 1.02}
    documents = ({"verdict": named, "after": metrics}, {"verdict": verdict("adequate")})
    records = [record_of(delayed, document, 1.0, reported_free_run_rpm=1.0, **facts) for document in documents]
    heading, (row,) = proof_tables.confusion_table(records)
    counts = dict(zip(heading, row, strict=True))
    assert counts["logs"] == "2"
    assert counts[str(CATALOGUE_IDS.index("transport_delay") + 1)] == counts["adequate"] == "1"
    shares = {share.title: share for share in proof_tables.shares(records)}
    mark = shares[MARKS["id-1rpm"].title]
    assert (mark.hits, mark.of, mark.met) == (1, 2, False)
    assert shares["free-run error within 5 % of a fit told the truth"].hits == 1
    assert "1 of 2" in proof_tables.as_markdown(proof_tables.marks_table(records))


@pytest.mark.slow
def test_the_foreign_plant_agrees_with_ours_where_nothing_is_wrong() -> None:
    """MuJoCo's wheel with friction loss and damping is a wheel of the model; with its bristle it is one no longer."""
    pytest.importorskip("mujoco")
    cases = {case.effects[0].partition(":")[0]: case for case in cases_of("foreign", 11, SEED)}
    healthy, bristle = excess_chi_square(cases["healthy"]), excess_chi_square(cases["lugre"])
    assert healthy is not None
    assert bristle is not None
    assert healthy < 1.0
    assert bristle > 10.0 * SEEN_CHI_SQUARE


@pytest.mark.slow
def test_a_motor_gain_that_falls_with_speed_is_neither_a_torque_with_a_clock_nor_process_noise() -> None:
    """A current that reverses every 30 s makes it nearly periodic in time; it is a law of the speed, without a name."""
    document = diagnose_log(log_of(case_called("outside-004", 3))).document()
    assert document["verdict"]["effects"] == ["learned_law"], document["verdict"]["statement"]
    law = next(item for item in document["candidates"] if item["effect"] == "learned_law")["parameters"]
    assert (law["quantity"]["value"], law["kind"]["value"]) == ("speed_size", "motor_gain")
    assert document["after"]["free_run_rms_rpm"] < 0.5 * document["before"]["free_run_rms_rpm"]
    torque = next(item for item in document["candidates"] if item["effect"] == "external_torque")
    assert torque["decision"] == "nothing beside smooth laws of the motion"
