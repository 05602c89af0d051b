"""The logs that a directory holds: one, in parts or not, with its metadata beside it is a run."""

from __future__ import annotations

from pathlib import Path

from rw_ekf.errors import LogError
from rw_ekf.logs.metadata import metadata_path, read_metadata
from rw_ekf.logs.parts import FORMS, PartName, beside

DIAGNOSED_MODEL = "augmented-model.yaml"


def runs_of(directory: Path, advice: str = "name the files themselves") -> tuple[list[Path], list[Path]]:
    """The log of each run (STEM.csv, whatever form its parts have), oldest first; then the logs that no run wrote.

    Raises LogError where there is neither, with advice, ConfigError for damaged metadata.
    """
    try:
        names = sorted(entry.name for entry in directory.iterdir() if not entry.name.startswith("."))
    except OSError as error:
        raise LogError(f"{directory}: cannot be read ({error.strerror})") from None
    parts = [part for part in map(PartName.of, names) if part is not None and not part.estimates]
    runs, others = [], []
    for stem in sorted({part.stem for part in parts}):
        log = directory / f"{stem}{FORMS[0]}"
        metadata = read_metadata(log)
        if metadata is None:
            others.append(log)
        else:
            runs.append((metadata.first_sample_utc, stem, log))
    if not runs and not others:
        raise LogError(f"{directory}: is a directory that holds no log ({', '.join(FORMS)}); {advice}")
    return [log for _, _, log in sorted(runs)], others


def no_run(log: Path) -> str:
    """Why a log is left out where runs are meant."""
    return f"{log}: has no {metadata_path(log).name} beside it: no sample came, or it is no run's log"


def start_path(log: str | Path) -> Path:
    """Path of the model that a run started from: run.csv -> run.start.yaml."""
    return beside(log, "start.yaml")


def model_path(log: str | Path) -> Path:
    """Path of the model at the end of a run: run.csv -> run.model.yaml."""
    return beside(log, "model.yaml")


def model_of(name: str | Path) -> Path:
    """Path of the model that a name stands for: a model's own file, a run's log, or the folder of a diagnosis."""
    path = Path(name)
    if path.is_dir():
        return path / DIAGNOSED_MODEL
    return model_path(path) if path.name.endswith(FORMS) else path
