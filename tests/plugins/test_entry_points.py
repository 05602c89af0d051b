"""What a package of somebody else adds by entry points is used like what rw_ekf brings; one that is broken is named."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest

from rw_ekf.arrays import Float64Array
from tests.live.bench import ROOT

ACME = Path(__file__).parent / "acme"


def install(site: Path, groups: dict[str, dict[str, str]], name: str = "acme-wheels") -> None:
    """What pip leaves of a package for importlib.metadata: its name, its version, its entry points."""
    info = site / f"{name.replace('-', '_')}-1.0.dist-info"
    info.mkdir(parents=True)
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n", encoding="utf-8")
    points = [f"[{group}]\n" + "".join(f"{k} = {v}\n" for k, v in found.items()) for group, found in groups.items()]
    (info / "entry_points.txt").write_text("\n".join(points), encoding="utf-8")


def environment(site: Path) -> dict[str, str]:
    """With that package, and a cache of compiled routines of its own."""
    path = os.pathsep.join([str(ROOT), str(ACME), str(site)])
    return {**os.environ, "PYTHONPATH": path, "RW_EKF_CACHE_DIR": str(site / "cache")}


@pytest.fixture
def site(tmp_path: Path) -> Path:
    """A folder in which the example package is installed."""
    site = tmp_path / "site"
    install(site, tomllib.loads((ACME / "pyproject.toml").read_text(encoding="utf-8"))["project"]["entry-points"])
    return site


def command(site: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    """`rw-ekf ARGUMENTS` with what is installed there."""
    return subprocess.run(
        [sys.executable, "-m", "rw_ekf", *arguments],
        capture_output=True, text=True, check=False, cwd=site, env=environment(site),
    )  # fmt: skip


def python(site: Path, code: str) -> str:
    """What a program prints with what is installed there."""
    done = subprocess.run(
        [sys.executable, "-c", code],
        capture_output=True, text=True, check=False, cwd=site, env=environment(site),
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()


def test_a_log_of_its_format_is_read(site: Path) -> None:
    """By the first bytes, whatever it is called; CSV is CSV as before."""
    (site / "run.csv").write_text("ACME recorder 3\n0 0 100\n100 12.5 100\n200 25 0\n", encoding="utf-8")
    (site / "plain.csv").write_text(
        "time_s,speed_rpm,current_command_A\n0,0,.1\n.1,12.5,.1\n.2,25,0\n", encoding="utf-8"
    )
    code = "import rw_ekf; a, b = rw_ekf.read('run.csv'), rw_ekf.read('plain.csv');"
    code += "print((a.speed_rad_s == b.speed_rad_s).all(), (a.time_s == b.time_s).all(), len(a))"
    assert python(site, code) == "True True 3"
    (site / "bad.csv").write_text("ACME recorder 3\n0 zero 100\n", encoding="utf-8")
    done = command(site, "replay", "bad.csv")
    assert done.returncode == 2
    assert "is a damaged recording" in done.stderr
    assert "Traceback" not in done.stderr


def test_its_scheme_and_its_protocol_are_taken_by_a_configuration(site: Path) -> None:
    """check-config takes both by name, and lists them where a name is wrong; the bench has the scheme."""
    wire = (ROOT / "config" / "sunspace-wheel.yaml").read_text(encoding="utf-8")
    (site / "acme.yaml").write_text(f"family: acme\n{wire}", encoding="utf-8")
    text = "wheel: {{port: /dev/null, protocol: acme.yaml}}\nlimits: {{current_A: 0.6}}\n"
    text += "command: {{profile: zero}}\ncompensation: {{scheme: {}}}\n"
    (site / "good.yaml").write_text(text.format("acme_viscous"), encoding="utf-8")
    done = command(site, "check-config", "good.yaml")
    assert done.returncode == 0, done.stderr
    (site / "bad.yaml").write_text(text.format("acme_viscus"), encoding="utf-8")
    done = command(site, "check-config", "bad.yaml")
    assert done.returncode == 2
    assert "acme_viscous" in done.stderr
    baud = "from rw_ekf.attach.wire import load_protocol; print(load_protocol('acme.yaml').wire_map.link.baud)"
    assert python(site, baud) == "115200"
    entry = "from rw_ekf.control.compensation.schemes import SCHEMES; print(SCHEMES['acme_viscous'].source)"
    assert python(site, entry) == "a lab's own"


def test_its_sink_gets_every_sample_and_never_keeps_the_loop_waiting(site: Path) -> None:
    """It is behind a guard with a queue of its own, though it did not ask for one."""
    code = """
import types, pathlib
from rw_ekf.sinks.all_sinks import SINKS, _all_sinks
files = types.SimpleNamespace(log=pathlib.Path('run.csv'))
kinds = _all_sinks()
sink, queue = kinds['acme_counter'].make(types.SimpleNamespace(files=files))
for _ in range(7):
    sink.write(None)
sink.close()
print(list(kinds) == [*SINKS, 'acme_counter'], queue.ticks > 0, pathlib.Path('run.count').read_text().strip())
"""
    assert python(site, code) == "True True 7"


@pytest.mark.parametrize(
    ("group", "value", "words"),
    [
        ("rw_ekf.effects", "acme_wheels.nothing", "cannot be loaded (ModuleNotFoundError"),
        ("rw_ekf.effects", "acme_wheels.recorder", "must name a module with a class that derives from an effect"),
        ("rw_ekf.log_formats", "acme_wheels.counter:KIND", "must be a LogFormat"),
        ("rw_ekf.compensations", "acme_wheels.counter:KIND", "must be a SchemeEntry"),
        ("rw_ekf.sinks", "acme_wheels.recorder:FORMAT", "must be a SinkKind"),
    ],
)
def test_a_broken_one_is_named_in_a_sentence(tmp_path: Path, group: str, value: str, words: str) -> None:
    """Which package, which entry point, what is wrong; status 2, no traceback."""
    install(tmp_path, {group: {"odd": value}}, "odd-lab")
    use = {
        "rw_ekf.effects": "import rw_ekf.effects.catalogue",
        "rw_ekf.log_formats": "import pathlib, rw_ekf.logs.formats as f; pathlib.Path('a').write_text('1');"
        " f.format_of(pathlib.Path('a'), 'a')",
        "rw_ekf.compensations": "import rw_ekf.control.compensation.schemes",
        "rw_ekf.sinks": "import rw_ekf.sinks.all_sinks as r; r._all_sinks()",
    }[group]
    code = f"from rw_ekf.errors import ConfigError\ntry:\n    {use}\nexcept ConfigError as error:\n    print(error)"
    stated = python(tmp_path, code)
    assert f"{group}: 'odd' of the package odd-lab 1.0" in stated
    assert words in stated


def test_a_broken_effect_ends_a_diagnosis_in_words(tmp_path: Path) -> None:
    """And not `--help` or `stop`, which need none."""
    install(tmp_path, {"rw_ekf.effects": {"odd": "acme_wheels.nothing"}}, "odd-lab")
    (tmp_path / "log.csv").write_text("time_s,speed_rpm,current_A\n0,1,0\n1,2,0\n", encoding="utf-8")
    done = command(tmp_path, "diagnose", "log.csv")
    assert done.returncode == 2
    assert "odd-lab 1.0" in done.stderr
    assert "Traceback" not in done.stderr
    assert command(tmp_path, "--help").returncode == 0


def test_a_name_that_is_taken_is_refused(tmp_path: Path) -> None:
    """Nobody reads `csv` in the place of rw_ekf unseen."""
    install(tmp_path, {"rw_ekf.log_formats": {"csv": "acme_wheels.recorder:FORMAT"}}, "odd-lab")
    (tmp_path / "log.csv").write_text("time_s,speed_rpm,current_A\n0,1,0\n1,2,0\n", encoding="utf-8")
    done = command(tmp_path, "replay", "log.csv")
    assert done.returncode == 2
    assert "registers 'csv', which rw_ekf has already" in done.stderr


@pytest.mark.slow
def test_its_effect_is_found_in_a_record_of_a_wheel_that_has_it(site: Path, pytestconfig: pytest.Config) -> None:
    """A wheel with a seal, integrated here; `diagnose` names the effect with its size, and `replay` takes the model.

    What is compiled for it is kept where pytest keeps what it knows, as with a user: it is anew where a source is.
    """
    if pytestconfig.cache is not None:
        (site / "cache").symlink_to(pytestconfig.cache.mkdir("acme-kernels"))
    rows, size = wheel_with_a_seal()
    table = "\n".join(",".join(f"{value:.6g}" for value in row) for row in rows)
    (site / "seal.csv").write_text(f"time_s,speed_rpm,current_command_A\n{table}\n", encoding="utf-8")
    done = command(site, "diagnose", "seal.csv", "--json", "--out", "report")
    assert done.returncode == 0, done.stderr
    document = json.loads(done.stdout)
    assert document["verdict"]["effects"] == ["seal_drag"]
    found = next(item for item in document["candidates"] if item["effect"] == "seal_drag")
    reported = found["parameters"]["coefficient_rad_s3"]
    assert abs(reported["value"] - size) < 4.0 * reported["std"]
    assert reported["std"] < 0.1 * size
    done = command(site, "replay", "seal.csv", "--model", "report/augmented-model.yaml", "--json")
    assert done.returncode == 0, done.stderr


def wheel_with_a_seal() -> tuple[Float64Array, float]:
    """Rows (n, 3) of time [s], speed [rpm] and current [A] at 10 Hz, 1 rpm of noise; and the seal's coefficient."""
    gain, viscous, coulomb, static, size = 15.2, 0.0032, 0.59, 0.69, 0.04
    rng, step_s = np.random.default_rng(8), 1e-3
    time_s = np.arange(0.0, 400.0, 0.1)
    drawn = rng.uniform(0.0, 2.0 * np.pi, 3)
    current = 0.09 * sum(np.sin(2.0 * np.pi * time_s / p + d) for p, d in zip((31.0, 73.0, 170.0), drawn, strict=True))
    omega, speeds = 0.0, np.zeros(time_s.size)
    for row, amperes in enumerate(current):
        speeds[row] = omega
        for _ in range(round(0.1 / step_s)):
            drive = gain * amperes
            if omega == 0.0 and abs(drive) <= static:
                continue
            way = np.sign(omega) or np.sign(drive)
            dry = coulomb + (static - coulomb) * np.exp(-((omega / 0.42) ** 2)) + size * np.sqrt(abs(omega))
            changed = omega + step_s * (drive - viscous * omega - way * dry)
            omega = 0.0 if omega * changed < 0.0 else changed
    rpm = speeds * 30.0 / np.pi + rng.standard_normal(time_s.size)
    return np.column_stack((time_s, rpm, current)), size
