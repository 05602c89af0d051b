"""A model as a folder of C99: the estimator, its self-test, a Makefile, a README."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from rw_ekf.c_code.c_types import NotPrintableError
from rw_ekf.errors import BadInputError
from rw_ekf.flight.c_files import header, printed, source
from rw_ekf.flight.c_readme import MAKEFILE, memory_of, readme
from rw_ekf.flight.exportable import estimator_of, reads
from rw_ekf.flight.recorded import SAMPLES, recorded
from rw_ekf.flight.self_test import self_test
from rw_ekf.logs.atomic import make_folder, write_text
from rw_ekf.starting_point import FilterSetup
from rw_ekf.version import __version__

EXPORT_SCHEMA = "rw_ekf.export_model/1"
FILES = ("rw_ekf.h", "rw_ekf.c", "test_rw_ekf.c", "Makefile", "README.md")


def export_c(setup: FilterSetup, name: str, folder: Path, period_s: float, *, single: bool) -> dict[str, Any]:
    """Write the files; what was written, as `export-model --json` has it.

    name: of the model. Raises BadInputError for a model that cannot be exported, or a folder that cannot be written.
    """
    estimator = estimator_of(setup, name, single=single)
    try:
        program = printed(estimator, single=single)
    except NotPrintableError as error:
        raise BadInputError(f"{name}: cannot be exported as C: {error}") from None
    origin = f"Printed by rw_ekf {__version__} from the model {name}"
    run = recorded(setup, period_s)
    make_folder(folder, "give another folder with --c")
    _check_replaced(folder)
    texts = (
        header(program, estimator, origin),
        source(program, estimator, origin),
        self_test(run, origin, single=single),
        MAKEFILE,
        readme(program, estimator, origin, SAMPLES, _conditions(setup)),
    )
    for file, text in zip(FILES, texts, strict=True):
        write_text(folder / file, text)
    return {
        "schema": EXPORT_SCHEMA,
        "model": name,
        "folder": str(folder),
        "files": list(FILES),
        "states": list(estimator.names),
        "precision": "float" if single else "double",
        **memory_of(program, estimator),
    }


def _check_replaced(folder: Path) -> None:
    """Raises BadInputError where a file would be replaced that no export wrote: a Makefile of one's own."""
    there = [file for file in FILES if (folder / file).exists()]
    if there and not (folder / FILES[0]).exists():
        raise BadInputError(f"{folder}: has a {there[0]} that is of no export: give another folder with --c")


def _conditions(setup: FilterSetup) -> tuple[str, ...]:
    """What effects read of a wheel beside its speed."""
    reported, found = {"temperature": "temperature", "angle": "angle"}, list[str]()
    if setup.temperature_lag_s > 0.0:
        late = f"as it is read: what friction is in begins with it, and follows by {setup.temperature_lag_s:.4g} s"
        reported["temperature"] = f"temperature ({late})"
    for term in setup.effects.state_terms:
        found += [words for quantity, words in reported.items() if reads(term, quantity)]
        if term.law is not None and term.law.column:
            found.append(f"{term.law.column} (`columns.v[{term.law.slot}]`)")
    return tuple(dict.fromkeys(found))
