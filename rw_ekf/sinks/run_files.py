"""Where one run leaves its files, and what of them it could not write."""

from __future__ import annotations

import contextlib
import hashlib
import os
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING

from rw_ekf.errors import RwEkfError
from rw_ekf.logs.atomic import make_folder
from rw_ekf.logs.checksums import sums_path
from rw_ekf.logs.metadata import metadata_path
from rw_ekf.logs.parts import FORMS, beside
from rw_ekf.logs.run_directory import model_path, start_path
from rw_ekf.plain_file import file_part

if TYPE_CHECKING:
    from rw_ekf.settings.schema import Configuration

Note = Callable[..., None]  # takes named events for the log


@dataclass(frozen=True)
class RunFiles:
    """Where one run leaves its files; all beside each other under one stem.

    Only the state file and what was learned are the same in the next run of the same wheel on the same port.
    """

    log: Path
    estimates: Path
    events: Path
    start: Path
    model: Path
    replaced: Path  # what stood in the place of `learned` and was not continued from
    learned: Path
    state: Path

    @classmethod
    def of_run(cls, configuration: Configuration, began: datetime) -> RunFiles:
        """Name the files of a run; the directory is made if it is not there. Raises BadInputError if it cannot be."""
        directory, wheel = Path(configuration.output.directory), configuration.wheel.name
        make_folder(directory, "give another output.directory")
        # A link in the path is followed once: turned to another place meanwhile, it would tear the run's files apart.
        if os.path.realpath(directory) != os.path.abspath(directory):
            directory = directory.resolve()
        stem = f"{began:%Y-%m-%dT%H-%M-%SZ}_{file_part(wheel)}"
        log = directory / f"{stem}{FORMS[0]}"
        number = 1
        while _is_taken(log):
            number += 1
            log = directory / f"{stem}_{number}{FORMS[0]}"
        return cls(
            log=log,
            estimates=beside(log, "estimates.csv"),
            events=beside(log, "events.jsonl"),
            start=start_path(log),
            model=model_path(log),
            replaced=beside(log, "replaced.yaml"),
            learned=learned_path(configuration),
            state=state_path(configuration),
        )


def _is_taken(log: Path) -> bool:
    """Whether a run has left a log of that name, in any form, or metadata."""
    named = (
        *(log.with_suffix(form) for form in FORMS),
        metadata_path(log),
        sums_path(log),
        beside(log, "events.jsonl"),
    )
    return any(os.path.lexists(path) for path in named)


def state_path(configuration: Configuration) -> Path:
    """Path of the state file of a configuration: two wheels of one name on two ports have two."""
    return Path(configuration.output.directory) / f"{lasting_stem(configuration)}.state.json"


def learned_path(configuration: Configuration) -> Path:
    """Path of what the runs of a configuration have learned."""
    return Path(configuration.output.directory) / f"{lasting_stem(configuration)}.learned.yaml"


def request_path(configuration: Configuration) -> Path:
    """Path of the socket that torques are requested by."""
    named = configuration.compensation.socket
    return Path(named or Path(configuration.output.directory) / f"{lasting_stem(configuration)}.request.sock")


def lasting_stem(configuration: Configuration) -> str:
    """What files are called that outlive a run: the wheel's name, and the port it is on."""
    port = configuration.wheel.port
    tag = f"{file_part(port.rstrip('/').rsplit('/', 1)[-1])}-{hashlib.sha256(port.encode()).hexdigest()[:6]}"
    return f"{file_part(configuration.wheel.name)}.{tag}"


@dataclass
class Unwritten:
    """What a run could not put on the disk: it continued without (the `unwritten` object of `run --json`)."""

    log_rows: int = 0
    estimate_rows: int = 0
    state_files: int = 0
    other_files: list[str] = field(default_factory=list)  # metadata or model
    failed_sinks: dict[str, int] = field(default_factory=dict)  # ticks that a sink failed at, by its name
    not_sent: dict[str, int] = field(default_factory=dict)  # ticks that nobody took from a sink, by its name
    reason: str | None = None  # of the first failure

    def __bool__(self) -> bool:
        """Whether anything that the run was to leave is missing; a state file, or what is sent, is of the moment."""
        return self.log_rows + self.estimate_rows + len(self.other_files) + len(self.failed_sinks) > 0

    def text(self) -> str:
        """What is missing from the run's files, in a sentence."""
        missing = [f"{self.log_rows} rows of the log"] if self.log_rows else []
        missing += [f"{self.estimate_rows} rows of the estimates"] if self.estimate_rows else []
        missing += [f"{ticks} ticks of sink {name}" for name, ticks in self.failed_sinks.items()]
        return f"not written: {', '.join([*missing, *self.other_files])} ({self.reason})"

    def miss(self, sink: str, ticks: int, reason: str, note: Note, *, from_file: bool = False) -> None:
        """Count ticks that a recorder could not get rid of, and say so with the first."""
        counts = self.failed_sinks if from_file else self.not_sent
        first = sink not in counts
        counts[sink] = counts.get(sink, 0) + ticks
        if first:
            if from_file:
                self.note(reason)
            note("not_recorded", sink=sink, reason=reason, do="the run goes on, and counts what is missing")

    def note(self, reason: str) -> bool:
        """Keep the first reason; True if this is the first."""
        first = self.reason is None
        self.reason = self.reason or reason
        return first

    @contextlib.contextmanager
    def tried(self, path: Path, note: Note) -> Iterator[None]:
        """A file whose loss must not end a run that drives a wheel: counted, and reported where it is the first."""
        try:
            yield
        except (RwEkfError, OSError) as error:
            if path.name not in self.other_files:
                self.other_files.append(path.name)
            if self.note(str(error)):
                note("not_written", file=str(path), reason=str(error))
