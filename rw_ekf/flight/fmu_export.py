"""A model's wheel as an FMU: C printed from the propagation, compiled where there is a compiler, described, zipped."""

from __future__ import annotations

import hashlib
import html
import re
import zipfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from rw_ekf.c_code.c_types import NotPrintableError
from rw_ekf.errors import BadInputError
from rw_ekf.flight import fmu_description as at
from rw_ekf.flight.exported_plant import plant_of
from rw_ekf.flight.fmu_description import Version, build_description, description, variables_of
from rw_ekf.flight.fmu_libraries import Platform, libraries
from rw_ekf.flight.plant_files import plant_header, plant_source, printed_plant
from rw_ekf.flight.plant_model import PlantModel
from rw_ekf.logs.atomic import atomic_path
from rw_ekf.model.effect import REFERENCE_DEGC
from rw_ekf.model.law import MOST_COLUMNS
from rw_ekf.version import __version__

FMU_SCHEMA = "rw_ekf.export_fmu/1"
_GLUE = Path(__file__).parent / "fmu"
_WHEEL = ("wheel.c", "instance.c")
_HEADERS = ("wheel.h", "instance.h", "model.h")
_ZIP_TIME = (1980, 1, 1, 0, 0, 0)  # the first that a zip knows: the same model gives the same bytes


def export_fmu(
    model: PlantModel, path: Path, version: Version, platforms: Sequence[Platform] | None = None
) -> dict[str, Any]:
    """Write the FMU; what was written, as `export-model --json` has it.

    platforms: that it shall have libraries for; None: this machine, where it has a compiler. Raises BadInputError for a
    model that cannot be exported, a compiler that is missing or fails, or a file that cannot be written.
    """
    identifier = _identifier(path)
    files = sources_of(model, identifier, version)
    sources = {Path(name).name: text for name, text in files.items() if name.startswith("sources/")}
    made, without = libraries(sources, (*_WHEEL, f"fmi{version}.c"), identifier, version, platforms)
    with atomic_path(path) as temporary:
        _zip(temporary, files, made)
    return {
        "schema": FMU_SCHEMA,
        "model": model.name,
        "out": str(path),
        "fmi": f"{version}.0",
        "binary": next(iter(made), None),
        "binaries": list(made),
        "without_binary": without,
        "inputs": [v.name for v in variables_of(model) if v.causality == "input"],
        "outputs": [v.name for v in variables_of(model) if v.causality == "output"],
        "parameters": [v.name for v in variables_of(model) if v.is_fixed],
        "longest_step_s": model.period_s,
        "remarks": list(model.remarks),
    }


def sources_of(model: PlantModel, identifier: str, version: Version) -> dict[str, str]:
    """All files of the FMU but the library, by their paths in it. Raises BadInputError for what has no C."""
    table = model.table
    held = plant_of(model.x, table)
    try:
        program = printed_plant(held, table, model.stribeck)
    except NotPrintableError as error:
        raise BadInputError(f"{model.name}: cannot be exported as C: {error}") from None
    origin = f"Printed by rw_ekf {__version__} from the model {model.name}"
    glue = f"fmi{version}"
    texts = {
        "wheel.h": plant_header(program, held, origin),
        "wheel.c": plant_source(program, held, origin),
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


def _identifier(path: Path) -> str:
    """A name that C takes, from that of the file."""
    name = re.sub(r"\W", "_", path.stem, flags=re.ASCII) or "wheel"
    return name if not name[0].isdigit() else f"wheel_{name}"


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
    stated = "\n".join(f"<li>{html.escape(remark)}</li>" for remark in model.remarks)
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
{stated}
</ul>
</body></html>
"""


def _zip(path: Path, files: dict[str, str], libraries: dict[str, bytes]) -> None:
    content = {name: text.encode() for name, text in files.items()} | libraries
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in content.items():
            entry = zipfile.ZipInfo(name, _ZIP_TIME)
            entry.compress_type = zipfile.ZIP_DEFLATED
            entry.external_attr = (0o755 if name.startswith("binaries/") else 0o644) << 16
            archive.writestr(entry, data)
