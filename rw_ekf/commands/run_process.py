"""What every run is wrapped in, of one wheel or of a line of them: the claim, the supervisor, who watches, the report.

Nothing here takes time before the port is claimed, so that `stop` finds who is about to drive it.
"""

from __future__ import annotations

import contextlib
import faulthandler
import os
import sys
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

from rw_ekf.clock import Clock, SystemClock
from rw_ekf.live.port_claim import PortClaim
from rw_ekf.live.stop_signal import StopSignal
from rw_ekf.live.stop_word import REPORTED_TO_STOP, stop_requested

if TYPE_CHECKING:
    import argparse
    from pathlib import Path

    from rw_ekf.live.oversight import Heartbeat, Oversight
    from rw_ekf.settings.schema import Configuration


class Run(Protocol):
    """A run from its claim to its report; the exit status. keep_safe: begin in SAFE where the run before crashed so."""

    def __call__(self, *, heartbeat: Heartbeat | None = None, keep_safe: bool = False) -> int:
        """Run."""


class Claimed(NamedTuple):
    """A port that is this process's, and what ends its run."""

    stop: StopSignal
    claim: PortClaim
    clock: Clock


@contextlib.contextmanager
def claimed(port: str, heartbeat: Heartbeat | None) -> Iterator[Claimed | None]:
    """Claim a port for a run; None where somebody has requested its stop before it began.

    A signal ends the run in order from here on, and a second one does not disturb the report.
    """
    clock = SystemClock()
    with StopSignal() as stop, PortClaim(port, clock) as claim:
        if stop_requested(port):
            if heartbeat is not None:
                heartbeat.reported()
            sys.stderr.write(f"rw-ekf: {REPORTED_TO_STOP}\n")
            yield None
            return
        with contextlib.suppress(OSError, ValueError, RuntimeError, AttributeError):  # where there is no standard error
            faulthandler.enable()  # a crash in compiled code says where
        yield Claimed(stop, claim, clock)


def supervised(configurations: tuple[Configuration, ...], args: argparse.Namespace, run: Run) -> int:
    """The supervisor; and each run that it starts, which comes here too, in a process of its own."""
    from rw_ekf.attach.wire import checked_protocol
    from rw_ekf.console import logger
    from rw_ekf.errors import BadInputError, RwEkfError
    from rw_ekf.live.supervisor import Patience, Supervisor

    if "NOTIFY_SOCKET" in os.environ:
        raise BadInputError("--supervise: systemd watches this process already (NOTIFY_SOCKET is set): leave it out")
    log, first = logger(args.log_format), configurations[0]
    if len(configurations) == 1:
        log = log.bind(wheel=first.wheel.name)
    wheels = tuple((configuration, checked_protocol(configuration)) for configuration in configurations)
    born = Supervisor(wheels, log, SystemClock(), Patience.of(first, len(wheels))).supervise()
    if isinstance(born, int):
        return born
    if args.duration is not None:
        args.duration = max(args.duration - born.elapsed_s, 1.0 / first.loop.rate_hz)
    try:
        return run(heartbeat=born.heartbeat, keep_safe=args.keep_safe or born.before > 0)
    except RwEkfError:
        born.heartbeat.reported()
        raise


def watched_by(heartbeat: Heartbeat | None, at: Claimed, log: Any, begin_safe: str | None = None) -> Oversight:
    """Who is notified of a run's turns: the supervisor, systemd, whichever there is."""
    from rw_ekf.live.oversight import Oversight, systemd_of

    if heartbeat is not None:
        heartbeat.on_orphaned(at.stop, log)
    watchdogs = (heartbeat, systemd_of(os.environ, at.clock))
    return Oversight(tuple(watchdog for watchdog in watchdogs if watchdog is not None), begin_safe)


def warn_of_safe(state_file: Path, log: Any) -> None:
    """Say of a run that begins anew that the one before, which left this file, was over in SAFE, if it was."""
    from rw_ekf.live.published_state import was_in_safe

    reason = was_in_safe(state_file)
    if reason is not None:
        log.warning("last_run_in_safe", reason=reason, do="this run begins anew: is what brought it there mended?")


def reported(say: Callable[[], None], log: Any) -> None:
    """Print what a run came to; the terminal, or who read us, may be gone: the run is well, and its files are there."""
    from rw_ekf.console import abandon_output

    try:
        say()
    except OSError as error:
        abandon_output()
        log.warning("report_lost", reason=str(error))
