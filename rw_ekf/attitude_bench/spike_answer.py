"""What a drag spike at a steady speed does to the attitude, and to the monitor of the wheel's rate, [L17] IV, IV.1."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from rw_ekf.attitude_bench.bench_run import BenchRun
from rw_ekf.attitude_bench.bench_start import run_scheme
from rw_ekf.attitude_bench.bench_wheels import drawn_wheel
from rw_ekf.attitude_bench.contest import Models, finished
from rw_ekf.attitude_bench.contest_result import Table, shown
from rw_ekf.attitude_bench.metrics import recovered_s
from rw_ekf.attitude_bench.scenario import Scenario
from rw_ekf.control.compensation.schemes import SCHEMES, SchemeEntry
from rw_ekf.units import rad_s_from_rpm
from rw_ekf.wheel.model_file import WheelModel

RECOVERED_DEG = 0.01
CASSINI_THRESHOLD_RPM = 84.0 / 0.42  # of the rate error, [L17] IV.1
CASSINI_TOP_RPM = 2000.0  # "peak rate", ibid.
TOP_RPM = 4200.0  # of the wheel of [CK13] and [F12]
Place = tuple[str, float]  # a scheme and a noise [rpm]


@dataclass(frozen=True)
class Spike:
    """Drag that jumps up at once and decays exponentially; by default as large as Coulomb friction, over in 7 min."""

    of_coulomb: float = 1.0  # its height
    decay_s: float = 100.0
    speed_rpm: float = 271.0  # of the wheel, as in [L17] Fig. 6
    onset_s: float = 30.0
    watched_s: float = 300.0  # from the onset on


class SpikeAnswer(NamedTuple):
    """A run with the spike less the same run without it."""

    peak_deg: float  # of the attitude
    recover_s: float  # from the onset until it stays within 0.01 deg; NaN: not while it was watched
    rate_error_rpm: float  # the largest: speed that was requested and not reached
    of_threshold: float  # that, as a share of the monitor's threshold


def rate_error_threshold_rpm(top_rpm: float = TOP_RPM) -> float:
    """Threshold of "excessive rate control error": a tenth of the wheel's top speed, as Cassini's 200 of 2000 rpm.

    84 rpm were 42 % of it [L17] IV.1. Scaled by speed, and not by drag, for it is the wheel's store of momentum that an
    error takes a share of; a drag as large as Coulomb friction takes 75 s to reach it on the bench, uncompensated.
    """
    return CASSINI_THRESHOLD_RPM / CASSINI_TOP_RPM * top_rpm


def steady_scenario(scenario: Scenario, spike: Spike) -> Scenario:
    """The scenario without disturbance: the wheel keeps the speed at which the spike comes, and never reverses."""
    still = scenario.changed("body", disturbance_Nm=0.0).changed("wheel", start_rpm=spike.speed_rpm)
    return still.changed("cycle", duration_s=spike.onset_s + spike.watched_s)


def answer_to_spike(
    entry: SchemeEntry,
    scenario: Scenario,
    noise_rpm: float,
    seed: int,
    spike: Spike | None = None,
    model: WheelModel | None = None,
) -> SpikeAnswer:
    """What a scheme makes of a spike on the wheel of a seed, that is not announced and that no record was learned with.

    model: for schemes that know a diagnosed one. Both runs see the same noise: their difference is the spike's.
    """
    spike = Spike() if spike is None else spike
    steady = steady_scenario(scenario, spike)
    spiked = steady.changed("wheel", effects=(*steady.wheel.effects, _effect(steady, spike)))
    with_spike, without = (
        run_scheme(entry, steady, noise_rpm, seed, model, plant=drawn_wheel(wheel, seed)) for wheel in (spiked, steady)
    )
    return _answer(with_spike, without, spike)


def _effect(scenario: Scenario, spike: Spike) -> str:
    """As the catalogue has it; the plant's time begins with the settling."""
    return (
        f"drag_spike:amplitude_rad_s2={spike.of_coulomb * scenario.wheel.coulomb!r},"
        f"onset_s={scenario.control.settling_s + spike.onset_s!r},decay_s={spike.decay_s!r}"
    )


def _answer(with_spike: BenchRun, without: BenchRun, spike: Spike) -> SpikeAnswer:
    """From two runs that differ in the spike alone."""
    n = min(with_spike.time_s.size, without.time_s.size)
    time_s = with_spike.time_s[:n]
    after = time_s >= spike.onset_s
    attitude_deg = np.abs(np.degrees(with_spike.attitude_rad[:n] - without.attitude_rad[:n]))[after]
    recover_s = recovered_s(time_s[after], attitude_deg, RECOVERED_DEG, spike.onset_s)
    wanted = (with_spike.request_rad_s2[:n] - without.request_rad_s2[:n])[:-1] * np.diff(time_s)
    reached = with_spike.wheel_rad_s[:n] - without.wheel_rad_s[:n]
    error_rpm = float(np.abs(np.concatenate([[0.0], np.cumsum(wanted)]) - reached).max()) / rad_s_from_rpm(1.0)
    return SpikeAnswer(float(attitude_deg.max()), recover_s, error_rpm, error_rpm / rate_error_threshold_rpm())


def answers_of(
    schemes: Sequence[str], scenario: Scenario, models: Models, tick: Callable[[int], object] = lambda n: None
) -> dict[Place, SpikeAnswer]:
    """What each scheme makes of the spike at each noise, on the first seed's wheel."""
    places = [(name, noise_rpm) for noise_rpm in scenario.cycle.speed_noise_rpm for name in schemes]
    jobs = {(name, noise): partial(_answered, name, scenario, noise, models.get(noise)) for name, noise in places}
    found: dict[Place, SpikeAnswer] = {}
    for place, answer in finished(jobs):
        found[place] = answer
        tick(1)
    return {place: found[place] for place in places}


def _answered(name: str, scenario: Scenario, noise_rpm: float, model: WheelModel | None) -> SpikeAnswer:
    """By the scheme's name: an entry of the registry does not go from process to process."""
    return answer_to_spike(SCHEMES[name], scenario, noise_rpm, 1, None, model)


def documents_of(answers: Mapping[Place, SpikeAnswer]) -> list[dict[str, Any]]:
    """As `bench --spikes --json` has them."""
    return [
        {"scheme": name, "noise_rpm": noise_rpm, **answer._asdict()} for (name, noise_rpm), answer in answers.items()
    ]


def table_of(answers: Mapping[Place, SpikeAnswer]) -> Table:
    """The same for people."""
    spike = Spike()
    size = f"{spike.of_coulomb:g} x Coulomb friction at {spike.speed_rpm:g} rpm, decay {spike.decay_s:g} s"
    return Table(
        title=f"Drag spike of {size}",
        heads=("scheme", "noise", "peak", "recover", "rate error", "of threshold", ""),
        units=("", "rpm", "deg", "s", "rpm", "", ""),
        rows=tuple(
            (
                name,
                f"{noise_rpm:g}",
                shown(answer.peak_deg, 4),
                shown(answer.recover_s, 1),
                shown(answer.rate_error_rpm, 1),
                shown(answer.of_threshold, 3),
                "trips" if answer.of_threshold >= 1.0 else "",
            )
            for (name, noise_rpm), answer in answers.items()
        ),
        words=1,
        notes=(
            f"recover: until the attitude stays within {RECOVERED_DEG:g} deg of where it would be; threshold of the "
            f"rate error {rate_error_threshold_rpm():g} rpm",
        ),
    )
