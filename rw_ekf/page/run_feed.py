"""What a run has left and is leaving: its rows, its state, its events and the friction that was learned."""

from __future__ import annotations

import json
from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from rw_ekf.clock import SystemClock
from rw_ekf.errors import BadInputError, RwEkfError
from rw_ekf.live.published_state import Published, read_published
from rw_ekf.logs.parts import PartName, beside, parts_of, stem_of
from rw_ekf.page.growing_table import Columns, GrowingTable, read_thinned

POINTS = 3000  # of a history, in each column
_OF_LOG = ("time_s", "speed_rad_s", "current_command_A", "current_A", "temperature_degC")
_HIDDEN = ("reason", "outcome")
_MOST_EVENTS = 2000
_SPEEDS = 121  # of the friction curve
_RECENT_ROWS = 600
_RECENT_BYTES = 1 << 18
_ALL = (-np.inf, np.inf)

Believed = Mapping[str, tuple[float, float]]  # value and standard deviation, by the name in the estimates


class RunFeed:
    """One run, by the files beside each other under its stem; nothing is written, nothing kept but places in files."""

    def __init__(self, log: Path) -> None:
        """Raises BadInputError where there is no such run."""
        self.stem = stem_of(log)
        if not self._parts(estimates=True) and not self._parts(estimates=False):
            raise BadInputError(f"{log}: there is no run: give its log, runs/DATE_WHEEL.csv, or the folder of runs")

    @property
    def log(self) -> Path:
        """The first part of its log."""
        return next(iter(self._parts(estimates=False)), self.stem.with_name(f"{self.stem.name}.csv"))

    @property
    def name(self) -> str:
        """Of the run, as its files have it."""
        return self.stem.name

    def _parts(self, *, estimates: bool) -> list[Path]:
        """Parts in order, each in the first of the forms that is there."""
        first = beside(self.stem, "estimates.csv" if estimates else "csv")
        return [path for path in parts_of(first).files if path.exists()]

    def history(self, span_s: tuple[float, float] = _ALL, points: int = POINTS) -> dict[str, Any]:
        """All rows so far within a span, thinned, and the events."""
        parts = self._parts(estimates=True)
        return {
            "kind": "history",
            "run": self.name,
            "log": read_thinned(self._parts(estimates=False), _OF_LOG, points, span_s),
            "estimates": read_thinned(parts, self._columns(parts), points, span_s),
            "events": self.events(),
        }

    def _columns(self, parts: list[Path]) -> list[str]:
        for path in parts:
            if path.suffix == ".csv":
                try:
                    with path.open(encoding="utf-8", errors="replace") as text:
                        return [name for name in text.readline().strip().split(",") if name not in _HIDDEN]
                except OSError:
                    continue
        from rw_ekf.logs.column_map import ColumnMap
        from rw_ekf.logs.reader import read_table

        try:
            return [name for name in read_table(parts[0], ColumnMap()).names if name not in _HIDDEN] if parts else []
        except RwEkfError:
            return []

    def recent(self) -> Columns:
        """The last rows of estimates and log, at most 600 each; what both have is the log's, without holes."""
        found: Columns = {}
        for estimates in (True, False):
            parts = [path for path in self._parts(estimates=estimates) if path.suffix == ".csv"]
            if parts:
                table = GrowingTable(parts[-1], () if estimates else _OF_LOG, last_bytes=_RECENT_BYTES)
                found |= {name: values[-_RECENT_ROWS:] for name, values in table.rows().items()}
        return found

    def tail(self) -> RunTail:
        """Follows the rows that come from now on."""
        return RunTail(self)

    def events(self) -> list[dict[str, Any]]:
        """What the run has reported, the newest at the end."""
        try:
            lines = beside(self.stem, "events.jsonl").read_text(encoding="utf-8", errors="replace").splitlines()
        except OSError:
            return []
        found = []
        for line in lines[-_MOST_EVENTS:]:
            try:
                record = json.loads(line)
            except ValueError:  # the last line may still be growing
                continue
            if isinstance(record, dict):
                found.append(record)
        return found

    def state(self) -> dict[str, Any] | None:
        """What the run publishes of itself, and whether its process lives; None where a later run publishes there."""
        for path in sorted(self.stem.parent.glob("*.state.json")):
            published = read_published(path)
            if published is not None and stem_of(str(published.document.get("log"))).name == self.name:
                return {"kind": "state", **shown(published)}
        return None

    def models(self) -> dict[str, Path]:
        """Files of the run's model: what it began from and what it has learned."""
        learned = [path for path in self.stem.parent.glob("*.learned.yaml") if self._is_of_run(path)]
        now = [beside(self.stem, "model.yaml"), *learned]
        found = {"began": beside(self.stem, "start.yaml"), "now": next((p for p in now if p.exists()), None)}
        return {name: path for name, path in found.items() if path is not None and path.exists()}

    def model_times(self) -> dict[str, int]:
        """When each of them was written [ns]; one that is just being replaced may be missing."""
        times = {str(path): _written_ns(path) for path in self.models().values()}
        return {path: written_ns for path, written_ns in times.items() if written_ns is not None}

    def _is_of_run(self, path: Path) -> bool:
        try:
            return f"log: {self.name}." in path.read_text(encoding="utf-8", errors="replace")
        except OSError:
            return False

    def curve(self, top_rad_s: float, believed: Believed | None = None) -> dict[str, Any] | None:
        """The friction torque per unit inertia over the speed, with its sigma, as believed now and as begun.

        believed: numbers in place of those of the model that was kept last, which may be a minute old.
        """
        models = self.models()
        kept = models.get("now", models.get("began"))
        now = friction_curve(kept, top_rad_s, believed) if kept else None
        # The model that a run began with is drawn again and again.
        start = models.get("began")
        began = _kept_curve(start, top_rad_s, _written_ns(start)) if start else None
        found = {name: curve for name, curve in (("began", began), ("now", now)) if curve}
        return {"kind": "curve", **found} if found else None


def shown(published: Published) -> dict[str, Any]:
    """What a run publishes; `alive`: whether its process is, `stale`: whether that has stopped to publish anything."""
    silence = published.silence(SystemClock().utc())
    reason = f"{published.document.get('reason') or ''}{silence}"
    return {"alive": published.alive, "stale": bool(silence), **published.document, "reason": reason}


class RunTail:
    """Rows and events of a run since the last look."""

    def __init__(self, feed: RunFeed) -> None:
        self._feed = feed
        self._tables: dict[Path, GrowingTable] = {}
        self._events = self._events_bytes = 0
        self.look()

    def look(self) -> dict[str, Any]:
        """What has come; tables that grow are followed from part to part."""
        return {
            "kind": "rows",
            "log": self._new(estimates=False),
            "estimates": self._new(estimates=True),
            "events": self._new_events(),
        }

    def _new(self, *, estimates: bool) -> Columns:
        parts = [path for path in self._feed._parts(estimates=estimates) if path.suffix == ".csv"]
        rows: Columns = {}
        for path in parts[-2:]:
            if path not in self._tables:
                self._tables[path] = GrowingTable(path, () if estimates else _OF_LOG)
            while new := self._tables[path].rows():
                for name, values in new.items():
                    if name not in _HIDDEN:
                        rows.setdefault(name, []).extend(values)
        return rows

    def _new_events(self) -> list[dict[str, Any]]:
        try:
            size = beside(self._feed.stem, "events.jsonl").stat().st_size
        except OSError:
            return []
        if size == self._events_bytes:
            return []
        self._events_bytes = size
        events = self._feed.events()
        new = events[self._events :] if len(events) < _MOST_EVENTS else events[-1:]
        self._events = len(events)
        return new


def _written_ns(model: Path) -> int | None:
    """When a file was written [ns]; None of one that is just being replaced."""
    try:
        return model.stat().st_mtime_ns
    except OSError:
        return None


@lru_cache(maxsize=16)
def _kept_curve(model: Path, top_rad_s: float, written_ns: int | None) -> dict[str, Any] | None:
    """As `friction_curve`, of a file as it was written at that time."""
    return friction_curve(model, top_rad_s)


def friction_curve(model: Path, top_rad_s: float, believed: Believed | None = None) -> dict[str, Any] | None:
    """Speeds [rad/s], friction and its sigma [rad/s^2], all effects included; None where the file holds no model.

    believed: numbers and their sigmas in place of the model's, by their names in the estimates; how they go together
    (their correlations) is the model's.
    """
    from rw_ekf.filter.estimator import Estimator
    from rw_ekf.records import WheelSample
    from rw_ekf.starting_point import setup_of_model
    from rw_ekf.wheel.model_file import read_model

    try:
        setup = setup_of_model(read_model(model), 1.0, 1.0, 0.1)  # noises, that move no friction
        mean, std = setup.prior.mean.copy(), np.sqrt(np.diag(setup.prior.covariance))
        share = np.ones_like(std)
        for i, name in enumerate(setup.state_names):
            if name in (believed or {}) and std[i] > 0.0:
                mean[i], sigma = (believed or {})[name]
                share[i] = sigma / std[i]
        covariance = setup.prior.covariance * np.outer(share, share)
        estimator = Estimator(setup.constants, mean, covariance, effects=setup.effects, drift=setup.effect_drift)
        estimate = estimator.step(WheelSample(0.0, None))
    except RwEkfError:
        return None
    half = np.linspace(0.0, 1.0, _SPEEDS // 2 + 1)[1:] ** 2 * max(top_rad_s, 1.0)  # dense where it bends
    speeds = np.concatenate([-half[::-1], half])
    torques = [estimate.friction_torque_rad_s2(float(speed)) for speed in speeds]
    return {
        "speed_rad_s": speeds.tolist(),
        "friction_rad_s2": [one.value for one in torques],
        "std_rad_s2": [one.std for one in torques],
    }


def believed_of(rows: Columns) -> dict[str, tuple[float, float]]:
    """The last of each number of rows of estimates that has a sigma, but the speed."""
    found = {}
    for name in rows:
        if name != "speed_rad_s" and f"std_{name}" in rows:
            known = zip(reversed(rows[name]), reversed(rows[f"std_{name}"]), strict=False)
            last = next(((value, std) for value, std in known if value is not None and std is not None), None)
            if last is not None:
                found[name] = last
    return found


def runs_in(folder: Path) -> list[Path]:
    """The runs of a folder, the newest first, each by its first part."""
    stems: dict[str, Path] = {}
    for path in folder.glob("*.csv*"):
        part = PartName.of(path.name)
        if part is not None and not part.estimates and beside(path, "meta.yaml").exists():
            stems.setdefault(part.stem, path)
    return [stems[stem] for stem in sorted(stems, reverse=True)]
