"""A learned file: what is written is read back whole, and whatever was done to it since is found."""

from __future__ import annotations

from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from rw_ekf.arrays import Float64Array
from rw_ekf.errors import ConfigError
from rw_ekf.learning.learned_file import learned_text, may_replace, out_of_bounds, read_learned
from rw_ekf.model.state import CK13_STATISTICAL, FrictionParameters
from rw_ekf.wheel.model_file import WheelModel
from rw_ekf.wheel.wheel_tag import WheelTag
from tests.learning.test_aged_model import learned, start
from tests.wheel.test_model_file import effect

TAG = WheelTag(17, 6, 1, "sunspace-wheel", "ab" * 32, "/dev/ttyUSB0", sign_confirmed=True)
NOW = datetime(2026, 3, 1, 12, 30, tzinfo=UTC)


def text_of(model: WheelModel | None = None) -> str:
    """A learned file's text."""
    model = replace(learned(0.01, effect("offset_torque")), wheel=TAG) if model is None else model
    return learned_text(model, "f" * 64, "run.csv", NOW)


def test_what_is_written_is_read(tmp_path: Path) -> None:
    """Model, wheel, time and origin come back; the file is also an ordinary model file."""
    path = tmp_path / "x.learned.yaml"
    path.write_text(text_of(), encoding="utf-8")
    found = read_learned(path)
    assert found.wheel == TAG
    assert found.saved == NOW
    assert found.started_from == "f" * 64
    assert found.model.parameters == CK13_STATISTICAL
    assert found.model.effects.ids == ("offset_torque",)


@settings(max_examples=300, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_no_change_goes_unseen(tmp_path: Path, data: st.DataObject) -> None:
    """One character replaced, or the end cut off, anywhere: refused in words, or the very same content."""
    text = text_of()
    at = data.draw(st.integers(0, len(text) - 1))
    changed = text[:at] if data.draw(st.booleans()) else text[:at] + data.draw(st.characters()) + text[at + 1 :]
    path = tmp_path / "x.learned.yaml"
    path.write_bytes(changed.encode("utf-8", "surrogatepass"))
    try:
        found = read_learned(path)
    except ConfigError:
        return
    assert (found.model.parameters, found.model.covariance, found.wheel, found.saved) == (
        CK13_STATISTICAL, learned(0.01, effect("offset_torque")).covariance, TAG, NOW,
    )  # fmt: skip


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("15.205", "15.3", "was changed after it was written"),
        ("sign_confirmed: false", "sign_confirmed: true", "was changed after it was written"),
        ("rw_ekf.model/1", "rw_ekf.model/2", "this version of rw_ekf reads"),
        ("method: learned", "method: filter", "a model of another origin"),
        ("coulomb: {value: 0.5863", "coulomb: {value: .nan", "not a finite number"),
        ("coulomb: {value: 0.5863", "coulomb: {value: -5.0", "no machine is like that"),
        ("serial_number: 17", "serial_number: seventeen", "wheel.serial_number must be a whole number"),
        ("schema:", "schema: [", "not valid YAML"),
    ],
)
def test_each_change_has_its_sentence(tmp_path: Path, old: str, new: str, words: str) -> None:
    """What was found is said with the file's name."""
    model = replace(learned(0.01), wheel=replace(TAG, sign_confirmed=False))
    text = text_of(model)
    assert old in text
    path = tmp_path / "x.learned.yaml"
    path.write_text(text.replace(old, new), encoding="utf-8")
    with pytest.raises(ConfigError, match=words) as caught:
        read_learned(path)
    assert str(path) in caught.value.findings[0]


def test_bounds_are_about_where_the_learning_began() -> None:
    """A gain beyond four times either way or of another sign, friction beyond ten times: named; less is learning."""
    origin = start()
    k, b, c, s = CK13_STATISTICAL
    for parameters, name in (
        ((4.1 * k, b, c, s), "motor_gain"),
        ((k / 4.1, b, c, s), "motor_gain"),
        ((-k, b, c, s), "motor_gain"),
        ((k, 11.0 * b, c, s), "viscous"),
        ((k, b, 11.0 * c, s), "coulomb"),
        ((k, b, c, 11.0 * s), "static"),
    ):
        found = out_of_bounds(replace(learned(), parameters=FrictionParameters(*parameters)), origin)
        assert found is not None
        assert found.startswith(name)
    inside = FrictionParameters(3.0 * k, 5.0 * b, 0.2 * c, 3.0 * s)
    assert out_of_bounds(replace(learned(), parameters=inside), origin) is None


def test_whose_a_model_is() -> None:
    """Another serial number, kind or wire map is another wheel; what one side does not know differs in nothing."""
    assert TAG.difference(replace(TAG, port="/dev/ttyUSB7", protocol="./copy.yaml")) is None
    assert "serial number 17, and serial number 18 answers" in str(TAG.difference(replace(TAG, serial_number=18)))
    assert "kind 6, and kind 5" in str(TAG.difference(replace(TAG, kind=5)))
    assert "another wire map" in str(TAG.difference(replace(TAG, wire_map="cd" * 32)))
    assert TAG.difference(replace(TAG, version=2)) is None
    assert "version 1, and version 2" in str(TAG.difference(replace(TAG, version=2), versions=True))
    assert TAG.difference(WheelTag()) is None
    assert TAG.vouches_for(replace(TAG, sign_confirmed=False))
    assert not TAG.vouches_for(WheelTag())
    assert not replace(TAG, sign_confirmed=False).vouches_for(TAG)
    assert not TAG.vouches_for(replace(TAG, serial_number=None))


@pytest.mark.parametrize(
    ("share_read", "is_kept"), [(1.0, True), (0.3, True), (0.2, False), (1.0e-3, False), (0.0, False)]
)
def test_what_a_run_was_given_counts_for_nothing_in_what_it_has_learned(share_read: float, is_kept: bool) -> None:
    """Begun with a model that knows all to a thousandth, it replaces what stands by what it has read beside that."""
    standing = np.diag([0.01, 1.0e-5, 1.0e-3, 5.0e-3]) ** 2
    prior = 1.0e-6 * standing
    new: Float64Array = np.linalg.inv(np.linalg.inv(prior) + share_read * np.linalg.inv(standing)).astype(np.float64)
    assert may_replace(standing, new, prior) is is_kept
