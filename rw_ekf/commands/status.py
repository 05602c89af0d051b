"""`rw-ekf status`: what the daemon of a configuration is doing, also when it is dead."""

from __future__ import annotations

import argparse
import os
from typing import TYPE_CHECKING, Any

from rw_ekf.commands.answer import answer
from rw_ekf.commands.inputs import add_config_option

if TYPE_CHECKING:
    from pathlib import Path

    from rw_ekf.live.published_state import Published
    from rw_ekf.settings.schema import Configuration

HELP = "say what the daemon of a configuration is doing, also when it is dead"
EXAMPLE = """example:
  rw-ekf status --config my-wheel.yaml --json

exit status: 0 alive and TRACKING, 3 alive but not, 4 not alive; of several wheels what all have, else 3"""

TRACKING_STATUS, OTHER_STATUS, DEAD_STATUS = 0, 3, 4
_LINK_WORDS = ("state", "bus", "trouble")  # of the link, what is no number


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    add_config_option(parser, required=True)


def execute(args: argparse.Namespace) -> int:
    """Run the verb; raises RwEkfError."""
    from rw_ekf.settings.load import load_configurations, one_of_wheels

    configurations = load_configurations(args.config)
    if args.wheel is not None or len(configurations) == 1:
        document, status = _of_wheel(one_of_wheels(configurations, args.config, args.wheel))
        answer(args, lambda: document, lambda: "\n".join(_lines(document)))
        return status
    found = [(configuration.wheel.name, *_of_wheel(configuration)) for configuration in configurations]
    statuses = [status for _, _, status in found]
    wheels = [{"wheel": name, **document} for name, document, _ in found]
    text = "\n".join(f"{name}: {line}" for name, document, _ in found for line in _lines(document))
    answer(args, lambda: {"schema": "rw_ekf.bus_status/1", "wheels": wheels}, lambda: text)
    return statuses[0] if len(set(statuses)) == 1 else OTHER_STATUS


def _of_wheel(configuration: Configuration) -> tuple[dict[str, Any], int]:
    """What one wheel's run publishes, and the exit status for it."""
    from rw_ekf.clock import SystemClock
    from rw_ekf.live.published_state import published_place, read_published
    from rw_ekf.live.running_daemon import holders_of
    from rw_ekf.records import RunState

    clock = SystemClock()
    holders = holders_of(configuration.wheel.port, clock)
    path = published_place(configuration, [facts.uid for facts in holders])
    found = read_published(path)
    if holders and (found is None or not found.alive):  # of another configuration, or without a state file
        return _elsewhere(holders[0].pid, holders[0].described, configuration.wheel.port), OTHER_STATUS
    if found is None:
        return _nothing(path), DEAD_STATUS
    document = _document(found)
    if silence := found.silence(clock.utc()):
        document["reason"] += silence
        return document, OTHER_STATUS
    if not found.alive:
        for facts in holders_of(configuration.wheel.port, clock, supervise=True):
            document["reason"] += f" ({facts.described} supervises it, and starts it again)"
        return document, DEAD_STATUS
    return document, TRACKING_STATUS if found.run_state == RunState.TRACKING else OTHER_STATUS


def _document(found: Published) -> dict[str, Any]:
    reported = found.document
    compensation = {"compensation": reported["compensation"]} if "compensation" in reported else {}
    return {
        "schema": "rw_ekf.status/1",
        "alive": found.alive,
        "pid": reported["pid"],
        "utc": reported.get("utc"),
        "began_utc": reported.get("began_utc"),
        "dead_since_utc": None if found.alive else reported.get("ended_utc") or reported.get("utc"),
        "ended_utc": reported.get("ended_utc"),
        "state": found.run_state,
        "since_utc": reported.get("since_utc"),
        "reason": str(reported.get("reason")),
        "link": reported.get("link"),
        "alarms": reported.get("alarms", []),
        "estimate": {key: reported.get(key) for key in ("time_s", "outcome", "state", "std")},
        "current_command_A": reported.get("current_command_A"),
        "temperature_degC": reported.get("temperature_degC"),
        "log": reported.get("log"),
        **compensation,
    }


def _unknown(*, alive: bool, pid: int | None, reason: str) -> dict[str, Any]:
    keys = ("utc", "began_utc", "dead_since_utc", "ended_utc", "state", "since_utc", "link")
    rest = ("estimate", "current_command_A", "temperature_degC", "log")
    return {
        "schema": "rw_ekf.status/1",
        "alive": alive,
        "pid": pid,
        **dict.fromkeys(keys),
        "reason": reason,
        "alarms": [],
        **dict.fromkeys(rest),
    }


def _nothing(path: Path) -> dict[str, Any]:
    reason = f"no run of this configuration has left {path.absolute()}"
    if os.path.lexists(path):
        reason = f"{path} is no state file that this version reads, and says nothing: the next run replaces it"
    return _unknown(alive=False, pid=None, reason=reason)


def _elsewhere(pid: int, described: str, port: str) -> dict[str, Any]:
    reason = (
        f"{described} drives the wheel at {port}, but publishes elsewhere or not at all: was it started with another "
        "configuration, or is this one of several wheels on the line, and has not answered yet?"
    )
    return _unknown(alive=True, pid=pid, reason=reason)


def _headline(document: dict[str, Any]) -> str:
    from rw_ekf.logs.metadata import after_start

    state, reason = document["state"], document["reason"]
    after = after_start(document["began_utc"], document["since_utc"])
    if document["alive"]:
        since = f" since {document['since_utc']}{after}" if document["since_utc"] else ""
        return f"{state or 'unknown'}{since} (process {document['pid']}): {reason}"
    if state is None:
        return f"dead: {reason}"
    over = "ended at" if document.get("ended_utc") else "dead since"
    ran = after_start(document["began_utc"], document["dead_since_utc"])
    return f"{over} {document['dead_since_utc']}{ran}; it was {state} since {document['since_utc']}{after}: {reason}"


def _lines(document: dict[str, Any]) -> list[str]:
    """For a person: one line of state, then what is known."""
    from rw_ekf.model.state import PARAMETER_NAMES, STATE_UNITS
    from rw_ekf.sinks.status_line import concise
    from rw_ekf.units import rpm_from_rad_s

    lines = [_headline(document)]
    state, std = ((document["estimate"] or {}).get(key) or {} for key in ("state", "std"))
    shown = ("speed_rad_s", *PARAMETER_NAMES)
    if all(reported.get(name) is not None for reported in (state, std) for name in shown):
        current = document["current_command_A"]
        commanded = "not known" if current is None else f"{1e3 * current:+.1f} mA"
        then = "" if document["alive"] else "when it was last published, not now: "
        lines.append(f"  {then}speed {rpm_from_rad_s(state['speed_rad_s']):+.1f} rpm, current {commanded}")
        lines.append("  " + ", ".join(f"{n} {concise(state[n], std[n])} {STATE_UNITS[n]}" for n in PARAMETER_NAMES))
    link = document["link"]
    if link is not None:
        counts = {name: f"{value:.3g}" if isinstance(value, float) else value for name, value in link.items()}
        reported = ", ".join(
            f"{value} {name}" for name, value in counts.items() if value is not None and name not in _LINK_WORDS
        )
        bus = f", bus {link['bus']}" if link.get("bus") else ""
        lines.append(f"  line {link.get('state') or 'opened'}{bus}: {reported}")
        if link.get("trouble"):
            lines.append(f"  {link['trouble']}")
    compensation = document.get("compensation")
    if compensation is not None:
        lines.append(
            f"  compensation {compensation['scheme']} {'on' if compensation['on'] else 'off'}: {compensation['reason']}"
        )
    lines += [f"  alarm: {alarm['text']}" for alarm in document["alarms"]]
    return [*lines, f"  log {document['log']}"] if document["log"] else lines
