"""`rw-ekf export-model --c`: a folder that compiles by itself, tests itself, and needs libm alone."""

from __future__ import annotations

import functools
import json
import re
import shutil
import subprocess
import tempfile
from pathlib import Path
from typing import Any

import pytest

from rw_ekf.cli import main
from rw_ekf.filter.belief import DEFAULT_PRIOR
from rw_ekf.model.state import CK13_STATISTICAL
from rw_ekf.wheel.effect_table import NO_EFFECTS, EffectSet
from rw_ekf.wheel.model_file import WheelModel
from tests.contract import check_document
from tests.filter.effect_replay import in_use
from tests.flight.c_library import EXACT, LIBM, STRICT, WILD, gcc, needs_gcc
from tests.flight.own_formulas import OWN, own_effects
from tools.measure.flight_on_m4 import missing, run_on_m4

_FILES = ["Makefile", "README.md", "rw_ekf.c", "rw_ekf.h", "test_rw_ekf.c"]


def model_file(folder: Path, effects: EffectSet = NO_EFFECTS) -> Path:
    """A model as `diagnose` leaves it."""
    base = DEFAULT_PRIOR.core.parameter_covariance
    size = 4 + effects.size
    stds = [std for term in effects.state_terms for std in term.stds]
    covariance = [[0.0] * size for _ in range(size)]
    for i in range(4):
        for j in range(4):
            covariance[i][j] = float(base[i, j])
    for i, std in enumerate(stds, start=4):
        covariance[i][i] = std**2
    path = folder / "wheel.yaml"
    rows = tuple(tuple(row) for row in covariance)
    WheelModel(CK13_STATISTICAL, rows, 0.4, speed_noise_rad_s=0.1, acceleration_noise=0.003, effects=effects).save(path)
    return path


@functools.cache
def export_of(name: str, *, single: bool = False) -> dict[str, str]:
    """The files of an export with an effect, or "" without, made once for the tests of one process."""
    with tempfile.TemporaryDirectory() as made:
        folder, effects = Path(made), in_use(name) if name else NO_EFFECTS
        model = str(model_file(folder, effects))
        assert main(["export-model", "--c", str(folder / "c"), model, *["--float"] * single]) == 0
        return {path.name: path.read_text(encoding="utf-8") for path in (folder / "c").iterdir()}


def exported(folder: Path, name: str = "", *, single: bool = False) -> Path:
    """That export in a folder."""
    for file, text in export_of(name, single=single).items():
        (folder / file).write_text(text, encoding="utf-8")
    return folder


def of_one_export(name: str, *, slow: bool = True) -> Any:
    """A test of an export that others look at too, in the same process then."""
    marks = [pytest.mark.xdist_group(f"export {name}"), *[pytest.mark.slow] * slow]
    return pytest.param(name, marks=marks)


@needs_gcc
@pytest.mark.parametrize("single", [False, True], ids=["double", "float"])
@pytest.mark.parametrize(
    "name",
    [
        of_one_export("", slow=False),
        "viscous_temperature",
        of_one_export("torque_ripple"),
        *(pytest.param(name, marks=pytest.mark.slow) for name in ("quadratic_drag", "stribeck_shape")),
        "external_torque",
    ],
)
def test_an_export_compiles_strictly_and_passes_its_own_test(name: str, single: bool, tmp_path: Path) -> None:
    """Every warning an error, nothing from outside but libm, and the recorded answers of the estimator."""
    if single and name == "external_torque":
        pytest.skip("an effect of the time has no single precision")
    folder = exported(tmp_path, name, single=single)
    assert sorted(path.name for path in folder.iterdir()) == _FILES
    gcc(folder, *STRICT, *EXACT, "-c", "rw_ekf.c")
    symbols = subprocess.run(["nm", "-u", "rw_ekf.o"], cwd=folder, capture_output=True, text=True, check=True).stdout
    outside = set(re.findall(r"U (\w+)", symbols))
    assert outside <= ({f"{function}f" for function in LIBM} if single else LIBM)
    gcc(folder, *STRICT, *EXACT, "test_rw_ekf.c", "rw_ekf.o", "-lm", "-o", "test_rw_ekf")
    done = subprocess.run(["./test_rw_ekf"], cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout
    assert done.stdout.startswith("3000 of 3000 samples")


@needs_gcc
@pytest.mark.xdist_group("export ")
@pytest.mark.parametrize(
    "constant",
    ["FILTER_GATE", "FLOW_STEP_IN_STRIBECK_SPEEDS", "TRANSITION_SPREAD", "STILLNESS_UNLEARNED", "FILTER_MAX_GAP_S"],
)
def test_the_self_test_notices_a_changed_constant(constant: str, tmp_path: Path) -> None:
    """Five numbers of gate, flow, transition and stillness, each a little larger: exit status 1."""
    folder = exported(tmp_path)
    text = (folder / "rw_ekf.c").read_text()
    changed = re.sub(rf"(#define {constant}) (\S+)", r"\1 (\2 * CHANGE)", text)
    assert changed != text
    changed = changed.replace("CHANGE", "20.0" if constant == "FILTER_MAX_GAP_S" else "1.1")
    (folder / "rw_ekf.c").write_text(changed)
    gcc(folder, *EXACT, "rw_ekf.c", "test_rw_ekf.c", "-lm", "-o", "test_rw_ekf")
    assert subprocess.run(["./test_rw_ekf"], cwd=folder, capture_output=True, check=False).returncode == 1


@needs_gcc
def test_sanitizers_find_nothing(tmp_path: Path) -> None:
    """Neither an address nor an operation without a meaning, over the recorded readings."""
    folder = exported(tmp_path, "quadratic_drag")
    checks = ["-fsanitize=address,undefined,float-cast-overflow", "-fno-sanitize-recover=all", "-g"]
    gcc(folder, "-std=c99", "-ffp-contract=off", *checks, "rw_ekf.c", "test_rw_ekf.c", "-lm", "-o", "test_rw_ekf")
    done = subprocess.run(["./test_rw_ekf"], cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


@pytest.mark.skipif(shutil.which("arm-none-eabi-gcc") is None, reason="no arm-none-eabi-gcc on this machine")
@pytest.mark.parametrize("single", [False, True], ids=["double", "float"])
def test_it_compiles_as_strictly_for_a_cortex_m4(single: bool, tmp_path: Path) -> None:
    """No warning there either."""
    exported(tmp_path, single=single)
    target = ["-mcpu=cortex-m4", "-mthumb", "-mfloat-abi=hard", "-mfpu=fpv4-sp-d16"]
    done = subprocess.run(
        ["arm-none-eabi-gcc", *STRICT, *EXACT, *target, "-c", "rw_ekf.c"],
        cwd=tmp_path, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr


@pytest.mark.skipif(missing() is not None, reason=f"no {missing()} on this machine")
@pytest.mark.parametrize("single", [False, True], ids=["double", "float"])
def test_its_self_test_passes_on_a_cortex_m4(single: bool, tmp_path: Path) -> None:
    """Emulated, with newlib's mathematics; memory and stack of the four-parameter filter are below 4 kB together."""
    exported(tmp_path, single=single)
    status, stated = run_on_m4(tmp_path, other_libm=True)
    assert status == 0, stated
    found = re.search(r"(\d+) bytes of stack at most; (\d+) bytes of memory", stated)
    assert found is not None, stated
    assert int(found[1]) + int(found[2]) <= 4096


def test_the_document_tells_what_was_written(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Files, states, memory, and the bound of a reading's statements."""
    folder = tmp_path / "c"
    assert main(["export-model", "--c", str(folder), str(model_file(tmp_path)), "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    check_document(document)
    assert sorted(document["files"]) == _FILES
    assert document["states"] == ["speed_rad_s", "motor_gain", "viscous", "coulomb", "static"]
    assert document["precision"] == "double"
    assert 0 < document["estimator_bytes"] < 4096
    assert document["statements_at_most"] > 0


def test_a_file_of_ones_own_is_not_replaced(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A folder with a Makefile and no export is refused; an export itself is written anew."""
    model = str(model_file(tmp_path))
    mine = tmp_path / "mine"
    mine.mkdir()
    (mine / "Makefile").write_text("all:\n")
    assert main(["export-model", "--c", str(mine), model]) == 2
    assert "has a Makefile that is of no export" in capsys.readouterr().err
    assert [path.name for path in mine.iterdir()] == ["Makefile"]
    assert main(["export-model", "--c", str(tmp_path / "c"), model]) == 0
    assert main(["export-model", "--c", str(tmp_path / "c"), model, "--float"]) == 0
    assert "typedef float rw_real" in (tmp_path / "c" / "rw_ekf.h").read_text()


@pytest.mark.parametrize(
    ("effects", "options", "stated"),
    [
        (in_use("actuator_lag"), [], "actuator_lag has a memory of its own"),
        (in_use("presliding_hysteresis"), [], "presliding_hysteresis has a memory of its own"),
        (in_use("transport_delay"), [], "transport_delay looks back at past currents"),
        (in_use("drag_spike"), ["--float"], "drag_spike is a function of the time"),
    ],
)
def test_what_cannot_be_exported_is_refused_by_name(
    effects: EffectSet, options: list[str], stated: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """One sentence that names the effect, exit status 2, and nothing is written."""
    folder = tmp_path / "c"
    assert main(["export-model", "--c", str(folder), str(model_file(tmp_path, effects)), *options]) == 2
    reported = capsys.readouterr().err
    assert stated in reported
    assert len(reported.splitlines()) == 1
    assert not folder.exists()


@needs_gcc
@pytest.mark.parametrize("single", [False, True], ids=["double", "float"])
def test_formulas_of_ones_own_pass_the_self_test(single: bool, tmp_path: Path) -> None:
    """From the model file to the compiled export's own test; nothing from outside but libm."""
    effects = own_effects(tmp_path, "eddy", "warm")
    folder = tmp_path / "c"
    assert main(["export-model", "--c", str(folder), str(model_file(tmp_path, effects)), *["--float"] * single]) == 0
    gcc(folder, *STRICT, *EXACT, "rw_ekf.c", "test_rw_ekf.c", "-lm", "-o", "test_rw_ekf")
    done = subprocess.run(["./test_rw_ekf"], cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout
    assert done.stdout.startswith("3000 of 3000 samples")
    assert "RW_EKF_EDDY" in (folder / "rw_ekf.h").read_text()


def test_a_formula_of_ones_own_that_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """One of the time in single precision, as the catalogue's; one with the name of something else in the C."""
    monkeypatch.setitem(OWN, "states", OWN["eddy"])
    for name, options, stated in (
        ("weak", ["--float"], "weak is a function of the time"),
        ("states", [], "your effect states is the name of something else"),
    ):
        model = str(model_file(tmp_path, own_effects(tmp_path, name)))
        assert main(["export-model", "--c", str(tmp_path / "c"), model, *options]) == 2
        reported = capsys.readouterr().err
        assert stated in reported
        assert len(reported.splitlines()) == 1
        assert not (tmp_path / "c").exists()


_FUZZ = (
    """
#include "rw_ekf.h"
#include <math.h>
#include <stdint.h>
#include <stdio.h>
static struct rw_onboard held;
static struct rw_crossing crossing;
"""
    + WILD
    + """int main(void)
{
    double time = 0.0;
    int left = 0;
    rw_ekf_start(&held);
    rw_ekf_crossing_start(&crossing);
    for (int i = 0; i < 20000; ++i) {
        time += next() < 0.02 ? -1.0 : 0.1;
        const struct rw_reading reading = {
            odd(time), (rw_real)odd(20.0 * sin(0.01 * i) + next()), next() < 0.01, (rw_real)odd(25.0),
            (rw_real)odd(6.0 * next()), {{(rw_real)odd(1.0), (rw_real)odd(2.0), (rw_real)odd(3.0)}}};
        const struct rw_taken taken = rw_ekf_step(&held, reading);
        const rw_real request = (rw_real)odd(next() - 0.5);
        const rw_real asked = rw_ekf_dmc_current(&held, request);
        const rw_real more = rw_ekf_crossing_current(&crossing, &held, request, (rw_real)odd(0.1));
        if (!isfinite(asked) || !isfinite(more)) {
            return 2;
        }
        if (taken.outcome < 0 || taken.outcome > 6 || taken.trouble < 0 || taken.trouble > 6) {
            return 3;
        }
        (void)rw_ekf_command(&held, (rw_real)odd(0.1 * sin(0.03 * i)), (rw_real)odd(0.3 * next()));
        left += isfinite(held.x[0]) && isfinite(held.x[1]);
    }
    printf("%d\\n", left);
    return left > 15000 ? 0 : 4;
}
"""
)


@needs_gcc
@pytest.mark.slow
@pytest.mark.parametrize("single", [False, True], ids=["double", "float"])
@pytest.mark.parametrize("name", [of_one_export(""), of_one_export("torque_ripple"), "motor_saturation"])
def test_nothing_that_is_told_breaks_it(name: str, single: bool, tmp_path: Path) -> None:
    """Infinite, absent and absurd numbers in every place, under sanitizers: it ends, and it recovers."""
    folder = exported(tmp_path, name, single=single)
    (folder / "fuzz.c").write_text(_FUZZ)
    checks = ["-fsanitize=address,undefined,float-cast-overflow", "-fno-sanitize-recover=all", "-g", "-O1"]
    gcc(folder, "-std=c99", "-ffp-contract=off", *checks, "rw_ekf.c", "fuzz.c", "-lm", "-o", "fuzz")
    done = subprocess.run(["./fuzz"], cwd=folder, capture_output=True, text=True, check=False, timeout=300)
    assert done.returncode == 0, (done.returncode, done.stdout, done.stderr[-2000:])
