"""The curves of what no effect explains: true in size, sign and place, and told in words."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from rw_ekf.diagnosis.checks.residual_map import residual_map
from rw_ekf.diagnosis.prepare.preparation import prepare
from rw_ekf.diagnosis.prepare.source import source_of
from rw_ekf.diagnosis.verdict.residual_curves import Axis, Curve, _sentence, shapes_of
from rw_ekf.model.state import CK13_STATISTICAL
from tests.diagnosis.simulated import log_of, simulated

INERTIA_KG_M2 = 1.5e-3


def curves(effect: str, seed: int, *names: str) -> dict[str, Any]:
    """Curves of some dependences of what the four parameters alone leave, by name."""
    prepared = prepare(source_of([log_of(simulated([effect] if effect else [], seed=seed))]), None, None, "blocks")
    left = [item for item in residual_map(prepared.base, prepared.facts) if item.name in names]
    found: Any = SimpleNamespace(prepared=prepared, fit=prepared.base, left=left)
    return {entry["dependence"]: entry for entry in shapes_of(found, INERTIA_KG_M2, in_rpm=True)}


def test_a_drag_that_grows_with_the_current_is_a_line_of_its_true_slope() -> None:
    """In mNm over mA: what is in no catalogue is drawn as it is, but for what Coulomb friction follows."""
    curve = curves("acceleration_friction:ratio=0.1", 7, "current")["current"]
    assert (curve["kind"], curve["at_unit"], curve["unit"]) == ("drag", "mA", "mNm")
    at, value, std = (np.array(curve[key]) for key in ("at", "value", "std"))
    slope = 1.0e3 * INERTIA_KG_M2 * 0.1 * CK13_STATISTICAL.motor_gain * 1.0e-3
    assert value[-1] - value[0] == pytest.approx(slope * (at[-1] - at[0]), rel=0.02)
    assert np.all(np.abs(value - value[0] - slope * (at - at[0])) < 0.03)
    assert np.all(std < 0.02)
    assert curve["sentence"].startswith("drag rises by about 0.9")


def test_a_torque_that_comes_and_goes_is_drawn_with_its_sign() -> None:
    """One turn of a sine over the record, of a torque (the plant has it as a friction) that is no drag."""
    curve = curves("external_torque:amplitude_rad_s2=0.06,frequency_Hz=0.00167", 3, "time")["time"]
    assert (curve["kind"], curve["unit"]) == ("torque", "mNm")
    truth = -1.0e3 * INERTIA_KG_M2 * 0.06 * np.sin(2.0 * np.pi * 0.00167 * np.array(curve["at"]))
    assert np.corrcoef(curve["value"], truth)[0, 1] > 0.95
    assert np.ptp(curve["value"]) == pytest.approx(np.ptp(truth), rel=0.3)


def test_bands_of_a_healthy_wheel_hold_zero() -> None:
    """Nothing is left: few values of any curve are two of their sigmas off."""
    names = ("speed", "low speed", "current", "time", "temperature", "angle")
    off = np.concatenate(
        [
            np.abs(np.array(entry["value"]) / np.array(entry["std"]))
            for seed in (11, 12)
            for name in names
            for entry in curves("", seed, name).values()
        ]
    )
    assert off.size > 100
    assert np.mean(off > 2.0) < 0.12


@pytest.mark.parametrize(
    ("values", "text"),
    [
        ((0.0, 0.0, 0.3, 0.0, 0.0), "about 0.30 +- 0.02 mNm more drag around 30 to 50 rpm"),
        ((0.0, -0.3, -0.3, 0.0, 0.0), "about 0.30 +- 0.02 mNm less drag around 10 to 50 rpm"),
        ((0.0, 0.1, 0.2, 0.3, 0.4), "drag rises by about 0.40 +- 0.02 mNm from 0 to 80 rpm"),
        ((0.4, 0.3, 0.2, 0.1, 0.0), "drag falls by about 0.40 +- 0.02 mNm from 0 to 80 rpm"),
        ((0.01, 0.0, 0.01, 0.0, 0.0), "no place of the speed stands out"),
    ],
)
def test_a_curve_in_words(values: tuple[float, ...], text: str) -> None:
    """A peak by its place at half its height, a slope by its rise, and nothing where nothing is clear."""
    at = np.linspace(0.0, 80.0, 5)
    curve = Curve(at, np.array(values), np.full(5, 0.02), 0.02)
    assert _sentence("speed", "drag", curve, Axis("rpm", 1.0), "mNm") == text
