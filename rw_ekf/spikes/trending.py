"""The spikes of each wheel over all its runs: table, trains, incidence and its trend; as a document and as text."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from rw_ekf.errors import LogError
from rw_ekf.logs.run_directory import no_run, runs_of
from rw_ekf.numbers import MISSING, number_text, plus_minus
from rw_ekf.spikes.poisson import Rate, Trend, laplace_test, poisson_rate
from rw_ekf.spikes.run_events import GENUINE_ENDS, RunEvents, Spike, read_run

SCHEMA = "rw_ekf.spikes/1"
LEVEL = 0.05  # of the tests
VERDICTS = {"rising": "more frequent", "falling": "less frequent", "no_trend": "no change to be seen"}
_PER_H = 100.0
_HOUR_S = 3600.0


@dataclass(frozen=True)
class SizeTrend:
    """Kendall's rank correlation of the spikes' sizes with time."""

    tau: float
    p_value: float


@dataclass(frozen=True)
class WheelSpikes:
    """All that one wheel's runs have shown; times of spikes count from the beginning of all that was watched."""

    wheel: str
    runs: int
    watched_s: float
    spikes: tuple[Spike, ...]
    train_of: tuple[int, ...]  # of each spike, from 1
    taken_back: int  # reported, and found to be no drag spikes
    rate_per_100_h: Rate | None  # of trains; None: nothing was watched
    trend: Trend | None  # of the trains' beginnings; None: too few
    size_trend: SizeTrend | None

    @property
    def begins_s(self) -> list[float]:
        """When each train set in."""
        return begins_of(self.spikes, self.train_of)


def spikes_of_directory(directory: Path, train_s: float) -> tuple[list[WheelSpikes], list[str]]:
    """Collect the spikes of every run in a directory, wheel by wheel; also warnings.

    train_s: spikes that set in no later than this after the one before (time watched) belong to one train. Raises
    LogError where there is no run, ConfigError for damaged metadata.
    """
    logs, others = runs_of(directory, "name one that runs were written into (`output.directory`)")
    warnings = [no_run(log) for log in others]
    if not logs:
        raise LogError(f"{directory}: is a directory that holds no run, a log with its .meta.yaml beside it")
    wheels: dict[str, list[RunEvents]] = {}
    for log in logs:
        try:
            run = read_run(log)
        except LogError as error:
            warnings.append(f"{error}: its run counts for nothing here")
            continue
        if run is None:
            warnings.append(f"{log}: no events, or its watch was off: it counts for nothing here")
        else:
            wheels.setdefault(run.wheel, []).append(run)
            warnings += run.warnings
    return [spikes_of_runs(wheel, runs, train_s) for wheel, runs in sorted(wheels.items())], warnings


def spikes_of_runs(wheel: str, runs: Sequence[RunEvents], train_s: float) -> WheelSpikes:
    """Put the runs of one wheel, oldest first, one behind the other."""
    spikes: list[Spike] = []
    watched_s = 0.0
    for run in runs:
        spikes += [replace(spike, watched_s=watched_s + spike.watched_s) for spike in run.spikes]
        watched_s += run.watched_s
    genuine = [spike for spike in spikes if spike.end is None or spike.end in GENUINE_ENDS]
    train_of: list[int] = []
    for number, spike in enumerate(genuine):
        goes_on = number > 0 and spike.watched_s - genuine[number - 1].watched_s <= train_s
        train_of.append(train_of[-1] + (not goes_on) if train_of else 1)
    begins = begins_of(genuine, train_of)
    return WheelSpikes(
        wheel=wheel,
        runs=len(runs),
        watched_s=watched_s,
        spikes=tuple(genuine),
        train_of=tuple(train_of),
        taken_back=len(spikes) - len(genuine),
        rate_per_100_h=poisson_rate(len(begins), watched_s / _HOUR_S / _PER_H) if watched_s > 0.0 else None,
        trend=laplace_test(begins, watched_s) if watched_s > 0.0 else None,
        size_trend=_size_trend(genuine),
    )


def begins_of(spikes: Sequence[Spike], train_of: Sequence[int]) -> list[float]:
    """Time watched until the first spike of each train [s]."""
    first = {train: spike.watched_s for spike, train in reversed(list(zip(spikes, train_of, strict=True)))}
    return sorted(first.values())


def _size_trend(spikes: Sequence[Spike]) -> SizeTrend | None:
    sized = [(spike.watched_s, spike.amplitude_mNm) for spike in spikes if spike.amplitude_mNm is not None]
    if len(sized) < 4 or len({size for _, size in sized}) < 2:
        return None
    from scipy.stats import kendalltau

    found = kendalltau(*zip(*sized, strict=True))
    return SizeTrend(float(found.statistic), float(found.pvalue))


def spikes_document(
    directory: str, found: Sequence[WheelSpikes], train_s: float, warnings: list[str]
) -> dict[str, Any]:
    """Return the document of `spikes --json` (docs/contract.md#documents)."""
    return {
        "schema": SCHEMA,
        "directory": directory,
        "train_s": train_s,
        "wheels": [_wheel_document(wheel) for wheel in found],
        "warnings": warnings,
    }


def _wheel_document(found: WheelSpikes) -> dict[str, Any]:
    rate, trend, sizes = found.rate_per_100_h, found.trend, found.size_trend
    return {
        "wheel": found.wheel,
        "runs": found.runs,
        "watched_h": found.watched_s / _HOUR_S,
        "spikes": [
            {
                "run": spike.run,
                "utc": spike.utc,
                "since_start_s": spike.since_start_s,
                "watched_h": spike.watched_s / _HOUR_S,
                "speed_rpm": spike.speed_rpm,
                "amplitude_mNm": spike.amplitude_mNm,
                "std_mNm": spike.std_mNm,
                "percent_of_coulomb": spike.percent_of_coulomb,
                "decay_s": spike.decay_s,
                "end": spike.end,
                "train": train,
            }
            for spike, train in zip(found.spikes, found.train_of, strict=True)
        ],
        "taken_back": found.taken_back,
        "trains": found.train_of[-1] if found.train_of else 0,
        "trains_per_100_h": None if rate is None else {"value": rate.value, "low": rate.low, "high": rate.high},
        "trend": None
        if trend is None
        else {
            "laplace": trend.statistic,
            "p_value": trend.p_value,
            "early": trend.early,
            "late": trend.late,
            "verdict": verdict(trend),
        },
        "size_trend": None if sizes is None else {"kendall_tau": sizes.tau, "p_value": sizes.p_value},
    }


def verdict(trend: Trend) -> str:
    """`rising`, `falling` or `no_trend`, at the level of the test."""
    if trend.p_value >= LEVEL:
        return "no_trend"
    return "rising" if trend.statistic > 0.0 else "falling"


def spikes_text(found: WheelSpikes) -> str:
    """Return the same for a person."""
    trains = found.train_of[-1] if found.train_of else 0
    lines = [
        f"{found.wheel}: {len(found.spikes)} drag spikes in {trains} trains, {found.runs} runs, "
        f"{number_text(found.watched_s / _HOUR_S)} h watched"
        + (f"; {found.taken_back} more were taken back" if found.taken_back else "")
    ]
    if found.spikes:
        heads = f"{'speed rpm':>11}{'size mNm':>18}{'% of c':>9}{'decay s':>9}  end"
        lines.append(f"  {'onset':<20}{'s of its run':>14}{'train':>6}{heads}")
    for spike, train in zip(found.spikes, found.train_of, strict=True):
        since_start = MISSING if spike.since_start_s is None else f"{spike.since_start_s:.0f}"
        onset = f"{spike.utc:<20}{since_start:>14}"
        size = f"{_size_text(spike):>18}{number_text(spike.percent_of_coulomb):>9}"
        lines.append(
            f"  {onset}{train:>6}{number_text(spike.speed_rpm, 4):>11}{size}"
            f"{number_text(spike.decay_s):>9}  {spike.end or 'run ended'}"
        )
    rate = found.rate_per_100_h
    if rate is None:
        return "\n".join([*lines, "  nothing was watched: no rate can be given"])
    lines.append(
        f"  incidence: {number_text(rate.value)} trains per 100 h "
        f"(95 %: {number_text(rate.low)} to {number_text(rate.high)})"
    )
    return "\n".join([*lines, *_trend_lines(found)])


def _size_text(spike: Spike) -> str:
    if spike.amplitude_mNm is None:
        return MISSING
    if spike.std_mNm is None:
        return f"{number_text(spike.amplitude_mNm)} at least"
    return plus_minus(spike.amplitude_mNm, spike.std_mNm)


def _trend_lines(found: WheelSpikes) -> list[str]:
    lines = []
    if found.trend is None:
        lines.append("  trend: fewer than three trains, none can be told")
    else:
        trend = found.trend
        lines.append(
            f"  trend: {VERDICTS[verdict(trend)]} (Laplace {trend.statistic:+.2f}, p = {trend.p_value:.2g}; "
            f"{trend.early} in the first half of the time watched, {trend.late} in the second)"
        )
    if found.size_trend is not None:
        sizes = found.size_trend
        stated = "no change to be seen" if sizes.p_value >= LEVEL else "growing" if sizes.tau > 0.0 else "shrinking"
        lines.append(f"  sizes: {stated} (Kendall {sizes.tau:+.2f}, p = {sizes.p_value:.2g})")
    return lines
