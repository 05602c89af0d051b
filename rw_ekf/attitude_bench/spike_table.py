"""Every compensation under a drag spike at a steady speed: the table beside that of the reversal."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

from rw_ekf.attitude_bench.contest import Models, finished
from rw_ekf.attitude_bench.contest_tables import Table, shown
from rw_ekf.attitude_bench.scenario import Scenario
from rw_ekf.attitude_bench.spike_answer import (
    RECOVERED_DEG,
    Spike,
    SpikeAnswer,
    answer_to_spike,
    rate_error_threshold_rpm,
)
from rw_ekf.control.compensation.schemes import SCHEMES
from rw_ekf.wheel.model_file import WheelModel

Place = tuple[str, float]  # a scheme and a noise [rpm]


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
