"""`rw-ekf export-model --fmu`: valid FMUs of both versions whose wheel moves as the propagation has it, bit by bit."""

from __future__ import annotations

import importlib.util
import os
import shutil
import subprocess
import sys
import zipfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rw_ekf.drivers.sim.plant_batch import simulate_run
from rw_ekf.drivers.sim.plant_parameters import PlantNoise, PlantParameters
from rw_ekf.effects.catalogue import CATALOGUE, FORMULAS
from rw_ekf.errors import BadInputError
from rw_ekf.flight.exported_plant import PAST_MOST
from rw_ekf.flight.fmu_description import Version
from rw_ekf.flight.fmu_export import export_fmu, sources_of
from rw_ekf.flight.fmu_libraries import platforms_of
from rw_ekf.flight.plant_model import PlantModel
from rw_ekf.model.effect import Term
from rw_ekf.model.state import CK13_STATISTICAL
from rw_ekf.wheel.effect_table import NO_EFFECTS, EffectSet
from tests.filter.effect_replay import in_use
from tests.flight.c_library import STRICT, needs_compiler, needs_gcc, same_bits
from tests.flight.own_formulas import own_effects
from tests.flight.wheel_runs import COLUMN, STEP_S, Drive, Motion, column_law, followed, rough_drive, wheel_model

fmpy = pytest.importorskip("fmpy")
pytestmark = needs_compiler

_NAMES = [effect.id for effect in FORMULAS]
_LONG = {"long_delay": ("transport_delay", 0.35), "long_window": ("speed_averaging", 0.43)}  # s, several steps
_QUICK = ("quadratic_drag", "friction_lag", "transport_delay")


class Simulated:
    """An FMU that is loaded and initialized."""

    def __init__(self, path: Path, starts: dict[str, float] | None = None) -> None:
        from fmpy.fmi2 import FMU2Slave
        from fmpy.fmi3 import FMU3Slave

        self.description = fmpy.read_model_description(str(path))
        self.is_3 = self.description.fmiVersion.startswith("3")
        self.references = {v.name: v.valueReference for v in self.description.modelVariables}
        token = self.description.instantiationToken if self.is_3 else self.description.guid
        unzipped = fmpy.extract(str(path), unzipdir=str(path.with_suffix("")))
        identifier = self.description.coSimulation.modelIdentifier
        kind = FMU3Slave if self.is_3 else FMU2Slave
        self.fmu: Any = kind(guid=token, modelIdentifier=identifier, unzipDirectory=unzipped)
        self.fmu.instantiate()
        for name, value in (starts or {}).items():
            self.set(name, value)
        if self.is_3:
            self.fmu.enterInitializationMode(startTime=0.0)
        else:
            self.fmu.setupExperiment(startTime=0.0)
            self.fmu.enterInitializationMode()
        self.fmu.exitInitializationMode()

    def set(self, name: str, value: float) -> None:
        """One variable."""
        (self.fmu.setFloat64 if self.is_3 else self.fmu.setReal)([self.references[name]], [value])

    def get(self, *names: str) -> list[float]:
        """Values."""
        return list((self.fmu.getFloat64 if self.is_3 else self.fmu.getReal)([self.references[n] for n in names]))

    def step(self, at_s: float, duration_s: float = STEP_S) -> None:
        """One communication step."""
        self.fmu.doStep(currentCommunicationPoint=at_s, communicationStepSize=duration_s)

    def run(self, drive: Drive, steps: range | None = None) -> Motion:
        """Steps under a drive."""
        found = []
        for i in steps or range(drive.current_A.size):
            self.set("current_A", drive.current_A[i])
            if "temperature_degC" in self.references:
                self.set("temperature_degC", drive.temperature_degC[i])
            self.step(float(STEP_S * i))
            found.append(self.get("speed_rad_s", "angle_rad", "friction_rad_s2"))
        return Motion(*np.array(found).T)

    def close(self) -> None:
        """Unload it."""
        self.fmu.terminate()
        self.fmu.freeInstance()


def _exported(folder: Path, model: PlantModel, version: Version = 2) -> Path:
    from fmpy.validation import validate_fmu

    path = folder / f"wheel{version}.fmu"
    found = export_fmu(model, path, version)
    assert found["binaries"]
    assert validate_fmu(str(path)) == []
    return path


def _effects(name: str) -> EffectSet:
    if name == "column":
        return column_law()
    if name in _LONG:
        effect, value = _LONG[name]
        return EffectSet((Term.of(CATALOGUE[effect], value=value, std=value),))
    return in_use(name) if name else NO_EFFECTS


@pytest.mark.parametrize(
    ("name", "version"),
    [
        *((name, 2) for name in ("", "column", *_LONG)),  # the effects' own code is the same in both
        *((name, 3) for name in ("", "column", *_LONG)),
        *(pytest.param(n, 3, marks=() if n in _QUICK else pytest.mark.slow) for n in _NAMES),
    ],
)
def test_each_effect_moves_the_wheel_as_the_propagation_does(name: str, version: Version, tmp_path: Path) -> None:
    """Speed, angle and friction after 400 steps with reversals, rests and break-aways: the same bits."""
    model, drive = wheel_model(_effects(name)), rough_drive()
    wheel = Simulated(_exported(tmp_path, model, version), {"bus_voltage_V": COLUMN[0]} if name == "column" else None)
    found, expected = wheel.run(drive), followed(model, drive)
    wheel.close()
    speed = expected.speed_rad_s
    assert np.sum(speed[1:] * speed[:-1] < 0.0) + np.sum((speed[1:] != 0.0) & (speed[:-1] == 0.0)) >= 3
    assert np.max(np.abs(speed)) > 5.0
    assert same_bits(found.speed_rad_s, speed)
    assert same_bits(found.angle_rad, expected.angle_rad)
    assert same_bits(found.friction_rad_s2, expected.friction_rad_s2)


@pytest.mark.parametrize("names", [("eddy", "ripple", "warm"), ("weak", "powers")])
def test_formulas_of_ones_own(names: tuple[str, ...], tmp_path: Path) -> None:
    """Of speed, current, temperature, angle and time, beside each other: the same bits."""
    model, drive = wheel_model(own_effects(tmp_path, *names)), rough_drive()
    wheel = Simulated(_exported(tmp_path, model))
    found, expected = wheel.run(drive), followed(model, drive)
    wheel.close()
    assert same_bits(found.speed_rad_s, expected.speed_rad_s)
    assert same_bits(found.friction_rad_s2, expected.friction_rad_s2)


@pytest.mark.slow
def test_several_effects_at_once(tmp_path: Path) -> None:
    """A lag, a delay, a friction with a memory, a temperature and a drag in one wheel."""
    model = wheel_model(in_use("actuator_lag", "transport_delay", "friction_lag", "viscous_temperature", "cubic_drag"))
    wheel = Simulated(_exported(tmp_path, model))
    found, expected = wheel.run(rough_drive(seed=8)), followed(model, rough_drive(seed=8))
    wheel.close()
    assert same_bits(found.speed_rad_s, expected.speed_rad_s)


@pytest.mark.parametrize(
    ("name", "number", "longest_step_s", "bound_rad_s"),
    [
        ("", "", STEP_S, 2.0e-6),
        ("quadratic_drag", "quadratic_drag_1_rad", STEP_S, 2.0e-6),
        ("friction_lag", "friction_lag_s", STEP_S, 2.0e-6),
        ("presliding_hysteresis", "presliding_rad", STEP_S, 1.0e-5),
        ("transport_delay", "transport_delay_s", STEP_S, 2.0e-6),
        ("actuator_lag", "actuator_lag_s", STEP_S, 5.0e-3),
        ("actuator_lag", "actuator_lag_s", 2.0e-3, 2.0e-5),
    ],
)
def test_it_moves_as_the_simulated_plant_does(
    name: str, number: str, longest_step_s: float, bound_rad_s: float, tmp_path: Path
) -> None:
    """The plant of the simulated wheel shares no equation with it: steps of 0.2 ms by Heun's rule.

    Measured, at up to 8.4 rad/s, in the order of the cases: 2.0e-7, 5.5e-7, 3.8e-7, 2.8e-6, 2.0e-7, 1.5e-3, 4.3e-6. A
    lagging current is taken by its mean over half a time constant, here 10 ms: so late may a wheel break away, and it
    keeps the difference until it rests again. In shorter steps it does not.
    """
    effects = _effects(name)
    drive = rough_drive()
    n = drive.current_A.size
    model = replace(wheel_model(effects), period_s=longest_step_s)
    wheel = Simulated(_exported(tmp_path, model))
    found = wheel.run(drive)
    wheel.close()
    k, b, c, s = CK13_STATISTICAL
    own = {number: float(effects.values[0])} if number else {}
    truth = PlantParameters(
        k, b, c, s, wheel_model().stribeck.omega_s, ambient_cycle_degC=0.0, heating_degC_s_rad=0.0, heating_degC_A2=0.0,
    )._replace(**own)  # fmt: skip
    times = STEP_S * np.arange(n + 1)
    run = simulate_run(truth, np.append(drive.current_A, 0.0), times, PlantNoise(speed_rad_s=0.0))
    assert np.max(np.abs(found.speed_rad_s - run.measured_speed_rad_s[1:])) < bound_rad_s


@pytest.mark.parametrize("version", [2, 3])
def test_a_whole_simulation_by_fmpy(version: Version, tmp_path: Path) -> None:
    """As an importer runs it, with inputs from a table: within a billionth of the propagation."""
    model, drive = wheel_model(in_use("quadratic_drag")), rough_drive()
    n = drive.current_A.size
    path = _exported(tmp_path, model, version)
    signals = np.zeros(n, dtype=[("time", float), ("current_A", float)])
    signals["time"], signals["current_A"] = STEP_S * np.arange(n), drive.current_A
    result = fmpy.simulate_fmu(
        str(path), stop_time=STEP_S * (n - 1), output_interval=STEP_S, step_size=STEP_S, input=signals,
        output=["speed_rad_s"],
    )  # fmt: skip
    expected = np.append(0.0, followed(model, drive).speed_rad_s[:-1])
    found = np.asarray(result["speed_rad_s"])
    assert found.size == n
    assert np.max(np.abs(found - expected) / np.maximum(np.abs(expected), 1.0)) < 1.0e-9


@pytest.mark.parametrize("version", [2, 3])
@pytest.mark.parametrize("name", ["friction_lag", "transport_delay"])
def test_a_state_is_kept_and_taken_up_again(name: str, version: Version, tmp_path: Path) -> None:
    """Saved in the middle, written down as bytes, read, and followed on: the same end, memory and past included."""
    wheel = Simulated(_exported(tmp_path, wheel_model(in_use(name)), version))
    drive = rough_drive()
    wheel.run(drive, range(150))
    fmu = wheel.fmu
    get, write, read, put = (
        (fmu.getFMUState, fmu.serializeFMUState, fmu.deserializeFMUState, fmu.setFMUState)
        if version == 3
        else (fmu.getFMUstate, fmu.serializeFMUstate, fmu.deSerializeFMUstate, fmu.setFMUstate)
    )
    kept = write(get())
    first = wheel.run(drive, range(150, 300))
    put(read(kept))
    again = wheel.run(drive, range(150, 300))
    wheel.close()
    assert same_bits(first.speed_rad_s, again.speed_rad_s)
    assert same_bits(first.friction_rad_s2, again.friction_rad_s2)


def test_starts_and_parameters_can_be_set_and_a_torque_read(tmp_path: Path) -> None:
    """From 50 rad/s with twice the Coulomb friction and no other: an even deceleration; the torque is J times it."""
    wheel = Simulated(
        _exported(tmp_path, wheel_model(inertia_kg_m2=2.0e-3)),
        {"speed_rad_s": 50.0, "angle_rad": 3.0, "viscous": 0.0, "coulomb": 1.2, "static": 1.2},
    )
    assert wheel.get("angle_rad") == [3.0]
    for i in range(100):
        wheel.step(STEP_S * i)
    speed, torque, friction = wheel.get("speed_rad_s", "friction_torque_N_m", "friction_rad_s2")
    wheel.close()
    assert speed == pytest.approx(50.0 - 12.0, rel=1.0e-12)
    assert friction == pytest.approx(1.2, rel=1.0e-12)
    assert torque == pytest.approx(2.4e-3, rel=1.0e-12)


def test_a_column_with_the_name_of_another_variable_gets_one_of_its_own(tmp_path: Path) -> None:
    """Names in an FMU are there once: a law of a column `coulomb` does not meet the parameter."""
    (term,) = column_law().terms
    assert term.law is not None
    effects = EffectSet((replace(term, law=replace(term.law, column="coulomb")),))
    wheel = Simulated(_exported(tmp_path, wheel_model(effects)), {"column_1_coulomb": 2.0, "coulomb": 0.5})
    assert wheel.get("column_1_coulomb", "coulomb") == [2.0, 0.5]
    wheel.close()


def test_a_long_step_is_cut_into_steps_of_the_model(tmp_path: Path) -> None:
    """One second at once is ten steps of a tenth, to rounding."""
    path = _exported(tmp_path, wheel_model(in_use("cubic_drag")))
    wheel = Simulated(path, {"speed_rad_s": 200.0})
    wheel.step(0.0, 1.0)
    (once,) = wheel.get("speed_rad_s")
    wheel.close()
    wheel = Simulated(path, {"speed_rad_s": 200.0})
    for i in range(10):
        wheel.step(STEP_S * i)
    (tenfold,) = wheel.get("speed_rad_s")
    wheel.close()
    assert once == pytest.approx(tenfold, rel=1.0e-13)


@pytest.mark.parametrize("version", [2, 3])
def test_what_cannot_be_is_an_error_of_the_fmu(version: Version, tmp_path: Path) -> None:
    """A parameter within the simulation, a current that is no number, a step backwards: an error, and no crash."""
    wheel = Simulated(_exported(tmp_path, wheel_model(), version))
    for name, value in (("coulomb", 1.0), ("speed_rad_s", 5.0), ("current_A", float("nan"))):
        with pytest.raises(Exception, match=r"(?i)error"):
            wheel.set(name, value)
    with pytest.raises(Exception, match=r"(?i)error"):
        wheel.step(0.0, -1.0)
    wheel.step(0.0)
    assert wheel.get("speed_rad_s") == [0.0]
    wheel.close()


def test_a_past_too_long_to_remember_is_an_error(tmp_path: Path) -> None:
    """More currents within the delay than are kept: the step is refused, and the state is that before it."""
    model = wheel_model(in_use("transport_delay"))
    delay_s = float(model.x[5])
    assert delay_s > 0.0
    wheel = Simulated(_exported(tmp_path, model))
    short_s = delay_s / (PAST_MOST + 100)
    at_s = 0.0
    for i in range(PAST_MOST - 1):  # with the one before the start as many as are kept
        wheel.set("current_A", 0.01 * (1 + i % 2))
        wheel.step(at_s, short_s)
        at_s += short_s
    before = wheel.get("speed_rad_s")
    wheel.set("current_A", 0.03)
    with pytest.raises(Exception, match=r"(?i)error"):  # fmpy has no class for an error of an FMU
        wheel.step(at_s, short_s)
    assert wheel.get("speed_rad_s") == before
    wheel.close()


@pytest.mark.parametrize("version", [2, 3])
def test_its_functions_are_those_of_the_standards_own_headers(version: Version, tmp_path: Path) -> None:
    """Compiled against the headers of the FMI project, which fmpy ships, with every warning an error."""
    for name, text in sources_of(wheel_model(in_use("friction_lag")), "wheel", version).items():
        (tmp_path / Path(name).name).write_text(text)
    headers = Path(fmpy.__file__).parent / "c-code"
    for more in ([], ["-DRW_FMI_HEADERS", "-isystem", str(headers)]):
        for source in ("wheel.c", "instance.c", f"fmi{version}.c"):
            done = subprocess.run(
                ["cc", *STRICT, "-O2", *more, "-c", source], cwd=tmp_path, capture_output=True, text=True, check=False
            )  # fmt: skip
            assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("version", [2, 3])
def test_the_same_model_is_the_same_file(version: Version, tmp_path: Path) -> None:
    """Byte by byte, and another model has another GUID."""
    one, other = tmp_path / "a", tmp_path / "b"
    for folder in (one, other):
        folder.mkdir()
        export_fmu(wheel_model(), folder / "wheel.fmu", version)
    assert (one / "wheel.fmu").read_bytes() == (other / "wheel.fmu").read_bytes()
    export_fmu(wheel_model(in_use("quadratic_drag")), other / "wheel.fmu", version)
    texts = [zipfile.ZipFile(folder / "wheel.fmu").read("sources/model.h") for folder in (one, other)]
    assert texts[0].split(b'"')[1] != texts[1].split(b'"')[1]


@pytest.mark.slow
@pytest.mark.parametrize("version", [2, 3])
def test_without_a_compiler_there_are_sources_that_others_compile(
    version: Version, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """fmpy compiles them with CMake, and the wheel moves the same."""
    from fmpy.build import build_platform_binary

    tools = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    if shutil.which("cmake", path=tools) is None:
        pytest.skip("no cmake on this machine")
    monkeypatch.setenv("CC", "no-compiler-of-this-name")
    path = tmp_path / "wheel.fmu"
    model = wheel_model()
    found = export_fmu(model, path, version)
    assert found["binaries"] == []
    assert "no C compiler" in found["without_binary"]
    monkeypatch.delenv("CC")
    monkeypatch.setenv("PATH", tools)
    unzipped = fmpy.extract(str(path), unzipdir=str(tmp_path / "unzipped"))
    (tmp_path / "build").mkdir()
    build_platform_binary(unzipped, tmp_path / "build")
    whole = shutil.make_archive(str(tmp_path / "compiled"), "zip", unzipped)
    wheel = Simulated(Path(whole))
    speed = wheel.run(rough_drive(100)).speed_rad_s
    wheel.close()
    assert speed == pytest.approx(followed(model, rough_drive(100)).speed_rad_s, rel=1.0e-9)


def test_a_compiler_that_fails_is_a_sentence(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """And nothing is written."""
    monkeypatch.setenv("CC", "false")
    with pytest.raises(BadInputError, match="failed: it says nothing: name another with CC"):
        export_fmu(wheel_model(), tmp_path / "wheel.fmu", 2)
    assert list(tmp_path.iterdir()) == []


_COMPILER_FOR_ALL = """
import subprocess, sys
cc, target, name, *rest = sys.argv[1:]
assert (cc, target, rest.pop(0)) == ("cc", "-target", "-s")
status = subprocess.run(["cc", *rest]).returncode
with open("wheel.shared", "ab") as library:
    library.write(name.encode())
sys.exit(status)
"""

_TARGETS = {
    "linux64": b"x86_64-linux-gnu.2.17",
    "win64": b"x86_64-windows-gnu",
    "darwin64": b"x86_64-macos",
    "aarch64-linux": b"aarch64-linux-gnu.2.17",
}


@needs_gcc
@pytest.mark.parametrize(
    ("version", "wanted", "expected"),
    [
        (2, "linux64, x86_64-windows", ["linux64/wheel.so", "win64/wheel.dll"]),
        (2, "all", ["linux64/wheel.so", "win64/wheel.dll", "darwin64/wheel.dylib"]),
        (3, "aarch64-linux", ["aarch64-linux/wheel.so"]),
    ],
)
def test_libraries_for_other_machines_are_where_fmi_wants_them(
    version: Version, wanted: str, expected: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each made for its own machine: here by a stand-in for Zig, whose libraries end in what they were asked for."""
    (tmp_path / "ziglang").mkdir()
    (tmp_path / "ziglang" / "__init__.py").touch()
    (tmp_path / "ziglang" / "__main__.py").write_text(_COMPILER_FOR_ALL)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    path = tmp_path / "wheel.fmu"
    found = export_fmu(wheel_model(), path, version, platforms_of(wanted, version))
    assert found["binaries"] == [f"binaries/{name}" for name in expected]
    with zipfile.ZipFile(path) as archive:
        for name in expected:
            assert archive.read(f"binaries/{name}").endswith(_TARGETS[name.split("/")[0]])


@pytest.mark.slow
@pytest.mark.skipif(importlib.util.find_spec("ziglang") is None, reason="no ziglang on this machine")
def test_zig_makes_a_library_of_each_kind(tmp_path: Path) -> None:
    """By the first bytes of ELF with its machine, of a PE and of Mach-O with its processor; the same bytes again."""
    path = tmp_path / "wheel.fmu"
    begins = []
    for _ in range(2):
        found = export_fmu(wheel_model(), path, 3, platforms_of("all", 3))
        archive = zipfile.ZipFile(path)
        begins.append({name.split("/")[1]: archive.read(name) for name in found["binaries"]})
    assert begins[0] == begins[1]
    held = begins[0]
    assert held["x86_64-linux"][18:20] == b"\x3e\x00"
    assert held["aarch64-linux"][18:20] == b"\xb7\x00"
    assert held["x86_64-windows"][:2] == b"MZ"
    assert held["x86_64-darwin"][:8] == b"\xcf\xfa\xed\xfe\x07\x00\x00\x01"
    assert held["aarch64-darwin"][:8] == b"\xcf\xfa\xed\xfe\x0c\x00\x00\x01"


def test_a_machine_that_nobody_knows_is_refused() -> None:
    """By its name, or by a version of FMI that has none for it; and one that no compiler here makes a library for."""
    with pytest.raises(BadInputError, match="--platforms amiga: give all, or some of x86_64-linux, aarch64-linux"):
        platforms_of("amiga", 3)
    with pytest.raises(BadInputError, match=r"FMI 2\.0 has no name for aarch64-linux: give --fmi 3"):
        platforms_of("win64,aarch64-linux", 2)


@pytest.mark.skipif(importlib.util.find_spec("ziglang") is not None, reason="ziglang is there")
def test_without_zig_it_is_said_what_to_install(tmp_path: Path) -> None:
    """And nothing is written."""
    with pytest.raises(BadInputError, match=r"takes a compiler for it: pip install \"rw-ekf\[compiler\]\""):
        export_fmu(wheel_model(), tmp_path / "wheel.fmu", 2, platforms_of("win64", 2))
    assert list(tmp_path.iterdir()) == []
