"""The cache on disk: it must notice any change in the equations."""

from __future__ import annotations

import importlib.util
import pickle
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import numba
import pytest

from rw_ekf.compiled import Kernel, compile_cached, make_jitable, source_digest


@pytest.fixture
def workplace(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder of its own for modules, and for numba's files beside them."""
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    monkeypatch.setattr(numba.config, "CACHE_DIR", "")
    return tmp_path


def load(folder: Path, name: str, source: str) -> ModuleType:
    """Write a module and import it afresh."""
    path = folder / f"{name}.py"
    path.write_text(source, encoding="utf-8")
    spec = importlib.util.spec_from_file_location(name, path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    spec.loader.exec_module(module)
    return module


def test_the_digest_follows_the_source_of_every_module(workplace: Path) -> None:
    """One changed character in any of the modules gives another digest; the same text gives the same."""
    a = load(workplace, "digest_a", "X = 1\n")
    b = load(workplace, "digest_b", "Y = 1\n")
    before = source_digest([a, b])
    assert source_digest([a, b]) == before
    other = load(workplace, "digest_c", "Y = 2\n")
    assert source_digest([a, other]) != before
    assert source_digest([a]) != before


CALLER = "import {physics}\n\n\ndef law(x):\n    return {physics}.gain(x)\n"


def compiled_law(folder: Path, physics_source: str) -> tuple[float, int]:
    """Compile the caller over the physics, anew or from the cache: (its value at 2.0, hits of the cache)."""
    physics = load(folder, "cached_physics", physics_source)
    caller = load(folder, "cached_caller", CALLER.format(physics="cached_physics"))
    make_jitable([physics.gain])
    law = compile_cached(caller.law, [physics, caller])
    return float(law(2.0)), sum(law.dispatcher.stats.cache_hits.values())


def test_a_kernel_is_never_older_than_the_equations_in_it(workplace: Path) -> None:
    """Unchanged sources are served from disk; a change in another module than the decorated one is compiled anew."""
    triple = "def gain(x):\n    return 3.0 * x\n"
    assert compiled_law(workplace, triple) == (6.0, 0)
    assert compiled_law(workplace, triple) == (6.0, 1)
    assert compiled_law(workplace, triple.replace("3.0", "5.0")) == (10.0, 0)


def damages(whole: bytes) -> list[bytes]:
    """What a power cut, a worn card or an upgrade makes of a file."""
    middle = len(whole) // 2
    flipped = whole[:middle] + bytes([whole[middle] ^ 0x10]) + whole[middle + 1 :]
    foreign = pickle.dumps(numba.__version__, protocol=-1) + b"cno_such_module\nNoSuchType\n."
    return [b"", whole[:middle], bytes(len(whole)), flipped, foreign]


@pytest.mark.parametrize("kind", ["nbi", "nbc"])
def test_a_file_that_is_damaged_is_written_anew(workplace: Path, kind: str) -> None:
    """Whatever has happened to the index or the code on disk, it is compiled once more, and then served again."""
    triple = "def gain(x):\n    return 3.0 * x\n"
    compiled_law(workplace, triple)
    (file,) = workplace.rglob(f"*.{kind}")
    for damaged in damages(file.read_bytes()):
        file.write_bytes(damaged)
        assert compiled_law(workplace, triple) == (6.0, 0)
        assert compiled_law(workplace, triple) == (6.0, 1)


def test_a_damaged_kernel_is_not_ready(workplace: Path) -> None:
    """A verb has what is damaged compiled ahead, as it has what is missing: only whole code counts as compiled."""
    caller = load(workplace, "ready_caller", "def law(x):\n    return 2.0 * x\n")

    def law() -> Kernel:
        return compile_cached(caller.law, [caller], lambda: (1.0,))

    law().compile()
    assert law().is_ready()
    (file,) = workplace.rglob("*.nbc")
    for damaged in damages(file.read_bytes()):
        file.write_bytes(damaged)
        assert not law().is_ready()


def test_a_disk_without_room_costs_the_cache_and_not_the_run(workplace: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where the compiled code cannot be written, it runs from memory: no exception, the right number."""

    def no_room(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("numba.core.caching.IndexDataCacheFile.save", no_room)
    assert compiled_law(workplace, "def gain(x):\n    return 7.0 * x\n") == (14.0, 0)


def test_what_is_loaded_brings_nothing_that_only_a_compiler_needs() -> None:
    """All that a diagnosis takes from the cache comes without numba's linear algebra: a quarter of a second."""
    code = (
        "import sys; from rw_ekf.compile_ahead import DIAGNOSIS, compile_all; compile_all(DIAGNOSIS);"
        "print(sorted({'numba.np.linalg', 'numba.np.npyimpl', 'scipy.linalg'} & set(sys.modules)))"
    )
    for _ in range(2):  # the first may have to compile
        told = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert told.strip() == "[]"
