"""A lubricant's viscosity is exponential: told as such where the record shows it, and believed where it does not."""

from __future__ import annotations

import pytest

from rw_ekf.diagnosis.log_diagnosis import diagnose_log
from rw_ekf.wheel.model_file import WheelModel
from tools.proof.uncatalogued_laws import Nameless

SLOPE_1_K = -0.08  # of the wheel, which another integrator made


@pytest.mark.parametrize(("seed", "is_clear"), [(12, True), (15, False)])
def test_the_slope_is_right_to_its_sigmas_whichever_law_the_record_shows(seed: int, is_clear: bool) -> None:
    """By a straight line it was ten of its own sigmas off; where 2 K show no bend both laws are told."""
    diagnosis = diagnose_log(Nameless("viscosity by temperature", seed).log())
    document = diagnosis.document()
    assert document["verdict"]["effects"] == ["viscous_temperature"]
    found = document["candidates"][0]["parameters"]
    assert abs(found["slope_1_K"]["value"] - SLOPE_1_K) < 2.5 * found["slope_1_K"]["std"] < 0.02
    chances = found["law"]["probability"]
    if is_clear:
        assert found["law"]["value"] == "exponential"
        assert chances["exponential"] > 0.95
        assert ", exponentially;" in document["verdict"]["statement"]
    else:
        assert set(chances) == {"linear", "exponential"}
        other = "exponential" if found["law"]["value"] == "linear" else "linear"
        assert f"(its law may also be {other} (" in document["verdict"]["statement"]


def test_a_model_file_without_a_law_is_linear_as_it_was(tmp_path_factory: pytest.TempPathFactory) -> None:
    """Files that were written before there was a choice hold."""
    diagnosis = diagnose_log(Nameless("viscosity by temperature", 12).log())
    assert diagnosis.model is not None
    path = tmp_path_factory.mktemp("models") / "wheel.yaml"
    diagnosis.model.save(path)
    assert [term.shape[0] for term in WheelModel.load(path).effects.terms] == [1.0]
    text = path.read_text(encoding="utf-8")
    path.write_text(text.replace("constants: {law: 1.0}", "constants: {}"), encoding="utf-8")
    assert [term.shape[0] for term in WheelModel.load(path).effects.terms] == [0.0]
