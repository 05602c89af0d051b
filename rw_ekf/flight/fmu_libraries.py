"""Libraries of an FMU: for the machine that writes it by its compiler, for others by Zig's, which compiles for any."""

from __future__ import annotations

import importlib.util
import platform
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from rw_ekf.c_code.c_library import CompilerError, compiler
from rw_ekf.errors import BadInputError
from rw_ekf.flight.fmu_description import Version

_FLAGS = ("-std=c99", "-O2", "-ffp-contract=off", "-fPIC", "-shared", "-fvisibility=hidden")
_LONGEST_S = 900.0  # of a compilation: a second or two, but Zig first makes a platform's C library, once, in minutes
ALL = "all"


@dataclass(frozen=True)
class Platform:
    """What a library is for."""

    name: str  # its folder in FMI 3.0
    of_fmi_2: str | None  # None: FMI 2.0 has no name for it
    ends: str  # of a library's name
    target: str  # as Zig has it; of Linux with the oldest C library that the wheel needs nothing beyond
    machine: tuple[str, str]  # as Python has it

    def folder(self, version: Version) -> str | None:
        """Its folder in `binaries`."""
        return self.of_fmi_2 if version == 2 else self.name


PLATFORMS = (
    Platform("x86_64-linux", "linux64", ".so", "x86_64-linux-gnu.2.17", ("Linux", "x86_64")),
    Platform("aarch64-linux", None, ".so", "aarch64-linux-gnu.2.17", ("Linux", "aarch64")),
    Platform("x86_64-windows", "win64", ".dll", "x86_64-windows-gnu", ("Windows", "AMD64")),
    Platform("x86_64-darwin", "darwin64", ".dylib", "x86_64-macos", ("Darwin", "x86_64")),
    Platform("aarch64-darwin", None, ".dylib", "aarch64-macos", ("Darwin", "arm64")),
)


def platforms_of(names: str, version: Version) -> tuple[Platform, ...]:
    """Of a list with commas, or "all" that this version has a name for. Raises BadInputError."""
    known = {of.name: of for of in PLATFORMS}
    known |= {of.of_fmi_2: of for of in PLATFORMS if of.of_fmi_2 is not None}
    if names == ALL:
        return tuple(of for of in PLATFORMS if of.folder(version) is not None)
    wanted = dict.fromkeys(name.strip() for name in names.split(","))
    for name in wanted:
        if name not in known:
            raise BadInputError(f"--platforms {names}: give {ALL}, or some of {', '.join(known)}, with commas between")
        if known[name].folder(version) is None:
            raise BadInputError(f"--platforms {names}: FMI {version}.0 has no name for {name}: give --fmi 3")
    return tuple(dict.fromkeys(known[name] for name in wanted))


def libraries(
    sources: Mapping[str, str], units: Sequence[str], identifier: str, version: Version,
    wanted: Sequence[Platform] | None,
) -> tuple[dict[str, bytes], str | None]:  # fmt: skip
    """Each library by its path in the FMU; and why there is none, where no target was given.

    sources: texts by their file's name; units: those that are compiled; wanted: None: for this machine, where it has a
    compiler. Raises BadInputError for a compiler that is missing or fails.
    """
    here = next((of for of in PLATFORMS if of.machine == (platform.system(), platform.machine())), None)
    if wanted is None:
        if here is None or here.folder(version) is None:
            machine = f"{platform.system()} {platform.machine()}"
            return {}, f"FMI {version}.0 has no name for this machine ({machine})"
        try:
            command = compiler()
        except CompilerError as error:
            return {}, str(error)
        return {_place(here, identifier, version): compiled(sources, units, command)}, None
    found = {}
    for of in wanted:
        found[_place(of, identifier, version)] = compiled(sources, units, _command_for(of, here))
    return found, None


def compiled(sources: Mapping[str, str], units: Sequence[str], command: Sequence[str]) -> bytes:
    """The library that a compiler makes. Raises BadInputError with what it says."""
    named = " ".join(command)
    try:
        with tempfile.TemporaryDirectory() as place:
            for name, text in sources.items():
                (Path(place) / name).write_text(text, encoding="utf-8")
            done = subprocess.run(
                [*command, *_FLAGS, *units, "-o", "wheel.shared", "-lm"],
                cwd=place, capture_output=True, text=True, errors="replace", check=False, timeout=_LONGEST_S,
            )  # fmt: skip
            library = Path(place) / "wheel.shared"
            if done.returncode == 0 and library.exists():
                return library.read_bytes()
    except (OSError, subprocess.TimeoutExpired) as error:
        raise BadInputError(f"the compiler {named} did not do its work: {error}: name another with CC") from None
    stated = next((line for line in done.stderr.splitlines() if "error" in line), done.stderr.strip()[:200])
    raise BadInputError(f"the compiler {named} failed: {stated or 'it says nothing'}: name another with CC")


def _place(of: Platform, identifier: str, version: Version) -> str:
    return f"binaries/{of.folder(version)}/{identifier}{of.ends}"


def _command_for(of: Platform, here: Platform | None) -> list[str]:
    """Zig, and where there is none the machine's own for itself. Raises BadInputError."""
    if importlib.util.find_spec("ziglang") is not None:
        return [sys.executable, "-m", "ziglang", "cc", "-target", of.target, "-s"]
    if of is here:
        try:
            return compiler()
        except CompilerError as error:
            raise BadInputError(str(error)) from None
    raise BadInputError(
        f'--platforms: a library for {of.name} takes a compiler for it: pip install "rw-ekf[compiler]" (ziglang)'
    )
