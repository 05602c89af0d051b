"""A contest held: one value with its document, its tables and its page, for the command and for a program."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rw_ekf.attitude_bench import robustness, spike_answer
from rw_ekf.attitude_bench.bench_page import headline_of, write_page
from rw_ekf.attitude_bench.contest import Contest, entries_of, hold_contest, models_of
from rw_ekf.attitude_bench.contest_result import LEGEND, Row, Table, document_of, rows_of, tables_of, texts
from rw_ekf.attitude_bench.robustness import Bearing
from rw_ekf.attitude_bench.scenario import Scenario
from rw_ekf.attitude_bench.spike_answer import SpikeAnswer
from rw_ekf.checking.choices import MOST_SEEDS, whole_number
from rw_ekf.checking.paths import path_of
from rw_ekf.errors import BadInputError
from rw_ekf.logs.tables import table_of
from rw_ekf.result_display import Shown

if TYPE_CHECKING:
    import pyarrow as pa
    from matplotlib.figure import Figure

    from rw_ekf.wheel.model_file import WheelModel


@dataclass(eq=False, frozen=True, repr=False)
class Bench(Shown):
    """Friction compensations on one attitude bench, side by side."""

    contest: Contest
    rows: tuple[Row, ...]  # one a scheme and noise
    bearings: tuple[Bearing, ...] | None = None  # None: robustness was not requested
    answers: Mapping[spike_answer.Place, SpikeAnswer] | None = None  # None: nor a spike

    def document(self) -> dict[str, Any]:
        """The document of `bench --json`."""
        document = document_of(self.contest)
        if self.bearings is not None:
            document["robustness"] = [bearing.document() for bearing in self.bearings]
        if self.answers is not None:
            document["spikes"] = spike_answer.documents_of(self.answers)
        return document

    @property
    def headline(self) -> str:
        """What a reversal costs without compensation, and with the best one."""
        return headline_of(self.rows)

    def text(self) -> str:
        """What `bench` prints."""
        tables = [*tables_of(self.rows, self.contest.scenario), *self._further()]
        return f"{texts(tables)}\n{LEGEND}\n\n{self.headline}"

    @property
    def table(self) -> pa.Table:
        """A row a scheme and noise."""
        rows = [asdict(row) for row in self.rows]
        return table_of({name: [row[name] for row in rows] for name in rows[0]})

    def plot(self) -> Figure:
        """Peak error of each scheme, as a matplotlib figure."""
        from rw_ekf.attitude_bench.bench_pictures import peaks_figure

        return peaks_figure(self.rows, self.contest.scenario.cycle.speed_noise_rpm)

    def report(self, directory: str | Path) -> list[Path]:
        """Write what `bench --out` leaves; returns the files. Raises what `write_page` raises."""
        return write_page(path_of(directory, "a folder"), self.contest, self.document(), self.headline, self._further())

    def __repr__(self) -> str:
        return f"Bench({self.headline!r})"

    def _further(self) -> list[Table]:
        """Tables that stand below those of the reversal."""
        tables = [] if self.bearings is None else [robustness.table_of(self.bearings)]
        return tables if self.answers is None else [*tables, spike_answer.table_of(self.answers)]


def count_of_runs(
    schemes: Sequence[str], scenario: Scenario, seeds: int, *, with_robustness: bool, with_spikes: bool
) -> int:
    """How many runs `hold_bench` makes."""
    count = len(entries_of(schemes, scenario, seeds))
    count += robustness.runs_of(schemes, seeds) if with_robustness else 0
    return count + (len(schemes) * len(scenario.cycle.speed_noise_rpm) if with_spikes else 0)


def hold_bench(
    schemes: Sequence[str],
    scenario: Scenario,
    model: WheelModel | None = None,
    seeds: int = 1,
    *,
    with_robustness: bool = False,
    with_spikes: bool = False,
    advance: Callable[[int], object] = lambda of: None,
) -> Bench:
    """Run everything that is requested, in processes of their own; advance(of) is called as each of so many is done.

    Raises BadInputError for seeds that are no number of wheels.
    """
    try:
        seeds = whole_number(seeds, MOST_SEEDS)
    except ValueError as error:
        raise BadInputError(f"seeds: {error}") from None
    of = count_of_runs(schemes, scenario, seeds, with_robustness=with_robustness, with_spikes=with_spikes)

    def tick(_: int) -> None:
        advance(of)

    models = models_of(schemes, scenario, model)
    contest = hold_contest(schemes, scenario, seeds, models, tick)
    bearings = tuple(robustness.sweep_all(schemes, scenario, seeds, models, tick)) if with_robustness else None
    answers = spike_answer.answers_of(schemes, scenario, models, tick) if with_spikes else None
    return Bench(contest, tuple(rows_of(contest)), bearings, answers)
