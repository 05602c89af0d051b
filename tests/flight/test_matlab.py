"""`rw-ekf export-model --matlab`: a function whose wheel moves as the propagation has it, run by GNU Octave."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from rw_ekf.arrays import Float64Array
from rw_ekf.effects.catalogue import CATALOGUE, FORMULAS
from rw_ekf.errors import BadInputError
from rw_ekf.flight.matlab_export import export_matlab
from rw_ekf.flight.plant_model import PlantModel
from rw_ekf.model.effect import Term
from rw_ekf.model.effect_kinds import DelayEffect, WindowEffect
from rw_ekf.model.friction import friction
from rw_ekf.model.law import Law
from rw_ekf.wheel.effect_table import NO_EFFECTS, EffectSet
from tests.filter.effect_replay import in_use
from tests.flight.own_formulas import OWN, own_effects
from tests.flight.wheel_runs import COLUMN, STEP_S, Drive, column_law, followed, rough_drive, wheel_model

needs_octave = pytest.mark.skipif(shutil.which("octave-cli") is None, reason="no GNU Octave on this machine")

_CARRIED = [effect.id for effect in FORMULAS if not issubclass(effect, (DelayEffect, WindowEffect))]
_QUICK = ("quadratic_drag", "torque_ripple", "friction_lag")
_RUN = """
drive = dlmread('drive.txt');
p = wheel();
state = p.state;
state.columns = [COLUMNS];
omega = 0;
file = fopen('speed.txt', 'w');
for i = 1:rows(drive)
    state.temperature_degC = drive(i, 2);
    [omega, state] = wheel(omega, drive(i, 1), STEP, p, state);
    fprintf(file, '%.17g %.17g\\n', omega, state.angle_rad);
end
fclose(file);
"""


def _octave(folder: Path, script: str) -> str:
    (folder / "run_it.m").write_text(script)
    done = subprocess.run(
        ["octave-cli", "--no-init-file", "--quiet", "run_it.m"],
        cwd=folder, capture_output=True, text=True, check=False, timeout=300,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert "warning" not in done.stderr, done.stderr
    return done.stdout


def _in_octave(folder: Path, model: PlantModel, drive: Drive) -> Float64Array:
    """Speed and angle after each step, (n, 2)."""
    export_matlab(model, folder / "wheel.m")
    np.savetxt(folder / "drive.txt", np.column_stack([drive.current_A, drive.temperature_degC]), fmt="%.17g")
    columns = ", ".join(map(repr, COLUMN))
    _octave(folder, _RUN.replace("COLUMNS", columns).replace("STEP", repr(STEP_S)))
    return np.loadtxt(folder / "speed.txt")


def _laws() -> EffectSet:
    rng = np.random.default_rng(7)
    kinds = [("speed", "drag", -9.0, 9.0, 0.02), ("angle", "torque", 0.0, 2.0 * np.pi, 0.02),
             ("current_size", "motor_gain", 0.0, 0.15, 0.05), ("time", "viscous_drag", 0.0, 30.0, 1e-3)]  # fmt: skip
    terms = []
    for quantity, acts_as, first, last, scale in kinds:
        functions = tuple(tuple((scale * rng.normal(size=9)).tolist()) for _ in range(2))
        law = Law(quantity, acts_as, first, last, functions)  # type: ignore[arg-type]
        terms.append(Term(CATALOGUE["learned_law"], (1.0, -0.5), (0.3, 0.3), law=law))
    return EffectSet(tuple(terms))


@needs_octave
@pytest.mark.parametrize(
    "name",
    ["", "laws", "column", *(n if n in _QUICK else pytest.param(n, marks=pytest.mark.slow) for n in _CARRIED)],
)
def test_each_effect_moves_the_wheel_as_the_propagation_does(name: str, tmp_path: Path) -> None:
    """Speed and angle over 250 steps with reversals, rests and break-aways: within a billionth."""
    effects = {"": NO_EFFECTS, "laws": _laws(), "column": column_law()}.get(name) if name not in _CARRIED else None
    model, drive = wheel_model(in_use(name) if effects is None else effects), rough_drive(250)
    found, expected = _in_octave(tmp_path, model, drive), followed(model, drive)
    assert np.max(np.abs(expected.speed_rad_s)) > 1.0
    for one, other in zip(found.T, (expected.speed_rad_s, expected.angle_rad), strict=True):
        assert np.max(np.abs(one - other) / np.maximum(np.abs(other), 1.0)) < 1.0e-9


@needs_octave
def test_formulas_of_ones_own(tmp_path: Path) -> None:
    """All of them at once, also where they have no value, beside a learned law: within a billionth."""
    effects = EffectSet((*own_effects(tmp_path, *OWN).terms, *_laws().terms))
    model, drive = wheel_model(effects), rough_drive(250)
    found, expected = _in_octave(tmp_path, model, drive), followed(model, drive)
    assert np.max(np.abs(expected.speed_rad_s)) > 1.0
    for one, other in zip(found.T, (expected.speed_rad_s, expected.angle_rad), strict=True):
        assert np.max(np.abs(one - other) / np.maximum(np.abs(other), 1.0)) < 1.0e-9


@needs_octave
def test_the_friction_curve_and_the_help(tmp_path: Path) -> None:
    """Friction at rest, at a Stribeck speed and far from it, either way; a longer step; arguments left out."""
    model = wheel_model(inertia_kg_m2=1.5e-3)
    export_matlab(model, tmp_path / "wheel.m")
    stated = _octave(
        tmp_path,
        "p = wheel(); printf('%.17g ', p.friction(p, [0 0.4 -0.4 50]), p.inertia_kg_m2, wheel(20, 0, 1), "
        "wheel(20, 0, 1, p)); help wheel",
    )
    numbers = [float(text) for text in stated.split()[:7]]
    _, k, b, c, s = model.x.tolist()
    assert k > 0.0
    curve = (b, c, s, model.stribeck.omega_s, model.stribeck.law)
    expected = [friction(0.0, *curve), friction(0.4, *curve), -friction(0.4, *curve), friction(50.0, *curve)]
    assert numbers[:4] == pytest.approx(expected, rel=1.0e-14)
    assert numbers[4] == 1.5e-3
    after = followed(model, Drive(np.zeros(10), np.full(10, 20.0)), speed_rad_s=20.0).speed_rad_s[-1]
    assert numbers[5:] == pytest.approx([after, after], rel=1.0e-12)
    assert "printed by rw_ekf" in stated


def test_what_is_not_in_it_is_said(tmp_path: Path) -> None:
    """A delay and a window, in the document and in the file's header, each with its size."""
    found = export_matlab(wheel_model(in_use("transport_delay", "speed_averaging")), tmp_path / "wheel.m")
    head = (tmp_path / "wheel.m").read_text().split("if nargin")[0]
    for stated in (" ".join(found["remarks"]), head):
        assert re.search(r"transport_delay is not in it: delay the current by [\d.]+ s", stated)
        assert re.search(r"speed_averaging is not in it: .* means over\s+[\d.]+ s", stated)


@pytest.mark.parametrize("name", ["2wheels", "my-wheel", "w" * 64, "end", "function", "parfor"])
def test_a_name_that_matlab_does_not_take(name: str, tmp_path: Path) -> None:
    """It would never be found, nor a word of the language be parsed: a function has the name of its file."""
    with pytest.raises(BadInputError, match="give another name"):
        export_matlab(wheel_model(), tmp_path / f"{name}.m")
    assert not list(tmp_path.iterdir())
