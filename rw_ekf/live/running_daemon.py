"""The daemon that drives a wheel, found and signalled from outside: ended, or made to resume; never another process."""

from __future__ import annotations

import contextlib
import os
import signal
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

from rw_ekf.clock import Clock
from rw_ekf.errors import DriverError
from rw_ekf.live.port_claim import Claim, held_claims, is_held
from rw_ekf.live.port_name import device_of, names_of, own_name
from rw_ekf.live.process import ProcessFacts, ProcessHandle, facts_of, has_open, processes_with, user_name
from rw_ekf.live.stop_word import leave_word

_KILL_WITHIN_S = 2.0
_SUPERVISOR_WITHIN_S = 30.0  # it waits for its daemon, and writes zero itself where that hangs
_LOOK_EVERY_S = 0.02


@dataclass
class HolderReport:
    """What became of who had the port."""

    ended: list[int] = field(default_factory=list)  # every daemon that gave the port up, however
    killed: list[int] = field(default_factory=list)  # those of them that had to be killed
    remaining: list[str] = field(default_factory=list)  # daemons that still drive the wheel, one sentence each
    notes: list[str] = field(default_factory=list)  # what else a person should know


def stop_holder(port: str, clock: Clock, within_s: float = 5.0) -> HolderReport:
    """End every daemon that drives the wheel at `port`: SIGTERM, and SIGKILL where that has not helped within_s [s].

    Supervisors first, so that none starts its daemon again. Found by the claim that it holds, under any name of the
    port, also where its file has been removed. A process is signalled only if the kernel bears out that it made that
    claim: that it has the port open says nothing, a lab has programs of its own. Runs that are still starting, and so
    have no claim, find a word from here when they make it. Never raises.
    """
    leave_word(port)
    report = HolderReport()
    device = device_of(own_name(port))
    claims = held_claims(names_of(port), clock)
    for claim in sorted(claims, key=lambda claim: not claim.supervises):
        holder = claim.holder()
        if holder is None and is_held(claim):
            report.notes.append(_not_believed(claim))
        elif holder is not None and holder.pid != os.getpid():
            patience_s = _SUPERVISOR_WITHIN_S if claim.supervises else within_s
            its_port = None if claim.supervises else device  # a supervisor may have none open, and open it later
            _end(holder, lambda claim=claim: is_held(claim), its_port, clock, patience_s, report)  # type: ignore[misc]
    return report


def holders_of(port: str, clock: Clock, *, supervise: bool = False) -> list[ProcessFacts]:
    """Every other daemon that drives the wheel at `port`, by the claim that it holds.

    supervise: every other process that starts a daemon on `port` again when it dies, instead.
    """
    found = [claim.holder() for claim in held_claims(names_of(port), clock) if claim.supervises is supervise]
    return [facts for facts in found if facts is not None and facts.pid != os.getpid()]


def tell(facts: ProcessFacts, number: signal.Signals) -> bool:
    """Signal a daemon that was found; False where it has ended meanwhile. Raises DriverError where we may not."""
    with _handle_on(facts) as handle:
        if handle is None:
            return False
        try:
            handle.send(number)
        except PermissionError:
            raise DriverError(
                f"{facts.described} may not be signalled by user {user_name(os.geteuid())}: "
                f"do it as {user_name(facts.uid)} or as root"
            ) from None
    return True


def others_with(port: str) -> list[str]:
    """Who else has the port open, for a person: "process 4711 of user anna (minicom)"."""
    device = device_of(own_name(port))
    found = [facts_of(pid) for pid in processes_with(device)] if device is not None else []
    return [f"{facts.described} ({' '.join(facts.arguments[:3])[:60]})" for facts in found if facts is not None]


def _end(
    facts: ProcessFacts,
    holds: Callable[[], bool],
    device: str | None,
    clock: Clock,
    within_s: float,
    report: HolderReport,
) -> None:
    """Signal one process that was found to be a daemon, and wait until it no longer holds what it held."""
    with _handle_on(facts) as handle:
        if handle is None:  # it ended by itself
            report.ended.append(facts.pid)
            return
        try:
            handle.send(signal.SIGTERM)
            if facts.stopped:
                handle.send(signal.SIGCONT)  # it acts on SIGTERM only when it runs again
            if _until(lambda: handle.ended() or not holds(), clock, within_s):
                report.ended.append(facts.pid)
                return
            if device is not None and not has_open(facts.pid, device):
                report.ended.append(facts.pid)
                report.notes.append(f"{facts.described} has given the port up but not ended yet")
                return
            handle.send(signal.SIGKILL)
        except PermissionError:
            me = user_name(os.geteuid())
            report.remaining.append(
                f"{facts.described} is a daemon that drives this wheel, and user {me} may not signal it: run "
                f"`rw-ekf stop` as {user_name(facts.uid)} or as root"
            )
            return
        if handle.ended(_KILL_WITHIN_S):
            report.ended.append(facts.pid)
            report.killed.append(facts.pid)
        else:
            report.remaining.append(
                f"{facts.described} did not end when told, nor when killed: it hangs in the kernel, in the port's "
                "driver most likely; pull the adapter out"
            )


@contextlib.contextmanager
def _handle_on(facts: ProcessFacts) -> Iterator[ProcessHandle | None]:
    """A handle on the process that was looked at; None where it has ended, whatever has its number now."""
    try:
        handle = ProcessHandle(facts.pid)
    except OSError:
        yield None
        return
    with handle:
        now = facts_of(facts.pid)  # looked at again under the handle: from here on it cannot be another
        same = now is not None and (now.start_ticks, now.uid) == (facts.start_ticks, facts.uid)
        yield handle if same else None


def _until(condition: Callable[[], bool], clock: Clock, within_s: float) -> bool:
    end_s = clock.monotonic() + within_s
    while not condition():
        if clock.monotonic() > end_s:
            return False
        clock.sleep(_LOOK_EVERY_S)
    return True


def _not_believed(claim: Claim) -> str:
    facts = facts_of(claim.pid) if claim.pid is not None and claim.pid > 1 else None
    named = "no process" if claim.pid is None else f"process {claim.pid}"
    if facts is not None:
        named = f"{facts.described} ({' '.join(facts.arguments[:2])[:60]})"
    return (
        f"{claim.described} is locked and names {named}, but that is not a daemon that holds it: it was not "
        "signalled. Remove the file if nothing uses the port"
    )
