"""The command line answers at once: help, stop and check-config import nothing heavy; every verb shows an example."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from rw_ekf.cli import VERBS, main
from tests.live.bench import ROOT, served_wheel, write_config

HEAVY = ("numpy", "numba", "scipy", "filterpy", "pyarrow", "matplotlib", "rw_ekf.filter", "rw_ekf.diagnosis")
PROBE = """
import sys
from rw_ekf.cli import main
try:
    status = main(sys.argv[1:])
except SystemExit as left:
    status = left.code
print(",".join(name for name in {heavy!r} if name in sys.modules), file=sys.stderr)
sys.exit(status)
"""


def heavy_imports(*arguments: str) -> tuple[int, str]:
    """Exit status of a command, and which heavy modules it had imported at its end."""
    done = subprocess.run(
        [sys.executable, "-c", PROBE.format(heavy=HEAVY), *arguments],
        capture_output=True, text=True, cwd=ROOT, check=False,
    )  # fmt: skip
    return done.returncode, done.stderr.splitlines()[-1]


@pytest.mark.parametrize("verb", VERBS)
def test_every_verb_has_help_with_an_example_and_json(verb: str, capsys: pytest.CaptureFixture[str]) -> None:
    """`VERB --help` exits 0, shows `rw-ekf VERB` as an example, and names --json."""
    with pytest.raises(SystemExit) as left:
        main([verb, "--help"])
    assert left.value.code == 0
    text = capsys.readouterr().out
    assert f"rw-ekf {verb}" in text[text.index("example:") :]
    assert "--json" in text


@pytest.mark.parametrize("arguments", [(), ("nonsense",), ("replay",), ("run",), ("stop", "--nonsense")])
def test_wrong_usage_exits_2_with_a_sentence(arguments: tuple[str, ...], capsys: pytest.CaptureFixture[str]) -> None:
    """No verb, an unknown one, a missing argument, an unknown option: status 2, usage on standard error."""
    with pytest.raises(SystemExit) as left:
        main(arguments)
    assert left.value.code == 2
    out, errors = capsys.readouterr()
    assert out == ""
    assert "usage: rw-ekf" in errors


@pytest.mark.parametrize("text", ["0", "-1", "nan", "inf", "soon"])
def test_a_duration_must_be_a_positive_number(text: str, capsys: pytest.CaptureFixture[str]) -> None:
    """run --duration takes finite seconds above zero and nothing else."""
    with pytest.raises(SystemExit) as left:
        main(["run", "--config", "x.yaml", "--duration", text])
    assert left.value.code == 2
    assert "--duration" in capsys.readouterr().err


def threads_for_linear_algebra(first: str, environment: dict[str, str]) -> str:
    """What a process sees that does this first: the variables, and its threads after a product."""
    probe = (
        f"{first}\nimport os, numpy; a = numpy.ones((500, 500)); a @ a; "
        "print(*(os.environ.get(f'{name}_NUM_THREADS') for name in ('OPENBLAS', 'OMP', 'MKL')), "
        "len(os.listdir('/proc/self/task')) if os.path.isdir('/proc/self/task') else 1)"
    )
    unset = {name: value for name, value in os.environ.items() if not name.endswith("_NUM_THREADS")}
    return subprocess.run(
        [sys.executable, "-c", probe], capture_output=True, text=True, cwd=ROOT, check=True, env=unset | environment
    ).stdout.strip()


def test_a_command_has_one_thread_for_linear_algebra() -> None:
    """A verb leaves one thread (decision 0005); what was set outside stays."""
    verb = "from rw_ekf.cli import main\ntry: main(['check-config', 'nothing'])\nexcept SystemExit: pass"
    assert threads_for_linear_algebra(verb, {}) == "1 1 1 1"
    assert threads_for_linear_algebra(verb, {"MKL_NUM_THREADS": "3"}) == "1 1 3 1"


def test_the_library_leaves_a_program_its_threads() -> None:
    """Importing it sets no variable; while it computes, the linear algebra has one thread, then as many as before."""
    assert threads_for_linear_algebra("import rw_ekf", {}).startswith("None None None ")
    probe = (
        "import numpy, rw_ekf\nfrom threadpoolctl import threadpool_info as info\n"
        "from rw_ekf.one_thread import one_thread\n"
        "def threads(): return [pool['num_threads'] for pool in info() if pool['user_api'] == 'blas']\n"
        "before = threads()\nwith one_thread(): assert set(threads()) <= {1}\nassert threads() == before"
    )
    subprocess.run([sys.executable, "-c", probe], cwd=ROOT, check=True)


def test_help_and_check_config_import_nothing_heavy(tmp_path: Path) -> None:
    """Neither the help of all and of each verb, nor a check, loads numpy or anything like it."""
    config = write_config(tmp_path, "/dev/ttyUSB0")
    for arguments in (("--help",), ("run", "--help"), ("replay", "--help"), ("check-config", str(config))):
        assert heavy_imports(*arguments) == (0, ""), arguments


def test_stop_imports_nothing_heavy(tmp_path: Path) -> None:
    """`stop` on a wheel loads no heavy module, and nothing of the filter; `tools.measure.startup` has the times."""
    with served_wheel(tmp_path) as bench:
        assert heavy_imports("stop", "--config", str(bench.config())) == (0, "")
