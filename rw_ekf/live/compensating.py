"""What a configuration says of compensation, put together for a run: the request, the scheme, whose parameters."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from rw_ekf.clock import Clock
from rw_ekf.control.commanders import Commander
from rw_ekf.control.compensation.on_wheel import Terms, WheelCompensator
from rw_ekf.control.compensation.scheme import Request
from rw_ekf.control.compensation.schemes import WheelSheet, scheme_of_a_run
from rw_ekf.control.compensation.trust import ParameterTrust, is_trusted_start
from rw_ekf.control.compensation.unmodelled_drag import SpeedNoise
from rw_ekf.errors import ConfigError
from rw_ekf.learning.run_start import Start
from rw_ekf.live.request_socket import RequestSocket, RequestTerms
from rw_ekf.live.sign_check import SignCheck
from rw_ekf.model.state import PARAMETER_NAMES
from rw_ekf.records import CompensationNow, StateNow
from rw_ekf.sinks.run_files import request_path

if TYPE_CHECKING:
    from rw_ekf.settings.schema import Configuration

Compensating = Callable[[StateNow | None], CompensationNow | None]  # what becomes of it, called in every turn


def compensated(
    commander: Commander | None,
    configuration: Configuration,
    start: Start,
    requests: RequestSocket | None,
    sign: SignCheck,
    logger: Any,
) -> tuple[Commander | None, Compensating]:
    """The commander with friction compensation where the configuration requests it, and what it does at each turn.

    sign: of the wheel; until it is confirmed nothing is compensated, because a compensation with the wrong sign drives
    the wheel by itself. Raises ConfigError where the motor gain is zero.
    """
    section = configuration.compensation
    if commander is None or section.scheme is None:
        return commander, lambda state: None
    entry = scheme_of_a_run(section.scheme)
    setup = start.setup
    constants = setup.constants
    noise = SpeedNoise.of(constants)
    sheet = WheelSheet(setup.prior.parameters, constants.stribeck, configuration.loop.rate_hz, noise)
    gain = sheet.parameters.motor_gain
    if gain == 0.0:
        raise ConfigError("compensation: the motor gain that the run starts from is zero: no current gives a torque")
    trust = ParameterTrust(
        PARAMETER_NAMES if entry.parameters_from == "estimator" else (),
        constants.stribeck,
        start_trusted=start.document["from"] != "configuration" and is_trusted_start(setup.prior),
    )
    terms = Terms(
        section.limit_A,
        section.fade_s,
        lambda: None if sign.confirmed else "the sign of this wheel is not confirmed yet",
        logger.info,
    )
    if requests is not None:
        commander = replace(commander, profile=replace(commander.profile, name="torques as they are asked for"))
        requests.most_Nm = abs(gain) * configuration.limits.current_A * configuration.wheel.inertia_kg_m2
    compensator = WheelCompensator(entry, sheet, _request(commander, requests, gain), trust, terms)
    return replace(commander, controller=compensator), compensator.compensating


def _request(commander: Commander, requests: RequestSocket | None, motor_gain: float) -> Request:
    """The acceleration requested: by torques, or by a profile's current times the gain that the run starts from."""
    if requests is not None:
        return requests.request_rad_s2
    profile = commander.controller
    return lambda tick: motor_gain * profile(tick)


@contextlib.contextmanager
def request_socket(configuration: Configuration, clock: Clock, logger: Any) -> Iterator[RequestSocket | None]:
    """The socket that a run takes torques by, for the length of a with block; None where it takes none.

    Raises BadInputError where it cannot be made.
    """
    if not configuration.takes_torques:
        yield None
        return
    section = configuration.compensation
    path = request_path(configuration)
    if section.socket is None:
        with contextlib.suppress(OSError):  # where it cannot be made, that is reported of the socket
            path.parent.mkdir(parents=True, exist_ok=True)
    terms = RequestTerms(configuration.wheel.inertia_kg_m2, section.stale_s, section.fade_s)
    requests = RequestSocket(path, terms, clock, logger.info)
    logger.info("requests", socket=str(path), text="torques on the wheel are taken here")
    try:
        yield requests
    finally:
        requests.close()
