"""A cold cache: what has to be compiled is said, runs in killable children, and is never needed at a run's end."""

from __future__ import annotations

import contextlib
import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from rw_ekf import compile_ahead
from rw_ekf.arrays import Float64Array
from rw_ekf.compiled import interpreted
from rw_ekf.course.course import Course
from rw_ekf.residual_judgement import consistency_now, judge_log
from rw_ekf.starting_point import setup_of_record
from tests.commands.logs import write_log
from tests.diagnosis.simulated import simulated
from tests.live.bench import ROOT, program, rw_ekf, served_wheel, wait_for

HITS = """
import sys
from rw_ekf import compile_ahead
from rw_ekf.commands.first_use import make_ready
names = compile_ahead.LEAST_SQUARES
print(len(compile_ahead.cold(names)))
make_ready(names)
print(len(compile_ahead.cold(names)))
make_ready(names)
"""


def compiled_files(folder: Path) -> list[Path]:
    """Compiled routines of a cache."""
    return list(folder.rglob("*.so"))


def cold_cache(folder: Path) -> dict[str, str]:
    """An environment in which nothing is compiled yet."""
    return {**os.environ, "RW_EKF_CACHE_DIR": str(folder)}


def has_children(pid: int) -> bool:
    """Whether a process has started another that lives."""
    for path in Path("/proc").glob("[0-9]*/stat"):
        with contextlib.suppress(OSError):
            if path.read_text(encoding="utf-8", errors="replace").rpartition(")")[2].split()[1] == str(pid):
                return True
    return False


def test_children_fill_the_cache_and_a_word_is_said_once(tmp_path: Path) -> None:
    """One line says what is compiled; then it is kept, and nothing is said."""
    done = subprocess.run(
        [sys.executable, "-c", HITS], env=cold_cache(tmp_path), cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert done.stdout.split() == ["1", "0"], done.stderr
    assert done.stderr.count("\n") == 1
    assert "first use: compiling 1 numerical routines" in done.stderr
    assert len(compiled_files(tmp_path)) == 1


def test_an_interrupt_ends_the_compilation(tmp_path: Path) -> None:
    """Ctrl-C while diagnose compiles: status 130, one word, no traceback, and the great kernels were not waited for."""
    run = simulated(seed=5, samples=1500)
    log = write_log(tmp_path / "log.csv", [run.time_s, run.measured_speed_rad_s, run.current_command_A])
    cache = tmp_path / "cache"
    # Tests that a shell started in the background ignore SIGINT, and so would what they start.
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    with contextlib.ExitStack() as stack:
        stack.callback(signal.signal, signal.SIGINT, before)
        process = stack.enter_context(program("diagnose", str(log), env=cold_cache(cache)))
        assert process.stderr is not None
        assert "first use" in process.stderr.readline()
        wait_for(lambda: has_children(process.pid))  # the compilers
        process.send_signal(signal.SIGINT)
        out, errors = process.communicate(timeout=60.0)  # against a hang only
    assert process.returncode == 130
    assert (out, errors) == ("", "rw-ekf: interrupted\n")
    assert not any("_filter_pass" in path.name for path in compiled_files(cache))


def test_plain_python_does_what_a_compiler_may_not(tmp_path: Path) -> None:
    """Without a compiler replay and fit say so in one line, compile nothing and print what compiled code does."""
    run = simulated(seed=5, samples=600)
    log = write_log(tmp_path / "log.csv", [run.time_s, run.measured_speed_rad_s, run.current_command_A])
    plain = {**cold_cache(tmp_path / "cache"), "RW_EKF_CC": "none"}
    for verb in ("replay", "fit"):
        done = rw_ekf(verb, str(log), env=plain)
        assert done.returncode == 0, done.stderr
        assert done.stderr.startswith("rw-ekf: all runs as plain Python")
        assert done.stderr.count("\n") == 1
        assert done.stdout == rw_ekf(verb, str(log)).stdout
    assert compiled_files(tmp_path) == []


@pytest.mark.parametrize("more", [{}, {"RW_EKF_CC": "none"}])
def test_a_run_ends_without_a_compiler(tmp_path: Path, more: dict[str, str]) -> None:
    """Cold cache, or no compiler: a run judges its residual, finds it twice as noisy as told, compiles nothing."""
    cache = tmp_path / "cache"
    with served_wheel(tmp_path, initial_speed_rad_s=60.0, noise_rpm=2.0) as bench:
        limits = {"current_A": 0.6, "silence_s": 10.0}  # a busy machine makes no difference to what is tested
        config = bench.config(limits=limits, watch={"enabled": False})
        done = rw_ekf("run", "--config", str(config), "--duration", "13", env=cold_cache(cache) | more)
    assert done.returncode == 0, done.stderr
    assert done.stdout.count("times what the configured noise implies (larger)") == 1
    assert "configured noise" not in done.stderr
    assert f"rw-ekf fit {bench.logs()[0]} --noise" in done.stdout
    assert "zero_current=confirmed" in done.stderr
    assert compiled_files(cache) == []


@pytest.mark.parametrize("effects", [[], ["offset_torque"]])
def test_plain_python_judges_as_the_compiled_routine_does(effects: list[str], monkeypatch: pytest.MonkeyPatch) -> None:
    """The tests of a log's residual give the same p-values whether the cache is warm or cold."""
    run = simulated(effects, seed=3, samples=900)
    course = Course.of(run.time_s, run.measured_speed_rad_s, run.current_command_A)
    setup = setup_of_record(course)
    with interpreted():
        warm = judge_log(course, setup, setup.prior)
        monkeypatch.setattr(compile_ahead, "cold", list)
        cold, looked_at = consistency_now(course, setup, setup.prior)
    assert looked_at == 900
    compiled = judge_log(course, setup, setup.prior)
    assert cold == warm
    assert cold.whiteness_p == pytest.approx(compiled.whiteness_p, rel=1e-6, abs=1e-12)
    assert cold.mean_p == pytest.approx(compiled.mean_p, rel=1e-6, abs=1e-12)
    assert cold.is_noise is (not effects)


def test_the_head_of_a_log_has_the_pieces_of_its_own_samples() -> None:
    """Cut at any sample, a log with delayed commands still says when each of its pieces of current begins."""
    time_s: Float64Array = 0.1 * np.arange(50, dtype=np.float64)
    course = Course.of(time_s, np.ones(50), np.sin(time_s), np.full(50, 0.01), np.repeat([0, 1], 25))
    for n in (1, 24, 25, 26, 49):
        head = course.window(0, n)
        assert head.pieces.begin_s == pytest.approx(course.pieces.begin_s[: head.pieces.duration_s.size])
        assert head.piece_start[-1] <= head.pieces.duration_s.size


def test_compile_says_what_the_next_command_finds(tmp_path: Path) -> None:
    """Where nothing can be kept, all are left and the status is 1; a folder that can is named as what to give."""
    (tmp_path / "file").write_text("", encoding="utf-8")
    done = rw_ekf("compile", "--json", env=cold_cache(tmp_path / "file"))
    reported = json.loads(done.stdout)
    assert (done.returncode, reported["compiled"]) == (1, [])
    assert set(reported["left"]) == set(compile_ahead.DIAGNOSIS)
    assert "for this time only" in done.stderr
    assert "set RW_EKF_CACHE_DIR" in done.stderr
