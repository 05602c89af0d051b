"""Hostile models: refused with a sentence that names the place, or used with finite numbers; never anything else."""

from __future__ import annotations

import contextlib
import io
import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from rw_ekf.cli import main
from rw_ekf.course.course import Course
from rw_ekf.effects.catalogue import CATALOGUE
from rw_ekf.errors import BadInputError, ConfigError
from rw_ekf.filter.estimator import Estimator
from rw_ekf.log_replay import replay_log
from rw_ekf.logs.reader import read_log
from rw_ekf.logs.wheel_log import WheelLog
from rw_ekf.model.effect_kinds import ReadingEffect
from rw_ekf.model.state import PARAMETER_NAMES, FrictionParameters
from rw_ekf.records import IssuedCommand, WheelSample
from rw_ekf.settings.load import load_configuration
from rw_ekf.starting_point import model_of, setup_of_record
from rw_ekf.wheel.model_file import WheelModel, model_from_data, read_model, refusal_of

GOOD = (15.2, 0.0032, 0.58, 0.6)
STDS = (1.0, 0.001, 0.1, 0.1)
EXTREMES = (0.0, 1e-300, -1e-300, 1e-12, -1e-6, -1.0, 1e6, -1e6, 1e9, 1e200, -1e200, 1e308, 10**300)


def where(path: tuple[str | int, ...]) -> str:
    """A place in a file that is none."""
    return "m.yaml:" + ".".join(map(str, path))


def document(**changes: Any) -> dict[str, Any]:
    """A good model as plain data."""
    good = {
        "schema": "rw_ekf.model/1",
        "stribeck": {"speed_rad_s": 0.42, "law": "gauss"},
        "inertia_kg_m2": 1.5e-3,
        "parameters": {name: {"value": value} for name, value in zip(PARAMETER_NAMES, GOOD, strict=True)},
        "covariance": np.diag(np.square(STDS)).tolist(),
        "noise": {"speed_rad_s": 0.1, "acceleration_rad_s_per_sqrt_s": 0.003},
        "effects": [],
    }
    return good | changes


def with_parameter(name: str, value: float) -> dict[str, Any]:
    """The good model with one other value."""
    data = document()
    data["parameters"][name]["value"] = value
    return data


def with_std(index: int, std: float) -> dict[str, Any]:
    """The good model with one other sigma."""
    data = document()
    data["covariance"][index][index] = std * std
    return data


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (with_std(0, 1e-150), "standard deviation"),
        (with_std(1, 1e-300), "above zero"),
        (with_std(2, 1e150), "standard deviation"),
        (with_parameter("coulomb", -4.0), "parameters.coulomb.value is -4"),
        (with_parameter("static", -4.0), "parameters.static.value is -4"),
        (with_parameter("viscous", -3.0), "parameters.viscous.value is -3"),
        (with_parameter("motor_gain", 1e308), "parameters.motor_gain.value"),
        (with_parameter("motor_gain", 10**400), "parameters.motor_gain.value"),
        (document(stribeck={"speed_rad_s": 1e-40, "law": "gauss"}), "stribeck.speed_rad_s"),
        (document(stribeck={"speed_rad_s": 1e12, "law": "gauss"}), "stribeck.speed_rad_s"),
        (document(inertia_kg_m2=0), "inertia_kg_m2"),
        (document(inertia_kg_m2=-1.0), "inertia_kg_m2"),
        (document(noise={"speed_rad_s": 1e-300}), "noise.speed_rad_s"),
        (document(noise={"acceleration_rad_s_per_sqrt_s": -1.0}), "noise.acceleration"),
        (document(noise={"dry_friction_rad_s2_per_sqrt_s": -1.0}), "noise.dry_friction"),
        (document(covariance=[[1.0, 9, 0, 0], [9, 1.0, 0, 0], [0, 0, 1.0, 0], [0, 0, 0, 1.0]]), "correlations"),
        (
            document(covariance=[[1.0, 0.9, 0.9, 0], [0.9, 1.0, -0.9, 0], [0.9, -0.9, 1.0, 0], [0, 0, 0, 1.0]]),
            "eigenvalue",
        ),
    ],
)
def test_numbers_that_no_machine_has_are_named(data: dict[str, Any], words: str) -> None:
    """One finding, with the key and what was found."""
    with pytest.raises(ConfigError, match=words) as caught:
        model_from_data(data, where)
    assert len(caught.value.findings) == 1
    assert caught.value.findings[0].startswith("m.yaml:")


def model(parameters: tuple[float, ...], stds: tuple[float, ...], omega_s: float, **more: Any) -> WheelModel:
    """A model with independent parameters."""
    rows = np.diag(np.square(stds)).tolist()
    return WheelModel(FrictionParameters(*parameters), tuple(map(tuple, rows)), omega_s, **more)


@pytest.mark.parametrize(
    "legitimate",
    [
        model((0.01, 2.0, 0.2, 0.21), (1e-5, 1e-3, 1e-4, 1e-3), 2e-3, speed_noise_rad_s=1e-5, inertia_kg_m2=95.0),
        model((250.0, 0.05, 3.0, 3.1), (125.0, 0.1, 2.2, 2.3), 1.0, speed_noise_rad_s=0.3),
        model((-15.2, 0.003, 0.58, 0.6), STDS, 0.42),  # a sign to be mended, not a file
        model((0.0, 0.003, 0.58, 0.6), STDS, 0.42),
        model((15.2, -0.0004, -0.01, -0.02), (1.0, 0.0001, 0.004, 0.006), 0.42, acceleration_noise=0.0),
        model((15.2, 0.003, 0.58, 0.57), STDS, 0.42),
        model((1e6, 20.0, 1e4, 1.1e4), (1e3, 1.0, 10.0, 1e3), 10.0, inertia_kg_m2=1e-9),
    ],
)
def test_machines_that_exist_load(legitimate: WheelModel) -> None:
    """A carriage, a bare rotor, a tiny one, a swapped sign, and frictions within noise of zero come back as written."""
    assert refusal_of(legitimate) is None
    assert model_from_data(yaml.safe_load(legitimate.to_text()), where).covariance == legitimate.covariance


def test_a_combination_known_for_certain_gets_an_inverse() -> None:
    """A singular covariance, as rounding leaves it, becomes one that can be inverted, and hardly another."""
    rows = np.diag(np.square(STDS))
    rows[2, 3] = rows[3, 2] = rows[2, 2]
    read = np.array(model_from_data(document(covariance=rows.tolist()), where).covariance)
    np.linalg.cholesky(np.linalg.inv(read))
    assert np.allclose(read, rows, rtol=1e-11, atol=0.0)


@pytest.mark.parametrize(
    ("prior", "place"),
    [
        ("coulomb: {value: -4.0, std: 0.1}", ":5:22: filter.prior.coulomb.value is -4"),
        ("viscous: {value: 0.003, std: 1.0e-200}", ":5:34: filter.prior.viscous.std has"),
        ("motor_gain: {value: 1.0e+308, std: 1.0}", ":5:25: filter.prior.motor_gain.value"),
    ],
)
def test_the_configuration_s_prior_has_the_same_bounds(tmp_path: Path, prior: str, place: str) -> None:
    """File, line, column, key and what was found."""
    path = tmp_path / "c.yaml"
    path.write_text(f"wheel: {{port: x}}\nlimits: {{current_A: 0.5}}\nfilter:\n  prior:\n    {prior}\n")
    with pytest.raises(ConfigError, match=place):
        load_configuration(path)


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> WheelLog:
    """Twelve seconds of a wheel that turns both ways, by a plant of this test's own."""
    rng = np.random.default_rng(8)
    speed, angle = 3.0, 0.0
    rows = ["time_s,speed_rad_s,current_command_A,temperature_degC,angle_rad"]
    for i in range(120):
        current = 0.12 * math.sin(0.1 * i)
        rows.append(f"{0.1 * i:.1f},{speed + rng.normal(0.0, 0.1)},{current},{20 + 0.02 * i},{angle}")
        for _ in range(100):
            speed += 1e-3 * (14.0 * current - 0.004 * speed - 0.5 * math.tanh(speed / 0.05))
            angle += 1e-3 * speed
    path = tmp_path_factory.mktemp("hostile") / "log.csv"
    path.write_text("\n".join(rows) + "\n")
    return read_log(path)


class Numbers:
    """Good numbers, but for a few that are drawn hostile."""

    def __init__(self, draw: st.DrawFn) -> None:
        self._draw = draw
        self._hostile = draw(st.sets(st.integers(0, 15), max_size=2))
        self._count = -1

    def __call__(self, good: float) -> float:
        """The good number, or in its place one of any size and sign."""
        self._count += 1
        if self._count not in self._hostile:
            return good
        sizes = st.floats(-9.0, 9.0).map(lambda e: 10.0**e)
        signed = st.one_of(sizes, sizes, sizes.map(lambda v: -v), st.sampled_from(EXTREMES))
        return self._draw(signed)


@st.composite
def hostile_models(draw: st.DrawFn) -> dict[str, Any]:
    """Model files of the right form with up to two numbers of any size, and at most one effect."""
    number = Numbers(draw)
    stds = [number(std) for std in STDS]
    parameters = {n: {"value": number(v)} for n, v in zip(PARAMETER_NAMES, GOOD, strict=True)}
    more = {
        "stribeck": {"speed_rad_s": number(0.42), "law": draw(st.sampled_from(["gauss", "tustin", "lorentz"]))},
        "inertia_kg_m2": number(1.5e-3),
        "noise": {"speed_rad_s": number(0.1), "acceleration_rad_s_per_sqrt_s": number(0.003)},
    }
    effects = []
    for name in draw(st.lists(st.sampled_from(sorted(CATALOGUE)), max_size=1)):
        entry = CATALOGUE[name]
        std = number(0.01)
        coefficient = {"value": number(0.01), "std": std, "unit": entry.coefficient.unit}
        constants = {c.name: 0.0 if c.name == "law" else number(1.0) for c in entry.constants}
        effects.append({"effect": name, "coefficient": coefficient, "constants": constants})
        stds += [] if issubclass(entry, ReadingEffect) else [std]
    correlation = draw(st.sampled_from([0.0, 0.0, 0.5, 0.999999, 1.0, -1.0]))
    rows = [[0.0] * len(stds) for _ in stds]
    for i, std in enumerate(stds):
        rows[i][i] = min(abs(float(std)), 1e150) ** 2
    rows[2][3] = rows[3][2] = correlation * math.sqrt(rows[2][2]) * math.sqrt(rows[3][3])
    return document(parameters=parameters, covariance=rows, effects=effects, **more)


def fit_with(data: dict[str, Any], log: WheelLog) -> dict[str, Any] | None:
    """Parameters that `fit --prior` finds, whose model loads again; None where it says that it cannot be read."""
    directory, out = Path(log.name).parent, io.StringIO()
    prior, written = directory / "prior.yaml", directory / "fitted.yaml"
    prior.write_text(yaml.safe_dump(data))
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(io.StringIO()):
        status = main(["fit", log.name, "--prior", str(prior), "--json", "--out", str(written)])
    document = json.loads(out.getvalue())
    if status == 1:
        assert any("was not written" in text for text in document["warnings"])
        return None
    assert status == 0
    read_model(written)
    found: dict[str, Any] = document["parameters"]
    return found


@given(hostile_models())
@settings(max_examples=60, deadline=None, derandomize=True, suppress_health_check=list(HealthCheck))
def test_a_hostile_model_is_refused_or_works(log: WheelLog, data: dict[str, Any]) -> None:
    """Loader, replay, fit and the daemon's estimator: a sentence, or finite numbers; nothing else, no warning."""
    try:
        hostile = model_from_data(data, where)
        ran = replay_log(log, None, hostile)
    except BadInputError:
        return
    assert np.isfinite(ran.belief.mean).all()
    assert np.isfinite(ran.belief.covariance).all()
    assert all(v is None or math.isfinite(v) for v in ran.statistics.innovation_document().values())
    inputs = Course.of_log(log)
    fitted = fit_with(data, log)
    assert fitted is None or all(math.isfinite(v[key]) for v in fitted.values() for key in ("value", "std"))
    setup = setup_of_record(inputs, None, hostile)
    estimator = Estimator(setup.constants, setup.prior.mean, setup.prior.covariance, setup.effects, setup.effect_drift)
    for i in range(20):
        result = estimator.step(
            WheelSample(float(log.time_s[i]), float(log.speed_rad_s[i]), temperature_degC=20.0, angle_rad=0.0)
        )
        estimator.command_issued(IssuedCommand(float(log.current_A[i])))
        assert np.isfinite(result.values).all()


def test_what_a_replay_leaves_loads_again(log: WheelLog) -> None:
    """The model after a replay without one, and after a replay with that: neither is refused."""
    first = replay_log(log)
    again = model_of(first.belief, first.setup, {})
    assert refusal_of(again) is None
    second = replay_log(log, None, again)
    assert refusal_of(model_of(second.belief, second.setup, {})) is None


@pytest.mark.parametrize("arguments", [("replay", "--model"), ("fit", "--prior"), ("diagnose", "--model")])
def test_every_verb_refuses_in_a_sentence(
    log: WheelLog, tmp_path: Path, capsys: pytest.CaptureFixture[str], arguments: tuple[str, str]
) -> None:
    """Status 2, file, line and key on standard error, nothing on standard output."""
    path = tmp_path / "hostile.yaml"
    path.write_text(yaml.safe_dump(with_parameter("coulomb", -4.0)))
    with pytest.raises(ConfigError):
        read_model(path)
    verb, option = arguments
    csv = tmp_path / "log.csv"
    rows = "".join(f"{t},{v},0.1\n" for t, v in zip(log.time_s, log.speed_rad_s, strict=True))
    csv.write_text("time_s,speed_rad_s,current_command_A\n" + rows)
    assert main([verb, str(csv), option, str(path)]) == 2
    out, errors = capsys.readouterr()
    assert out == ""
    assert f"{path}:" in errors
    assert "parameters.coulomb.value is -4" in errors
    assert errors.count("\n") == 1


@pytest.mark.parametrize("verb", ["replay", "diagnose"])
def test_a_model_that_runs_away_is_refused(
    log: WheelLog, tmp_path: Path, capsys: pytest.CaptureFixture[str], verb: str
) -> None:
    """Cubic drag that drives, a thousand million times too strong, within all bounds: one sentence, status 2."""
    covariance = np.diag(np.square([*STDS, 10.0])).tolist()
    drag = {"effect": "cubic_drag", "coefficient": {"value": -1.0, "std": 10.0, "unit": "s/rad^2"}}
    path = tmp_path / "m.yaml"
    path.write_text(yaml.safe_dump(document(covariance=covariance, effects=[drag])))
    assert main([verb, log.name, "--model", str(path)]) == 2
    out, errors = capsys.readouterr()
    assert out == ""
    assert "the filter runs away" in errors
