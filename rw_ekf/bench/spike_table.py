"""Every compensation under a drag spike at a steady speed: the table beside that of the reversal."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

from rw_ekf.bench.contest import Models, finished
from rw_ekf.bench.scenario import Scenario
from rw_ekf.bench.spikes import RECOVERED_DEG, Spike, SpikeAnswer, answer_to_spike, rate_error_threshold_rpm
from rw_ekf.control.compensation.registry import SCHEMES
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


def documents_of(answers: dict[Place, SpikeAnswer]) -> list[dict[str, Any]]:
    """As `bench --spikes --json` has them."""
    return [
        {"scheme": name, "noise_rpm": noise_rpm, **answer._asdict()} for (name, noise_rpm), answer in answers.items()
    ]


def table_text(answers: dict[Place, SpikeAnswer]) -> str:
    """A table for a terminal."""
    spike = Spike()
    lines = [
        f"drag spike of {spike.of_coulomb:g} Coulomb friction at {spike.speed_rpm:g} rpm, decay {spike.decay_s:g} s; "
        f"recover: until the attitude stays within {RECOVERED_DEG:g} deg of where it would be; threshold of the rate "
        f"error {rate_error_threshold_rpm():g} rpm",
        f"  {'scheme':<22} {'noise':>6} {'peak':>8} {'recover':>8} {'rate error':>11} {'of threshold':>13}",
        f"  {'':<22} {'rpm':>6} {'deg':>8} {'s':>8} {'rpm':>11} {'':>13}",
    ]
    for (name, noise_rpm), answer in answers.items():
        recover = "-" if math.isnan(answer.recover_s) else f"{answer.recover_s:.1f}"
        trips = "  trips" if answer.of_threshold >= 1.0 else ""
        lines.append(
            f"  {name:<22} {noise_rpm:>6g} {answer.peak_deg:>8.4f} {recover:>8} {answer.rate_error_rpm:>11.1f} "
            f"{answer.of_threshold:>13.3f}{trips}"
        )
    return "\n".join(lines) + "\n"
