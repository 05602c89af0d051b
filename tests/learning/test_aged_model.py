"""How old learning is believed: the values stay, the sigmas grow with the time in which nobody watched."""

from __future__ import annotations

import math
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest

from rw_ekf.learning.aged_model import aged
from rw_ekf.learning.run_start import GivenModel, start_of_run
from rw_ekf.model.effect import Term
from rw_ekf.model.state import CK13_STATISTICAL, PARAMETER_NAMES
from rw_ekf.settings.schema import Configuration
from rw_ekf.starting_point import FilterSetup, setup_of_configuration
from rw_ekf.wheel.effect_table import EffectSet
from rw_ekf.wheel.model_file import WheelModel, refusal_of
from rw_ekf.wheel.wheel_tag import WheelTag
from tests.wheel.test_model_file import effect

HOUR_S = 3600.0


def start(**section: float) -> FilterSetup:
    """How a configuration starts."""
    document = {"wheel": {"port": "x"}, "limits": {"current_A": 0.5}, "filter": section}
    return setup_of_configuration(Configuration.model_validate(document), None)


def learned(relative_std: float = 1.0e-4, *effects: Term) -> WheelModel:
    """A model that knows every parameter to that share of its value, and some effects to a tenth."""
    terms = EffectSet(tuple(effects))
    variances = [(relative_std * value) ** 2 for value in CK13_STATISTICAL]
    variances += [std**2 for term in terms.state_terms for std in term.stds]
    rows = tuple(tuple(float(v) for v in row) for row in np.diag(variances))
    return WheelModel(CK13_STATISTICAL, rows, 0.42, effects=terms)


def relative_stds(model: WheelModel) -> dict[str, float]:
    """Sigma over value of each parameter."""
    return {
        name: math.sqrt(model.covariance[i][i]) / value
        for i, (name, value) in enumerate(zip(PARAMETER_NAMES, model.parameters, strict=True))
    }


def test_a_restart_within_seconds_believes_what_it_had() -> None:
    """Ten seconds: a sigma of a ten thousandth grows by less than a thousandth of the value, the values not at all."""
    old = aged(learned(), start(), 10.0)
    assert old.parameters == CK13_STATISTICAL
    assert all(std < 1.0e-3 for std in relative_stds(old).values())


def test_a_night_leaves_the_temperature_unknown() -> None:
    """Twelve hours: viscous friction by 15 %, the dry ones by 2.5 %, the gain by 1 %, drift included."""
    found = relative_stds(aged(learned(), start(), 12.0 * HOUR_S))
    assert found == pytest.approx(
        {"motor_gain": 0.0106, "viscous": 0.15, "coulomb": 0.0252, "static": 0.0252}, rel=0.02
    )


def test_years_never_make_it_less_certain_than_the_configuration() -> None:
    """However long, and however much drift is allowed: no sigma beyond the one the configuration starts with."""
    origin = start(parameter_drift_percent_per_sqrt_hour=100.0)
    old = aged(learned(), origin, 20.0 * 365.0 * 24.0 * HOUR_S)
    stds = [math.sqrt(old.covariance[i][i]) for i in range(4)]
    assert stds == pytest.approx(list(origin.prior.parameter_std))
    assert refusal_of(old) is None


def test_effects_age_as_the_parameters_do() -> None:
    """A coefficient gains its size times the drift; where the model knows the temperature, no more than drift."""
    torque = effect("offset_torque", 0.03, 0.001)
    thin = effect("viscous_temperature", 0.02, 0.001)
    old = aged(learned(1.0e-4, torque, thin), start(), 100.0 * HOUR_S)
    grown = math.sqrt(old.covariance[4][4])
    assert grown == pytest.approx(math.hypot(0.001, 0.03 * 0.001 * 10.0), rel=1e-6)
    assert old.effects.terms[0].stds[0] == pytest.approx(grown)
    assert relative_stds(old)["viscous"] == pytest.approx(0.01, rel=0.01)  # the drift alone
    assert refusal_of(old) is None


def test_a_run_believes_a_model_that_it_is_given_no_better_than_its_temperature_is_known(tmp_path: Path) -> None:
    """Of any time and temperature: the values are the model's, and viscous friction may be half as large again."""
    document = {"wheel": {"port": "x"}, "limits": {"current_A": 0.5}}
    configuration = Configuration.model_validate(document)
    tag = WheelTag(17, 6, 1, "sunspace-wheel", "ab" * 32, "x", sign_confirmed=True)
    given = GivenModel(learned(), "m.yaml", named=True)
    begun = start_of_run(configuration, given, tag, tmp_path / "learned.yaml", datetime(2026, 3, 1, tzinfo=UTC))
    assert begun.setup.prior.parameters == pytest.approx(CK13_STATISTICAL)
    found = {name: std / value for name, std, value in zip(
        PARAMETER_NAMES, begun.setup.prior.parameter_std, CK13_STATISTICAL, strict=True
    )}  # fmt: skip
    assert found == pytest.approx({"motor_gain": 0.0096, "viscous": 0.143, "coulomb": 0.024, "static": 0.024}, rel=0.03)
