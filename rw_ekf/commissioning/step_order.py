"""The order of the steps: each is done once, and what it found is on the disk before the next begins."""

from __future__ import annotations

import math
import os
import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any

from rw_ekf.commissioning.agreed_limits import agree_to_move, ask_limits
from rw_ekf.commissioning.delay import find_delay
from rw_ekf.commissioning.dialogue import Stopped
from rw_ekf.commissioning.find import USUAL_BAUDS, Search, find_wheel, shipped_maps
from rw_ekf.commissioning.first_move import find_sign
from rw_ekf.commissioning.fit_and_diagnosis import make_model
from rw_ekf.commissioning.identification_run import identify
from rw_ekf.commissioning.setting import write_configuration
from rw_ekf.commissioning.step_context import Work
from rw_ekf.commissioning.still import measure_still
from rw_ekf.errors import BadInputError, NotInstalledError
from rw_ekf.live.stop_signal import stops_heeded
from rw_ekf.settings.resources import is_path

_MOVES = ("still", "sign", "delay", "identification")  # steps at the wheel


def commission(
    work: Work,
    computing: Callable[[], object] = lambda: None,
    advance: Callable[[str], object] = lambda text: None,
) -> None:
    """Go through all that has not been done. computing: called before the model is made; advance: called at its steps.

    Raises Stopped for a signal, and whatever a step refuses by; what was found is kept.
    """
    progress = work.progress
    if work.stop.requested is not None:
        raise Stopped
    _take_up(work)
    if progress["find"] is None:
        progress.keep("find", _find(work))
    if progress["limits"] is None:
        with interruptible():
            progress.keep("limits", ask_limits(work))
    if any(progress[step] is None for step in _MOVES):
        with interruptible():
            agree_to_move(work)
    if any(progress[step] is None for step in _MOVES):
        write_configuration(progress)  # before any current: a wheel that does not confirm zero is stopped by it
    if progress["still"] is None:
        with work.at_the_wheel() as bench:
            still = measure_still(bench, work.spoken(work.configuration()).limits.speed_step_rad_s)
        work.dialogue.say("still", still.text())
        progress.keep("still", still._asdict())
    for step, do in (("sign", find_sign), ("delay", find_delay), ("identification", identify)):
        if progress[step] is None:
            progress.keep(step, do(work))
    if progress["model"] is None:
        with interruptible():
            computing()
            progress.keep("model", make_model(work, advance))
    progress.keep("done", True)


@contextmanager
def interruptible() -> Iterator[None]:
    """Where no wheel is held: a signal ends it at once, wherever it is. Raises Stopped."""

    def stop(number: int, frame: FrameType | None) -> None:
        raise Stopped

    heeded = stops_heeded() if threading.current_thread() is threading.main_thread() else []
    before = {number: signal.signal(number, stop) for number in heeded}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _take_up(work: Work) -> None:
    """Hold what was given now against what was found before. Raises BadInputError where the two are of two wheels."""
    progress, options = work.progress, work.options
    found, limits, sign = (progress[step] for step in ("find", "limits", "sign"))
    ratio = options.speed_ratio
    if ratio is not None and not (math.isfinite(ratio) and ratio > 0.0):
        raise BadInputError(f"--speed-ratio {ratio:g}: give true speed over reading, above zero")
    if found is not None:
        for option, given, kept in (
            ("--port", options.port, found["port"]),
            ("--protocol", None if options.protocol is None else _whole(options.protocol), found["protocol"]),
        ):
            if given is not None and given != kept:
                raise BadInputError(
                    f"{option} {given}: {progress.directory} holds what was found of the wheel on {found['port']} "
                    f"through {found['protocol']}: name another --out, or remove commission.json there"
                )
    given_limits = {
        "current_A": options.current_limit_A,
        "speed_rpm": options.speed_limit_rpm,
        "temperature_degC": options.temperature_limit_degC,
    }
    if limits is not None and any(value is not None and value != limits[name] for name, value in given_limits.items()):
        progress.forget_from("limits")
    elif sign is not None and ratio is not None and ratio != sign["speed_ratio"]:
        progress.forget_from("sign")
    done = [
        step for step in ("find", "limits", "still", "sign", "delay", "identification") if progress[step] is not None
    ]
    if done:
        work.dialogue.say("resumed", f"{progress.directory} has {', '.join(done)} already; it goes on behind that")


def _find(work: Work) -> dict[str, Any]:
    options = work.options
    names = _maps(work)
    ports = [options.port] if options.port is not None else work.ports()
    bauds: list[int | None] = [options.baud] if options.baud is not None else [None, *USUAL_BAUDS]
    work.dialogue.say("find", f"reading only, on {', '.join(ports) or 'no port'}, through {', '.join(names)}")

    def may_start(question: str) -> bool:
        with interruptible():
            return work.options.yes or bool(work.dialogue.agree(question))

    search = Search(work.clock, work.stop, work.protocol_of)
    found = find_wheel(search, ports, names, bauds, work.dialogue, may_start)
    work.dialogue.say("find", found.text())
    return found.document()


def _maps(work: Work) -> list[str]:
    """The wire maps to try: the one that was given, else those shipped that can be read with what is installed.

    A mistake in one is reported before any port is opened. Raises ConfigError; for one that was given also where what
    reads it is not installed.
    """
    if work.options.protocol is not None:
        named = _whole(work.options.protocol)
        work.protocol_of(named)
        return [named]
    names = []
    for name in shipped_maps():
        try:
            work.protocol_of(name)
        except NotInstalledError as error:
            work.dialogue.say("find", f"{name} is left out: {error.findings[0].partition(': ')[2]}")
        else:
            names.append(name)
    return names


def _whole(protocol: str) -> str:
    """A path that still leads there from another folder."""
    return os.path.abspath(os.path.expanduser(protocol)) if is_path(protocol) else protocol
