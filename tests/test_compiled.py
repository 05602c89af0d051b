"""What is compiled: as exact as Python, never older than the equations in it, and no worse for a bad disk or none."""

from __future__ import annotations

import importlib.util
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest

from rw_ekf.arrays import Float64Array
from rw_ekf.c_code import c_library
from rw_ekf.c_code.c_library import CompilerError
from rw_ekf.compiled import Kernel, source_digest
from tests.c_code.modules import load

TRIPLE = "def gain(x: float) -> float:\n    return 3.0 * x\n"
CALLER = "import {physics}\n\n\ndef law(x: float) -> float:\n    return {physics}.gain(x)\n"


@pytest.fixture(autouse=True)
def workplace(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A folder of its own for modules, and for what is compiled of them; and nobody stays plain after a test."""
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    monkeypatch.setenv(c_library.FOLDER_VARIABLE, str(tmp_path / "kept"))
    before = Kernel.interpreting
    yield tmp_path
    Kernel.interpreting = before


def test_the_digest_follows_the_source_of_every_module(workplace: Path) -> None:
    """One changed character in any of the modules gives another digest; the same text gives the same."""
    a = load(workplace, "digest_a", "X = 1\n")
    b = load(workplace, "digest_b", "Y = 1\n")
    before = source_digest([a, b])
    assert source_digest([a, b]) == before
    other = load(workplace, "digest_c", "Y = 2\n")
    assert source_digest([a, other]) != before
    assert source_digest([a]) != before


def law_over(folder: Path, physics_source: str) -> Kernel:
    """A caller over a module of physics, both read afresh."""
    physics = load(folder, "kept_physics", physics_source)
    caller = load(folder, "kept_caller", CALLER.format(physics="kept_physics"))
    return Kernel(caller.law, [physics, caller], lambda: (1.0,), result=0.0)


def value_and_readiness(folder: Path, physics_source: str) -> tuple[float, bool]:
    """What the law gives for 2.0, and whether it was kept from before."""
    law = law_over(folder, physics_source)
    kept = law.is_ready()
    return law(2.0), kept


def test_a_kernel_is_never_older_than_the_equations_in_it(workplace: Path) -> None:
    """Unchanged sources are served from disk; a change in another module than the function's own is compiled anew."""
    assert value_and_readiness(workplace, TRIPLE) == (6.0, False)
    assert value_and_readiness(workplace, TRIPLE) == (6.0, True)
    assert value_and_readiness(workplace, TRIPLE.replace("3.0", "5.0")) == (10.0, False)
    assert len(list((workplace / "kept").iterdir())) == 1  # the stale one is gone


def test_a_file_that_is_damaged_is_made_anew(workplace: Path) -> None:
    """Whatever a power cut or a worn card has made of it, it is never loaded: not ready, compiled once more, served."""
    value_and_readiness(workplace, TRIPLE)
    (file,) = (workplace / "kept").iterdir()
    whole = file.read_bytes()
    middle = len(whole) // 2
    flipped = whole[:middle] + bytes([whole[middle] ^ 0x10]) + whole[middle + 1 :]
    for damaged in (b"", whole[:middle], bytes(len(whole)), flipped, whole + b" "):
        file.unlink()  # another file, as what is loaded stays mapped
        file.write_bytes(damaged)
        assert value_and_readiness(workplace, TRIPLE) == (6.0, False)
        assert value_and_readiness(workplace, TRIPLE) == (6.0, True)


def test_no_folder_that_can_be_written_costs_the_file_and_not_the_run(
    workplace: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where nothing can be kept it is compiled for this process: no exception, the right number, nothing left."""
    (workplace / "kept").write_text("a file where the folder should be", encoding="utf-8")
    (workplace / "temporary").mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(workplace / "temporary"))
    law = law_over(workplace, TRIPLE)
    assert law(2.0) == 6.0
    assert (law.is_ready(), law.is_kept()) == (True, False)
    assert list((workplace / "temporary").iterdir()) == []


def test_a_user_without_a_home_has_one_folder_less(monkeypatch: pytest.MonkeyPatch) -> None:
    """Neither HOME nor an entry for the user: libraries are kept beside the program only."""
    monkeypatch.delenv(c_library.FOLDER_VARIABLE)
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    monkeypatch.delenv("HOME")
    monkeypatch.setattr(os.path, "expanduser", str)
    assert [folder.name for folder in c_library.folders()] == ["__pycache__"]


def test_the_folder_of_the_day_serves(workplace: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A folder that is told as "." keeps libraries that are found again."""
    monkeypatch.chdir(workplace)
    monkeypatch.setenv(c_library.FOLDER_VARIABLE, ".")
    assert value_and_readiness(workplace, TRIPLE) == (6.0, False)
    assert value_and_readiness(workplace, TRIPLE) == (6.0, True)


def test_no_room_for_the_compiler_is_a_word(workplace: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where no temporary file can be written it runs as plain Python, and TMPDIR is named."""
    monkeypatch.setattr(tempfile, "tempdir", None)
    monkeypatch.setattr(tempfile, "_candidate_tempdir_list", lambda: [str(workplace / "nowhere")])
    with pytest.warns(RuntimeWarning, match="TMPDIR: No usable temporary directory"):
        assert law_over(workplace, TRIPLE)(2.0) == 6.0


def compiler_of(folder: Path, *lines: str) -> str:
    """A compiler's command, written in shell; `$made` is what it is to write."""
    script = folder / "odd-cc"
    made = 'made=$(echo "$@" | sed "s/.* -o //; s/ .*//")'
    script.write_text("\n".join(["#!/bin/sh", made, *lines, ""]), encoding="utf-8")
    script.chmod(0o755)
    return str(script)


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("exit 0", "status 0, and no library"),
        (': > "$made"', "file too short"),
        ('echo "int other;" | cc -shared -x c -o "$made" -', "no rw_run"),
        ("kill -9 $$", "status -9"),
    ],
)
def test_what_is_no_library_is_not_kept(
    workplace: Path, monkeypatch: pytest.MonkeyPatch, line: str, words: str
) -> None:
    """A compiler that makes nothing, or nothing of use: one warning, the right number, and nothing on disk."""
    monkeypatch.setenv(c_library.COMPILER_VARIABLE, compiler_of(workplace, line))
    with pytest.warns(RuntimeWarning, match=words):
        assert law_over(workplace, TRIPLE)(2.0) == 6.0
    assert not list((workplace / "kept").glob("*"))


def test_a_compiler_may_say_much(workplace: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """More warnings than a pipe holds do not stop it: it ends by itself, and what it made is used."""
    loud = compiler_of(workplace, "head -c 300000 /dev/zero >&2", 'exec cc "$@"')
    monkeypatch.setenv(c_library.COMPILER_VARIABLE, loud)
    law = law_over(workplace, TRIPLE)
    with law.begin() as compilation:
        assert compilation.process.wait(timeout=60.0) == 0  # against a hang only
        law.end(compilation)
    assert law.is_kept()


@pytest.mark.parametrize(
    ("command", "words"),
    [
        ("no-such-compiler-anywhere", "no C compiler"),
        ("false", "false: status 1"),
        ("none", "no C compiler"),
        (" ", "no C compiler"),
        ("cc 'unended", "no C compiler"),
    ],
)
def test_without_a_compiler_all_runs_as_plain_python(
    workplace: Path, monkeypatch: pytest.MonkeyPatch, command: str, words: str
) -> None:
    """None, one that fails, or one that is not wanted: one warning that says so, and the right number."""
    monkeypatch.setenv(c_library.COMPILER_VARIABLE, command)
    law = law_over(workplace, TRIPLE)
    with pytest.warns(RuntimeWarning, match=words):
        assert law(2.0) == 6.0
    assert law(3.0) == 9.0


def test_an_interrupted_compiler_is_ended(workplace: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Whatever is raised while it works, its process ends with those that it started."""
    os.mkfifo(workplace / "held")
    slow = compiler_of(workplace, f"sleep 600 > '{workplace / 'held'}'", "true")
    monkeypatch.setenv(c_library.COMPILER_VARIABLE, slow)
    compilation = law_over(workplace, TRIPLE).begin()
    held = (workplace / "held").open("rb")

    def interrupted() -> None:
        with compilation:
            assert compilation.process.poll() is None
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert compilation.process.poll() is not None
    with held:
        assert held.read() == b""  # ends as soon as nobody can write any more


def test_what_a_compiler_is_told_does_not_change_the_arithmetic(
    workplace: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With -ffast-math in its command, no number is still none."""
    monkeypatch.setenv(c_library.COMPILER_VARIABLE, "cc -ffast-math")
    same = load(workplace, "kept_same", "def law(x: float) -> float:\n    return 1.0 if x != x else 0.0\n")
    assert Kernel(same.law, [same], lambda: (1.0,), result=0.0)(float("nan")) == 1.0


class Pair(NamedTuple):
    """Two numbers."""

    whole: int
    size: float


class Held(NamedTuple):
    """Arrays of every kind, and what stands between them."""

    flags: Any
    small: Any
    middle: Any
    whole: Any
    pair: Pair
    stack: Any
    row: tuple[float, float]
    is_on: bool


def gather(held: Held, table: Any, shift: float, out: Any) -> Pair:
    """A little of everything: rows, stretches, whole numbers, flags, branches on what is never there."""
    total = shift
    if table is not None:
        total += 1.0e9
    for i in range(held.flags.size):
        if held.flags[i] and held.is_on:
            total += held.small[i] * held.middle[i] + held.whole[i] // 2 + held.whole[i] % 3
    layer = held.stack[1]
    n, m = layer.shape
    for i in range(n):
        line = layer[i]
        for j in range(m):
            out[i, j] = line[j] + held.stack[0, i, j]
    end = out[0][1:3]
    end[0] += held.row[0] - held.row[1]
    out[1, :] = held.pair.size
    return Pair(held.pair.whole + held.stack.shape[0], total)


def test_every_kind_of_argument_arrives_and_every_result_comes_back() -> None:
    """Arrays of five kinds and up to three axes, tuples in tuples, flags: to the bit what Python makes of them."""
    held = Held(
        np.array([True, False, True, True]), np.array([1, -2, 3, -4], np.int8), np.array([5, 6, 7, 8], np.int32),
        np.array([9, 10, 11, 2**40], np.int64), Pair(3, 0.1), np.arange(24.0).reshape(2, 3, 4) / 7.0, (0.3, 0.2), True,
    )  # fmt: skip
    example = (held, None, 0.0, np.zeros((3, 4)))
    compiled = Kernel(gather, [sys.modules[__name__]], lambda: example, result=Pair(0, 0.0))
    expected, found = np.zeros((3, 4)), np.zeros((3, 4))
    held.whole[3] = 14  # whole numbers are reckoned with as C's int
    assert compiled(held, None, 0.5, found) == gather(held, None, 0.5, expected)
    assert found.tobytes() == expected.tobytes()


def _gathering() -> tuple[Kernel, Held]:
    held = Held(
        np.zeros(0, bool), np.zeros(0, np.int8), np.zeros(0, np.int32), np.zeros(0, np.int64), Pair(0, 0.0),
        np.arange(24.0).reshape(2, 3, 4), (0.3, 0.2), False,
    )  # fmt: skip
    example = (held, None, 0.0, np.zeros((3, 4)))
    return Kernel(gather, [sys.modules[__name__]], lambda: example, result=Pair(0, 0.0)), held


@pytest.mark.parametrize("odd", [np.zeros((3, 4), np.float32), np.zeros(12)])
def test_an_array_of_another_kind_is_refused(odd: Any) -> None:
    """Another type, another number of axes: TypeError, and nothing is read."""
    compiled, held = _gathering()
    with pytest.raises(TypeError, match="where C reads float64"):
        compiled(held, None, 0.5, odd)


@pytest.mark.parametrize("scattered", [np.zeros((3, 8))[:, ::2], np.asfortranarray(np.zeros((3, 4)))])
def test_what_is_scattered_in_memory_is_read_and_written(scattered: Any) -> None:
    """Every second column, or columns first, within a tuple or not: the numbers are those of arrays in order."""
    compiled, held = _gathering()
    expected = np.zeros((3, 4))
    assert compiled(held, None, 0.5, expected) == compiled(held, None, 0.5, scattered)
    assert np.array_equal(scattered, expected)
    turned = held._replace(stack=np.asfortranarray(held.stack))
    found = np.zeros((3, 4))
    assert compiled(turned, None, 0.5, found) == compiled(held, None, 0.5, expected)
    assert np.array_equal(found, expected)


def test_what_has_no_c_says_where(workplace: Path) -> None:
    """A construct that is not printed is named with its function."""
    odd = load(workplace, "odd_law", "def law(x: float) -> float:\n    return sum([x, x])\n")
    with pytest.raises(CompilerError, match=r"odd_law\.law"):
        Kernel(odd.law, [odd], lambda: (1.0,), result=0.0).compile()


def test_what_is_loaded_needs_no_printer() -> None:
    """A process that finds its libraries on disk imports neither the printer nor a compiler: that is its speed."""
    code = (
        "import sys; from rw_ekf.compile_ahead import DIAGNOSIS, compile_all; compile_all(DIAGNOSIS);"
        "print(sorted({'rw_ekf.c_code.c_program', 'rw_ekf.c_code.c_kernel', 'numba'} & set(sys.modules)))"
    )
    reported = ""
    for _ in range(2):  # the first has to compile
        reported = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert reported.strip() == "[]"


@pytest.mark.slow
@pytest.mark.parametrize("command", ["gcc", "clang", f"{sys.executable} -m ziglang cc"])
def test_other_compilers_make_the_same_bits(workplace: Path, monkeypatch: pytest.MonkeyPatch, command: str) -> None:
    """Each compiler that is found compiles the filter's pass, and its steps are Python's to the last bit."""
    monkeypatch.setenv(c_library.COMPILER_VARIABLE, command)
    if "ziglang" in command and importlib.util.find_spec("ziglang") is None:
        pytest.skip(f"{command} is not installed")
    if "ziglang" not in command and shutil.which(command) is None:
        pytest.skip(f"{command} is not installed")
    from rw_ekf.filter import kernel as home

    own = Kernel(home._filter_pass, home._MODULES, lambda: home._example(with_effects=False), "other_compiler")
    own.compile()
    from rw_ekf.course.course import Course
    from rw_ekf.filter.belief import DEFAULT_PRIOR
    from rw_ekf.filter.constants import filter_constants
    from rw_ekf.filter.filter_run import FilterRun
    from rw_ekf.filter.step import memory_of

    rng = np.random.default_rng(5)
    time_s: Float64Array = 0.1 * np.arange(400, dtype=np.float64)
    course = Course.of(time_s, np.cumsum(rng.normal(0.0, 0.3, 400)), 0.2 * np.sin(0.3 * time_s))
    runs = []
    for run_by in (own, own.plain):
        constants = filter_constants(0.4)
        run = FilterRun.empty(DEFAULT_PRIOR.mean, DEFAULT_PRIOR.covariance, 400, states=True)
        run_by(
            constants, None, course, run, memory_of(run.mean, run.covariance, constants, None, mends=True),
            home.nothing_past(), 0,
        )  # fmt: skip
        runs.append(run)
    assert runs[0].states.tobytes() == runs[1].states.tobytes()
