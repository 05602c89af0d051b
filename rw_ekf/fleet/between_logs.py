"""What goes from one log of a wheel to the next: what is believed at its end, and where the wheel's learning began.

Between two logs nobody watched: the parameters may have wandered, and the wheel has another temperature. That is what
`rw_ekf.learning.aged_model` does between two runs of the daemon, and it is done here in the same way.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from datetime import datetime
from typing import TYPE_CHECKING, Any

from rw_ekf.identify.record_scale import speed_noise_of
from rw_ekf.learning.aged_model import aged, as_given, carried_over
from rw_ekf.logs.metadata import moment_of, utc_text
from rw_ekf.logs.sampling import without_repeats
from rw_ekf.starting_point import (
    FilterSetup,
    course_for,
    model_of,
    setup_of_configuration,
    setup_of_model,
    setup_of_record,
    setup_of_start,
)
from rw_ekf.wheel.model_file import WheelModel, model_from_data

# A day whose innovations are so unlike what was expected is looked at again, and its noise is another where its third
# differences say so too. Of a healthy day's 6,000 innovations the mean square is within 1.1 of one. Chosen: with a
# third more or less a noise that has doubled is seen all the same.
_OTHER_NIS, _OTHER_NOISE, _REJECTED = 2.0, 1.5, 0.01

if TYPE_CHECKING:
    from rw_ekf.log_replay import Run
    from rw_ekf.logs.wheel_log import WheelLog
    from rw_ekf.settings.schema import Configuration


@dataclass(frozen=True)
class Carry:
    """The belief of a wheel between two logs."""

    model: WheelModel
    origin: WheelModel  # the first start of all: beyond its sigmas nothing is forgotten
    ends_utc: datetime

    def to_text(self) -> str:
        """As it is kept beside a result; every float reads back exactly."""
        return json.dumps(
            {"model": self.model.document(), "origin": self.origin.document(), "ends_utc": utc_text(self.ends_utc)}
        )

    @classmethod
    def of_text(cls, text: str) -> Carry:
        """Read it back. Raises ConfigError, ValueError or LookupError for what is none."""
        data = json.loads(text)
        ends = moment_of(data["ends_utc"])
        if ends is None:
            raise ValueError("the end of a carried belief is no time")
        return cls(plain_model(data["model"]), plain_model(data["origin"]), ends)


def plain_model(data: Any) -> WheelModel:
    """A model of plain data, as its document has it."""
    return model_from_data(data, lambda path: "the model")


@dataclass(frozen=True)
class Starting:
    """Where the filter starts for one log: its setup, what it began from before the log, and the origin."""

    setup: FilterSetup
    origin_setup: FilterSetup
    origin: WheelModel


def first_start(log: WheelLog, configuration: Configuration | None, model: WheelModel | None) -> Starting:
    """The start of a wheel's first log: from the configuration, the model, or the log itself, in that order.

    A model that is given is believed as a run would believe it: of a wheel of another temperature, at the least.
    """
    course = course_for(without_repeats(log)[0], model)
    given = None
    if model is not None:
        given = carried_over(model)[0]
        drifts = None if configuration is None else setup_of_configuration(configuration, given).constants
        given = as_given(given, drifts)
    setup = setup_of_record(course, configuration, given)
    return Starting(setup, setup, model_of(setup.prior, setup, {"method": "fleet"}))


def next_start(log: WheelLog, configuration: Configuration | None, carry: Carry, begins_utc: datetime) -> Starting:
    """The start of every later log: the belief of the one before, as old as it is by now."""
    period_s = 1.0 / log.rate_hz if log.rate_hz > 0.0 else 0.0
    origin = _setup(carry.origin, configuration, period_s)
    gap_s = max((begins_utc - carry.ends_utc).total_seconds(), 0.0)
    model = aged(carried_over(carry.model)[0], origin, gap_s)
    return Starting(_setup(model, configuration, period_s), origin, carry.origin)


def with_noise_of(start: Starting, log: WheelLog, run: Run) -> Starting | None:
    """The start with the noise that the readings of this log show; None where the one before it does for them.

    A wheel's noise is that of its first log, until innovations are not what it lets expect: a filter that runs with
    a tenth of the noise rejects half of the readings, and is as sure of the other half as before.
    """
    used = run.statistics.nis_sum / max(run.statistics.used, 1)
    if 1.0 / _OTHER_NIS < used < _OTHER_NIS and run.statistics.rejected < _REJECTED * run.statistics.samples:
        return None
    now, before = speed_noise_of(log.speed_rad_s, log.segment), start.setup.constants.speed_noise_rad_s
    if now is None or 1.0 / _OTHER_NOISE < now / before < _OTHER_NOISE:
        return None
    return replace(start, setup=replace(start.setup, constants=start.setup.constants.with_speed_noise(now)))


def _setup(model: WheelModel, configuration: Configuration | None, period_s: float) -> FilterSetup:
    if configuration is not None:
        return setup_of_start(configuration, model)
    noise, torque_noise = model.speed_noise_rad_s, model.acceleration_noise
    assert noise is not None
    assert torque_noise is not None
    return setup_of_model(model, noise, torque_noise, period_s)
