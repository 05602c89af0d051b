"""A model's wheel as an FMU: C printed from the propagation, compiled where there is a compiler, described, zipped."""

from __future__ import annotations

import hashlib
import html
import os
import platform
import re
import shutil
import subprocess
import tempfile
import zipfile
from pathlib import Path
from typing import Any

from rw_ekf import __version__
from rw_ekf.c_code.c_types import NotPrintableError
from rw_ekf.errors import BadInputError
from rw_ekf.flight import fmu_description as at
from rw_ekf.flight.fmu_description import Version, build_description, description, variables_of
from rw_ekf.flight.plant import plant_of
from rw_ekf.flight.plant_files import PrintedPlant, plant_header, plant_source, printed_plant
from rw_ekf.flight.plant_model import PlantModel
from rw_ekf.logs.atomic import atomic_path
from rw_ekf.model.effect import REFERENCE_DEGC
from rw_ekf.model.law import MOST_COLUMNS

FMU_SCHEMA = "rw_ekf.export_fmu/1"
_GLUE = Path(__file__).parent / "fmu"
_WHEEL = ("wheel.c", "instance.c")
_HEADERS = ("wheel.h", "instance.h", "model.h")
# (system, machine): folder of FMI 2.0 (None: it has no name for it), of FMI 3.0, how a library's name ends
_PLATFORMS: dict[tuple[str, str], tuple[str | None, str, str]] = {
    ("Linux", "x86_64"): ("linux64", "x86_64-linux", ".so"),
    ("Linux", "aarch64"): (None, "aarch64-linux", ".so"),
    ("Darwin", "x86_64"): ("darwin64", "x86_64-darwin", ".dylib"),
    ("Darwin", "arm64"): (None, "aarch64-darwin", ".dylib"),
}
_COMPILED = ["-std=c99", "-O2", "-ffp-contract=off", "-fPIC", "-shared", "-fvisibility=hidden"]
_LONGEST_S = 120.0  # of a compilation, which takes a second or two
_ZIP_TIME = (1980, 1, 1, 0, 0, 0)  # the first that a zip knows: the same model gives the same bytes


def export_fmu(model: PlantModel, path: Path, version: Version) -> dict[str, Any]:
    """Write the FMU; what was written, as `export-model --json` has it.

    Raises BadInputError for a model that cannot be exported, a compiler that fails, or a file that cannot be written.
    """
    identifier = _identifier(path)
    files = sources_of(model, identifier, version)
    folder, library = _library_place(identifier, version)
    binary, without = None, None
    compiler = compiler_of_system()
    if compiler is None:
        without = "there is no C compiler (`cc`, or what CC names)"
    elif folder is None:
        without = f"FMI {version}.0 has no name for this machine ({platform.system()} {platform.machine()})"
    else:
        binary = compiled(files, compiler, version)
    with atomic_path(path) as temporary:
        _zip(temporary, files, None if binary is None else (f"binaries/{folder}/{library}", binary))
    return {
        "schema": FMU_SCHEMA,
        "model": model.name,
        "out": str(path),
        "fmi": f"{version}.0",
        "binary": None if binary is None else f"binaries/{folder}/{library}",
        "without_binary": without,
        "inputs": [v.name for v in variables_of(model) if v.causality == "input"],
        "outputs": [v.name for v in variables_of(model) if v.causality == "output"],
        "parameters": [v.name for v in variables_of(model) if v.is_fixed],
        "longest_step_s": model.period_s,
        "remarks": list(model.remarks),
    }


def sources_of(model: PlantModel, identifier: str, version: Version) -> dict[str, str]:
    """All files of the FMU but the library, by their paths in it. Raises BadInputError for what has no C."""
    wheel = PrintedPlant(plant_of(model.x, model.table), model.table, model.stribeck)
    try:
        program = printed_plant(wheel)
    except NotPrintableError as error:
        raise BadInputError(f"{model.name}: cannot be exported as C: {error}") from None
    origin = f"Printed by rw_ekf {__version__} from the model {model.name}"
    glue = f"fmi{version}"
    texts = {
        "wheel.h": plant_header(program, wheel, origin),
        "wheel.c": plant_source(program, wheel, origin),
        **{
            name: (_GLUE / name).read_text(encoding="utf-8")
            for name in ("instance.h", "instance.c", f"{glue}_types.h", f"{glue}.c")
        },
    }
    compiled_files = (*_WHEEL, f"{glue}.c")
    numbers = _numbers(model)
    token = _token(identifier, numbers, *texts.values())
    texts["model.h"] = _model_header(origin, numbers, token)
    found = {f"sources/{name}": text for name, text in texts.items()}
    if version == 3:
        found["sources/buildDescription.xml"] = build_description(identifier, compiled_files)
    found["documentation/index.html"] = _page(model, origin)
    return {"modelDescription.xml": description(model, identifier, token, version, compiled_files), **found}


def compiler_of_system() -> list[str] | None:
    """The command that CC names, else `cc`; None where there is none."""
    named = (os.environ.get("CC") or "cc").split()  # as make has it: "ccache gcc"
    return named if named and shutil.which(named[0]) is not None else None


def compiled(files: dict[str, str], compiler: list[str], version: Version) -> bytes:
    """The library. Raises BadInputError with what the compiler says."""
    named = " ".join(compiler)
    command = [*compiler, *_COMPILED, *_WHEEL, f"fmi{version}.c", "-o", "wheel.shared", "-lm"]
    try:
        with tempfile.TemporaryDirectory() as place:
            for name, text in files.items():
                if name.startswith("sources/"):
                    (Path(place) / Path(name).name).write_text(text, encoding="utf-8")
            done = subprocess.run(
                command, cwd=place, capture_output=True, text=True, errors="replace", check=False, timeout=_LONGEST_S
            )
            library = Path(place) / "wheel.shared"
            if done.returncode == 0 and library.exists():
                return library.read_bytes()
    except (OSError, subprocess.TimeoutExpired) as error:
        raise BadInputError(f"the compiler {named} did not do its work: {error}: name another with CC") from None
    said = next((line for line in done.stderr.splitlines() if "error" in line), done.stderr.strip()[:200])
    raise BadInputError(f"the compiler {named} failed: {said or 'it says nothing'}: name another with CC")


def _identifier(path: Path) -> str:
    """A name that C takes, from that of the file."""
    name = re.sub(r"\W", "_", path.stem, flags=re.ASCII) or "wheel"
    return name if not name[0].isdigit() else f"wheel_{name}"


def _library_place(identifier: str, version: Version) -> tuple[str | None, str]:
    of_2, of_3, ends = _PLATFORMS.get((platform.system(), platform.machine()), (None, None, ""))
    return (of_2 if version == 2 else of_3), f"{identifier}{ends}"


def _token(*texts: str) -> str:
    """The same for the same model: a GUID by the text of all that is compiled."""
    digits = hashlib.sha256("\0".join(texts).encode()).hexdigest()
    return f"{{{digits[:8]}-{digits[8:12]}-{digits[12:16]}-{digits[16:20]}-{digits[20:32]}}}"


def _numbers(model: PlantModel) -> str:
    """model.h without its token."""
    starts = [column.start for column in model.columns]
    starts += [0.0] * (MOST_COLUMNS - len(starts))
    names = ("time", "current", "temperature", "column", "speed", "angle", "friction", "torque", "inertia", "state")
    references = "\n".join(f"#define RW_{name.upper()} {getattr(at, name.upper())}u" for name in names)
    return f"""{references}

#define RW_PARAMETERS {len(model.state_names)}u
#define RW_LONGEST_STEP_S {model.period_s!r}
#define RW_TEMPERATURE_START {REFERENCE_DEGC!r}
#define RW_COLUMN_STARTS {{{", ".join(map(repr, starts))}}}
#define RW_INERTIA_KG_M2 {model.inertia_kg_m2 or 0.0!r}
"""


def _model_header(origin: str, numbers: str, token: str) -> str:
    return f"""/* {origin} */
#ifndef RW_MODEL_H
#define RW_MODEL_H

#define RW_TOKEN "{token}"

{numbers}
#endif
"""


def _page(model: PlantModel, origin: str) -> str:
    """documentation/index.html."""
    said = "\n".join(f"<li>{html.escape(remark)}</li>" for remark in model.remarks)
    rows = "\n".join(
        f"<tr><td>{html.escape(v.name)}</td><td>{v.causality}</td><td>{html.escape(v.unit)}</td>"
        f"<td>{html.escape(v.words)}</td></tr>"
        for v in variables_of(model)
    )
    return f"""<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8"><title>Reaction wheel</title></head><body>
<h1>Reaction wheel</h1>
<p>{html.escape(origin)}. Steps are cut into parts of {model.period_s:g} s at most, the current is constant within
one. Before the start there was no current.</p>
<table>
{rows}
</table>
<ul>
{said}
</ul>
</body></html>
"""


def _zip(path: Path, files: dict[str, str], library: tuple[str, bytes] | None) -> None:
    content = {name: text.encode() for name, text in files.items()} | dict([] if library is None else [library])
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in content.items():
            entry = zipfile.ZipInfo(name, _ZIP_TIME)
            entry.compress_type = zipfile.ZIP_DEFLATED
            entry.external_attr = (0o755 if name.startswith("binaries/") else 0o644) << 16
            archive.writestr(entry, data)
