"""The course of a log: what filters and free runs read of it, as one named tuple that compiled code takes whole."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from rw_ekf.arrays import BoolArray, Float64Array, Int64Array, by_identity
from rw_ekf.course.acting_temperature import acting_temperature
from rw_ekf.course.current_schedule import pieces_of_log
from rw_ekf.errors import LogError
from rw_ekf.model.law import MOST_COLUMNS
from rw_ekf.wheel.interval import Pieces

if TYPE_CHECKING:
    from rw_ekf.logs.wheel_log import WheelLog

_PERIOD_SAMPLES = 100_000
WILD = 1.0e9  # no machine turns, or is driven, by such numbers: a value beyond it is damage, and would only overflow


@by_identity
class Course(NamedTuple):
    """Samples of a log, (n,) arrays in SI, and the m pieces of constant current between them."""

    time_s: Float64Array
    speed_rad_s: Float64Array  # NaN: missing
    segment: Int64Array
    temperature_degC: Float64Array  # NaN: not known; only effects read temperature and angle
    angle_rad: Float64Array
    pieces: Pieces
    piece_start: Int64Array  # (n,) those between samples i and i + 1 are piece_start[i] <= j < piece_start[i + 1]
    first_piece: Int64Array  # (n,) earliest piece of the sample's segment
    columns: Float64Array  # (n, 3) that learned laws of a model are functions of, or (0, 3); NaN: not known

    @classmethod
    def of(
        cls,
        time_s: Float64Array,
        speed_rad_s: Float64Array,
        current_A: Float64Array,
        command_delay_s: Float64Array | None = None,
        segment: Int64Array | None = None,
        temperature_degC: Float64Array | None = None,
        angle_rad: Float64Array | None = None,
        columns: Float64Array | None = None,
    ) -> Course:
        """Build from columns (n,); delay and segment default to zero, temperature and angle to not known."""
        n = time_s.size
        delay = np.zeros(n) if command_delay_s is None else command_delay_s
        part = np.zeros(n, np.int64) if segment is None else segment
        pieces, start = pieces_of_log(time_s, current_A, delay, part)
        unknown = np.full(n, np.nan) if temperature_degC is None or angle_rad is None else np.zeros(0)
        return cls(
            time_s=time_s,
            speed_rad_s=speed_rad_s,
            segment=part,
            temperature_degC=unknown if temperature_degC is None else temperature_degC,
            angle_rad=unknown if angle_rad is None else angle_rad,
            pieces=pieces,
            piece_start=start,
            first_piece=_first_pieces(start, part),
            columns=np.zeros((0, MOST_COLUMNS)) if columns is None else columns,
        )

    @classmethod
    def of_log(cls, log: WheelLog, columns: Sequence[str] = (), temperature_lag_s: float = 0.0) -> Course:
        """Take what filters read from a log. Raises LogError for a value that no machine can have.

        columns: names of those that learned laws are functions of, three at most. temperature_lag_s: by which the
        temperature that acts, which a course has, follows the log's.
        """
        for name, values in (("speed", log.speed_rad_s), ("current", log.current_A)):
            wild = np.abs(values) > WILD
            if wild.any():
                row = int(np.argmax(wild))
                raise LogError(
                    f"{log.name}: a {name} of {values[row]:.3g} at time_s {log.time_s[row]:g} is beyond any machine "
                    f"(above {WILD:g}): mend or empty that cell"
                )
        temperature = log.channels.get("temperature_degC")
        if temperature is not None and temperature_lag_s > 0.0:
            temperature = acting_temperature(log.time_s, log.segment, temperature, temperature_lag_s)
        return cls.of(
            log.time_s,
            log.speed_rad_s,
            log.current_A,
            log.command_delay_s,
            log.segment,
            temperature,
            log.channels.get("angle_rad"),
            columns_of(log, columns),
        )

    @property
    def samples(self) -> int:
        """Their number, n."""
        return self.time_s.size

    @property
    def period_s(self) -> float:
        """Median step within segments, of the first 100,000 samples [s]; 0.1 where there is no step."""
        step_s = np.diff(self.time_s[:_PERIOD_SAMPLES])[np.diff(self.segment[:_PERIOD_SAMPLES]) == 0]
        return float(np.median(step_s)) if step_s.size else 0.1

    @property
    def duration_s(self) -> float:
        """Time covered: first to last sample of each segment, summed over segments [s]."""
        return float(np.diff(self.time_s)[np.diff(self.segment) == 0].sum())

    def window(self, first: int, last: int) -> Course:
        """Samples first <= i < last alone, with the pieces of current between them."""
        n, m = self.samples, self.pieces.duration_s.size
        begin = int(self.piece_start[first]) if first < n else m
        end = int(self.piece_start[last]) if last < n else m
        here = slice(first, last)
        return Course(
            time_s=self.time_s[here],
            speed_rad_s=self.speed_rad_s[here],
            segment=self.segment[here],
            temperature_degC=self.temperature_degC[here],
            angle_rad=self.angle_rad[here],
            pieces=Pieces(*(values[begin:end] for values in self.pieces)),
            piece_start=self.piece_start[here] - begin,
            first_piece=np.maximum(self.first_piece[here] - begin, 0),
            columns=self.columns[here],
        )

    def at(self, rows: BoolArray) -> Course:
        """Some rows (n,) alone, each segment's first and last among them, with all pieces of current between them."""
        return self._replace(
            time_s=self.time_s[rows],
            speed_rad_s=self.speed_rad_s[rows],
            segment=self.segment[rows],
            temperature_degC=self.temperature_degC[rows] if self.temperature_degC.size else self.temperature_degC,
            angle_rad=self.angle_rad[rows] if self.angle_rad.size else self.angle_rad,
            piece_start=self.piece_start[rows],
            first_piece=self.first_piece[rows],
            columns=self.columns[rows] if self.columns.size else self.columns,
        )

    def with_even_pieces(self, least_A_s: float) -> Course:
        """An interval's pieces as one of their mean current, where the charge is nowhere in it off by more [A s].

        At the interval's end no charge is lost, and a speed is off by what friction makes of so much within. With
        least_A_s 0 only pieces of one and the same current become one.
        """
        first, n = self.piece_start, self.samples
        begin_s, duration_s, current_A = (values.copy() for values in self.pieces)
        count = np.diff(first, append=duration_s.size)
        of = np.repeat(np.arange(n), count)  # the sample after which each piece comes
        here, current = duration_s[first[0] :], current_A[first[0] :]
        lowest = np.full(n, np.inf)
        np.minimum.at(lowest, of, current)
        lasts = np.bincount(of, here, n)
        even = (count > 1) & (lasts > 0.0) & (self.segment == np.append(self.segment[1:], self.segment[-1] - 1))
        mean = lowest + np.bincount(of, here * (current - lowest[of]), n) / np.where(even, lasts, np.inf)
        charge = np.cumsum(here * (current - mean[of]))
        off = np.abs(charge - np.concatenate(([0.0], charge))[first[of] - first[0]])
        worst = np.zeros(n)
        np.maximum.at(worst, of, off)
        even &= worst <= least_A_s
        kept = np.ones(duration_s.size, dtype=bool)
        kept[first[0] :] = ~even[of]
        at = first[even]
        kept[at], duration_s[at], current_A[at] = True, lasts[even], mean[even]
        place = np.concatenate(([0], np.cumsum(kept)))
        return self._replace(
            pieces=Pieces(begin_s[kept], duration_s[kept], current_A[kept]),
            piece_start=place[first],
            first_piece=place[self.first_piece],
        )

    def only(self, part: BoolArray) -> Course:
        """The same with the readings outside `part` (n,) taken for missing."""
        return self._replace(speed_rad_s=np.where(part, self.speed_rad_s, np.nan))

    @property
    def mean_current_A(self) -> Float64Array:
        """Mean current over the interval that led to each sample [A], (n,); 0 where none did."""
        duration = self.pieces.duration_s
        charge = np.concatenate(([0.0], np.cumsum(duration * self.pieces.current_A)))
        length = np.concatenate(([0.0], np.cumsum(duration)))
        edge = np.minimum(self.piece_start, duration.size)
        passed = np.diff(length[edge], prepend=0.0)
        return np.where(passed > 0.0, np.diff(charge[edge], prepend=0.0) / np.where(passed > 0.0, passed, 1.0), 0.0)


def columns_of(log: WheelLog, names: Sequence[str]) -> Float64Array:
    """Columns of a log by name as a course has them, (n, 3), NaN where one is missing; (0, 3) without names."""
    found = np.full((len(log) if names else 0, MOST_COLUMNS), np.nan)
    for slot, name in enumerate(names):
        values = log.numbers(name)
        if values is not None:
            found[:, slot] = values
    return found


def _first_pieces(piece_start: Int64Array, segment: Int64Array) -> Int64Array:
    opens = np.flatnonzero(segment[1:] != segment[:-1]) + 1
    if opens.size == 0:
        return np.zeros(segment.size, np.int64)
    edges = np.concatenate(([0], opens))
    return np.repeat(piece_start[edges], np.diff(edges, append=segment.size))
