"""`rw-ekf export-model --fmu`, `--matlab`, `--basilisk` on the command line, and the printed wheel under a fuzzer."""

from __future__ import annotations

import json
import os
import subprocess
import zipfile
from pathlib import Path
from xml.etree import ElementTree

import pytest

from rw_ekf.cli import main
from rw_ekf.flight.fmu_export import sources_of
from rw_ekf.wheel.effect_table import NO_EFFECTS, EffectSet
from tests.contract import check_document
from tests.filter.effect_replay import in_use
from tests.flight.c_library import WILD, gcc, needs_compiler, needs_gcc
from tests.flight.own_formulas import OWN, own_effects
from tests.flight.test_export_model import model_file
from tests.flight.wheel_runs import wheel_model

_FORMS = [("--fmu", "wheel.fmu"), ("--matlab", "wheel.m"), ("--basilisk", "wheel.json")]
_CONFIG = """wheel: {port: /dev/ttyUSB0, stribeck_speed_rpm: 4.0, inertia_kg_m2: 2.0e-3}
limits: {current_A: 0.5, speed_rpm: 3000}
filter: {prior: {coulomb: {value: 0.9, std: 0.1}}}
"""


def _run(folder: Path, *arguments: str, effects: EffectSet = NO_EFFECTS) -> int:
    return main(["export-model", str(model_file(folder, effects)), *arguments])


@pytest.mark.parametrize(("option", "name"), _FORMS)
def test_what_is_written_is_told(option: str, name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The document is the contract's; without --json the file is named, and what a user must know."""
    more = [] if option == "--matlab" else ["--inertia-kg-m2", "1.5e-3"]
    out = str(tmp_path / name)
    assert _run(tmp_path, option, out, *more, "--json", effects=in_use("quadratic_drag")) == 0
    document = json.loads(capsys.readouterr().out)
    check_document(document)
    assert document["out"] == out
    assert _run(tmp_path, option, out, *more, effects=in_use("quadratic_drag")) == 0
    reported = capsys.readouterr()
    assert reported.out.startswith(f"{out}: ")
    assert "  - " in reported.out
    assert reported.err == ""


@pytest.mark.parametrize(("option", "name"), _FORMS)
def test_a_formula_of_ones_own(
    option: str, name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """It is in the FMU and the function, and Basilisk's wheel has no place for it, which is said by its name.

    One whose id is a name of the export is refused, and nothing is written.
    """
    more = [] if option == "--matlab" else ["--inertia-kg-m2", "1.5e-3"]
    out = tmp_path / name
    assert _run(tmp_path, option, str(out), *more, "--json", effects=own_effects(tmp_path, "eddy")) == 0
    document = json.loads(capsys.readouterr().out)
    if option == "--basilisk":
        assert "effects: eddy: Basilisk's friction has no place for any" in document["not_carried"]
    else:
        assert "eddy" in document["parameters"]
    out.unlink()
    monkeypatch.setitem(OWN, "friction", OWN["eddy"])
    assert _run(tmp_path, option, str(out), *more, effects=own_effects(tmp_path, "friction")) == 2
    reported = capsys.readouterr().err
    assert "your effect friction is the name of something else" in reported
    assert len(reported.splitlines()) == 1
    assert not out.exists()


@pytest.mark.parametrize(("option", "name"), _FORMS)
def test_a_name_of_a_model_that_is_no_text(option: str, name: str, tmp_path: Path) -> None:
    """Bytes that are no UTF-8, a new line, signs of XML: the export is as any other."""
    odd = tmp_path / os.fsdecode(b"a\xf6\n<&>*.yaml")
    model_file(tmp_path).rename(odd)
    more = [] if option == "--matlab" else ["--inertia-kg-m2", "1e-3"]
    assert main(["export-model", str(odd), option, str(tmp_path / name), *more]) == 0
    assert (tmp_path / name).stat().st_size > 0
    if option == "--fmu":
        read = zipfile.ZipFile(tmp_path / name).read("modelDescription.xml")
        assert "a??<&>*.yaml" in ElementTree.fromstring(read).attrib["description"]
    if option == "--matlab":
        assert "%WHEEL Reaction wheel of the model a??<&>*.yaml" in (tmp_path / name).read_text()


@pytest.mark.parametrize(
    ("arguments", "stated"),
    [
        (["--fmu", "wheel.zip"], "give a file that ends in .fmu"),
        (["--matlab", "wheel.txt"], "give a file that ends in .m"),
        (["--basilisk", "wheel.py"], "give a file that ends in .json"),
        (["--fmu", "nowhere/wheel.fmu"], "cannot be written"),
        (["--matlab", "nowhere/wheel.m"], "cannot be written"),
        (["--basilisk", "nowhere/wheel.json", "--inertia-kg-m2", "1e-3"], "cannot be written"),
        (["--basilisk", "wheel.json"], "nobody gave the wheel's inertia"),
        (["--basilisk", "wheel.json", "--inertia-kg-m2", "-1"], "--inertia-kg-m2 -1: give kg m^2"),
        (["--matlab", "wheel.m", "--inertia-kg-m2", "1e-3"], "is an option of --fmu or --basilisk"),
        (["--matlab", "wheel.m", "--fmi", "3"], "--fmi is an option of --fmu"),
        (["--fmu", "wheel.fmu", "--float"], "--float is an option of --c"),
        (["--fmu", "wheel.fmu", "--rate-hz", "0"], "--rate-hz 0"),
        (["--fmu", "wheel.fmu", "--fmi", "4"], "invalid choice"),
        (["--fmu", "wheel.fmu", "--matlab", "wheel.m"], "not allowed with"),
        ([], "one of the arguments --c --fmu --matlab --basilisk is required"),
    ],
)
def test_wrong_input_is_a_sentence(
    arguments: list[str],
    stated: str,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Exit status 2, and no file."""
    monkeypatch.chdir(tmp_path)
    try:
        status = _run(tmp_path, *arguments)
    except SystemExit as error:
        status = int(str(error.code))
    assert status == 2
    assert stated in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["wheel.yaml"]


def test_without_a_compiler_it_says_so(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The FMU has sources and no library; a warning says what to do, and the exit status is 0."""
    monkeypatch.setenv("CC", "no-compiler-of-this-name")
    assert _run(tmp_path, "--fmu", str(tmp_path / "wheel.fmu")) == 0
    reported = capsys.readouterr()
    assert "no C compiler is found" in reported.err
    assert "write it again where there is a compiler" in reported.err
    assert "sources alone" in reported.out
    names = zipfile.ZipFile(tmp_path / "wheel.fmu").namelist()
    assert "sources/wheel.c" in names
    assert not any(name.startswith("binaries/") for name in names)


def test_a_configuration_gives_inertia_and_largest_current(tmp_path: Path) -> None:
    """And so the largest torque; the command line's inertia counts before it, and the friction is the model's."""
    config = tmp_path / "config.yaml"
    config.write_text(_CONFIG)
    out = tmp_path / "wheel.json"
    assert _run(tmp_path, "--basilisk", str(out), "--config", str(config)) == 0
    made = json.loads(out.read_text())["create"]
    assert made["Js"] == 2.0e-3
    assert made["useMaxTorque"] is True
    assert made["fCoulomb"] == pytest.approx(2.0e-3 * 0.5863)
    assert made["u_max"] == pytest.approx(2.0e-3 * 15.205 * 0.5)
    assert _run(tmp_path, "--basilisk", str(out), "--config", str(config), "--inertia-kg-m2", "1e-3") == 0
    assert json.loads(out.read_text())["create"]["Js"] == 1.0e-3


@needs_compiler
def test_a_rate_is_the_longest_step(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Of the model's own steps: effects are straight over no longer one."""
    assert _run(tmp_path, "--fmu", str(tmp_path / "wheel.fmu"), "--rate-hz", "50", "--json") == 0
    assert json.loads(capsys.readouterr().out)["longest_step_s"] == 0.02
    assert (
        "#define RW_LONGEST_STEP_S 0.02\n" in zipfile.ZipFile(tmp_path / "wheel.fmu").read("sources/model.h").decode()
    )


_FUZZ = (
    """
#include "instance.h"
#include "model.h"
#include <math.h>
#include <stddef.h>
#include <stdint.h>
static struct rw_kept kept;
"""
    + WILD
    + """int main(void)
{
    int moved = 0;
    for (int run = 0; run < 60; ++run) {
        double time = 0.0;
        rw_instance_begin(&kept);
        for (unsigned i = 1; i <= RW_PARAMETERS && run > 0; ++i) {
            double value;
            if (rw_instance_get(&kept, RW_STATE + i, &value) != NULL) {
                return 2;
            }
            (void)rw_instance_set(&kept, RW_STATE + i, odd(value * 3.0 * next()));
        }
        (void)rw_instance_set(&kept, RW_SPEED, odd(20.0 * (next() - 0.5)));
        if (rw_instance_initialized(&kept) != NULL) {
            return 3;
        }
        for (int i = 0; i < 200; ++i) {
            const double step = odd(0.2 * next());
            double value;
            (void)rw_instance_set(&kept, RW_CURRENT, odd(0.3 * (next() - 0.5)));
            (void)rw_instance_set(&kept, RW_TEMPERATURE, odd(25.0));
            if (step < 1.0e3 || !isfinite(step)) {
                if (rw_instance_step(&kept, time, step) == NULL) {
                    time += step;
                    moved += kept.wheel.x[0] != 0.0;
                }
            }
            for (unsigned vr = 0; vr < 200; ++vr) {
                (void)rw_instance_get(&kept, vr, &value);
            }
        }
    }
    return moved > 3000 ? 0 : 4;
}
"""
)


@needs_gcc
@pytest.mark.slow
@pytest.mark.parametrize(
    "effects",
    [
        NO_EFFECTS,
        in_use("friction_lag", "actuator_lag", "viscous_temperature"),
        in_use("presliding_hysteresis", "transport_delay"),
        in_use("speed_averaging", "torque_ripple", "stribeck_shape", "motor_saturation"),
    ],
    ids=["plain", "lags", "bristle", "window"],
)
def test_no_input_breaks_the_wheel(effects: EffectSet, tmp_path: Path) -> None:
    """Parameters, speeds, currents and steps that no wheel has: no address or operation without a meaning, no hang."""
    for name, text in sources_of(wheel_model(effects), "wheel", 2).items():
        (tmp_path / Path(name).name).write_text(text)
    (tmp_path / "fuzz.c").write_text(_FUZZ)
    checks = ["-fsanitize=address,undefined,float-cast-overflow", "-fno-sanitize-recover=all", "-g", "-O1"]
    gcc(tmp_path, "-std=c99", "-ffp-contract=off", *checks, "wheel.c", "instance.c", "fuzz.c", "-lm", "-o", "fuzz")
    done = subprocess.run(["./fuzz"], cwd=tmp_path, capture_output=True, text=True, check=False, timeout=300)
    assert done.returncode == 0, (done.returncode, done.stderr[-2000:])
