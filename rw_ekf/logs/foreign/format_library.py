"""What all foreign formats share: a library that may not be installed, and what a damaged file makes of it."""

from __future__ import annotations

import gc
import importlib
import logging
import sys
import traceback
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

from rw_ekf.errors import LogError
from rw_ekf.logs.column_map import ColumnMap
from rw_ekf.logs.log_format import LogFormat
from rw_ekf.logs.raw_table import RawTable

_MOST_OF_A_REASON = 160  # characters


class Library(NamedTuple):
    """What reads a format: the modules that are imported, and the extra that installs them."""

    extra: str
    modules: tuple[str, ...]


NONE_NEEDED = Library("", ())


def foreign_format(
    kind: str,
    recognises: Callable[[bytes, str], bool],
    by: str,
    read: Callable[[Path, str, ColumnMap], RawTable],
    library: Library = NONE_NEEDED,
    otherwise: str = "",
) -> LogFormat:
    """A format whose reader raises nothing but LogError, whatever its library or the file is.

    kind: "a TDMS file", for messages.  otherwise: what else helps who cannot install the library.
    """

    def guarded(path: Path, name: str, columns: ColumnMap) -> RawTable:
        for module in library.modules:
            require(module, library.extra, name, kind, otherwise)
        with only_log_errors(name, kind, otherwise):
            return read(path, name, columns)

    return LogFormat(recognises, guarded, by, library.extra, library.modules)


def require(module: str, extra: str, name: str, kind: str, otherwise: str = "") -> None:
    """Import a module. Raises LogError with what to install where that cannot be done."""
    try:
        importlib.import_module(module)
    except ImportError as error:
        other = f", or {otherwise}" if otherwise else ""
        raise LogError(
            f'{name}: is {kind}, and what reads it is not installed ({error}): pip install "rw-ekf[{extra}]"{other}'
        ) from None


@contextmanager
def only_log_errors(name: str, kind: str, otherwise: str = "") -> Iterator[None]:
    """Make a LogError of whatever else is raised; what a library warns about or logs on its way is not the user's."""
    disabled = logging.root.manager.disable
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            logging.disable(logging.CRITICAL)
            yield
    except (LogError, KeyboardInterrupt, SystemExit, GeneratorExit):
        raise
    except BaseException as error:  # noqa: BLE001 - whatever a damaged file leads to; a panic of Rust is no Exception
        reason = (str(error).strip().splitlines() or [""])[0][:_MOST_OF_A_REASON] or type(error).__name__
        advice = f"write it again, or {otherwise}" if otherwise else "write it again"
        what = "that is damaged, incomplete or of an unknown kind"
        _drop_remains(error)
        raise LogError(f"{name}: is {kind} {what} ({reason}): {advice}") from None
    finally:
        logging.disable(disabled)


def _drop_remains(error: BaseException) -> None:
    """Free what a library had half built, now: some complain on standard error when that is deleted."""
    hook = sys.unraisablehook
    sys.unraisablehook = lambda unraisable: None
    try:
        link: BaseException | None = error
        while link is not None:
            traceback.clear_frames(link.__traceback__)
            link = link.__context__
        gc.collect()
    finally:
        sys.unraisablehook = hook
