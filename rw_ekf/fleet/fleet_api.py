"""What `rw_ekf.fleet` offers: each action of `rw-ekf fleet` as a function, with what it finds as a value."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rw_ekf.fleet.daily import read_days
from rw_ekf.fleet.diagnoses import Diagnosable, Diagnoses, diagnose_windows, read_diagnoses, windows_wanted
from rw_ekf.fleet.executors import executor_of
from rw_ekf.fleet.fleet_page import page_of
from rw_ekf.fleet.fleet_run import FleetRun, run_fleet
from rw_ekf.fleet.folder import FleetFolder, fleet_folder
from rw_ekf.fleet.index import FleetIndex, built_index, read_index, write_index
from rw_ekf.fleet.plan import FleetSettings, models_of
from rw_ekf.fleet.remaining import limits_of
from rw_ekf.fleet.simulation import FleetShape, simulate_fleet
from rw_ekf.fleet.trend_document import Trends
from rw_ekf.fleet.wheel_trends import trends_of
from rw_ekf.logs.atomic import write_text
from rw_ekf.one_thread import one_thread

if TYPE_CHECKING:
    from rw_ekf.settings.schema import Configuration

__all__ = ["Diagnoses", "FleetIndex", "FleetRun", "Trends", "build", "diagnose", "run", "simulate", "trends", "view"]

MOST_WINDOWS = 20  # of a run of `diagnose`: some two minutes on two cores, where a log has ten minutes


def simulate(
    directory: str | Path,
    *,
    wheels: int = 20,
    days: int = 30,
    seed: int = 0,
    workers: int | None = None,
    **more: float,
) -> dict[str, Any]:
    """Write the logs of a simulated fleet, one a wheel and day, with its truth in `truth.json`; gives the document.

    more: what happens in it, the further fields of `rw_ekf.fleet.simulation.FleetShape`. Raises Error.
    """  # fmt: skip
    shape = FleetShape(wheels, days, seed, **more)
    return simulate_fleet(directory, shape, workers)


def build(directory: str | Path, out: str | Path | None = None) -> FleetIndex:
    """Find the logs below a directory by wheel and day, and write the index of the fleet.

    out: the fleet's folder, else `fleet` in the directory. Raises Error.
    """
    folder = fleet_folder(directory, out)
    index = _indexed(folder, directory, keep_gone=False)
    with folder.locked():
        write_index(folder, index)
    return index


def run(
    directory: str | Path,
    out: str | Path | None = None,
    *,
    model: str | Path | None = None,
    configuration: Configuration | str | Path | None = None,
    columns: str | Path | None = None,
    workers: int | None = None,
    scheduler: str | None = None,
    tick: Callable[[int], object] = lambda n: None,
) -> FleetRun:
    """Filter every log of the fleet that has no result yet, each from what its wheel's log before it left.

    directory: of the logs, or the fleet's folder. model: a file, or a folder of `WHEEL.yaml` and `default.yaml`.
    workers: processes of this machine; scheduler: address of a Dask scheduler in their place. tick(n): n logs more are
    done. Raises Error.
    """
    folder = fleet_folder(directory, out)
    settings = settings_of(model, configuration, columns)
    index = _indexed(folder, directory, keep_gone=True)
    with folder.locked():
        write_index(folder, index)
        with executor_of(workers, scheduler) as executor:
            return run_fleet(folder, index, settings, executor, tick)


def diagnose(
    directory: str | Path,
    out: str | Path | None = None,
    *,
    most: int = MOST_WINDOWS,
    model: str | Path | None = None,
    configuration: Configuration | str | Path | None = None,
    columns: str | Path | None = None,
    workers: int | None = None,
    scheduler: str | None = None,
    tick: Callable[[int], object] = lambda n: None,
) -> Diagnoses:
    """Diagnose the days that an alarm, the residual or a trend calls for; also written as `diagnoses.json`.

    most: windows, the worst wheels' first. What else: as of `run`, whose results it needs. Raises Error.
    """
    folder = fleet_folder(directory, out)
    settings = settings_of(model, configuration, columns)
    with one_thread():
        found = trends_of(read_days(folder), {})
    wheels = Trends(str(folder.path), found, {}).worst_first
    index = _indexed(folder, directory, keep_gone=True)
    with folder.locked(), executor_of(workers, scheduler) as executor:
        logs = Diagnosable.of(folder, index, settings)
        return diagnose_windows(logs, windows_wanted(logs, wheels, most), executor, tick)


def _indexed(folder: FleetFolder, directory: str | Path, *, keep_gone: bool) -> FleetIndex:
    """The logs as they are now; directory: of the logs, or the fleet's folder, whose index says where they are."""
    known = read_index(folder)
    of_fleet = known is not None and folder.path == Path(directory)
    return built_index(
        Path(known.directory) if known is not None and of_fleet else Path(directory), known, keep_gone=keep_gone
    )


def trends(directory: str | Path, out: str | Path | None = None, *, limits: Sequence[str] = ()) -> Trends:
    """Ageing, changes, siblings and remaining time from the results; also written as `trends.json`.

    limits: as `coulomb=0.9` or `coulomb=+50%`. Raises Error.
    """
    folder = fleet_folder(directory, out)
    found = _trends(folder, limits)
    write_text(folder.trends, found.to_json())
    return found


def view(directory: str | Path, out: str | Path | None = None, *, limits: Sequence[str] = ()) -> Path:
    """The fleet on one page, `fleet.html`, that needs no other file; gives its path. limits: as of `trends`.

    Raises Error.
    """
    folder = fleet_folder(directory, out)
    write_text(folder.page, page_of(_trends(folder, limits)))
    return folder.page


def _trends(folder: FleetFolder, limits: Sequence[str]) -> Trends:
    known = limits_of(limits)
    with one_thread():
        found = trends_of(read_days(folder), known)
    return Trends(str(folder.path), found, known, read_diagnoses(folder))


def settings_of(
    model: str | Path | None, configuration: Configuration | str | Path | None, columns: str | Path | None
) -> FleetSettings:
    """What every log is read and filtered with, from files or values. Raises Error."""
    from rw_ekf.logs.column_map_file import load_column_map
    from rw_ekf.settings.load import load_configuration

    given = load_configuration(configuration) if isinstance(configuration, str | Path) else configuration
    column_map = None if columns is None else load_column_map(Path(columns))
    text = "" if columns is None else Path(columns).read_text(encoding="utf-8")
    if model is None and given is not None:
        model = given.filter.model
    return FleetSettings(given, models_of(model), column_map, text)
