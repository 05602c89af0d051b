"""The systemd unit of one wheel: notified of completed turns, zero behind every end, nothing else within reach."""

from __future__ import annotations

import re
from dataclasses import dataclass

from rw_ekf.errors import BadInputError

_PLAIN = re.compile(r"[A-Za-z0-9_@:,./+=-]+")
_RESTART_AFTER_S = 2
_STOP_WITHIN_S = 60  # the end of a run is judged and its files are finished; zero was sent long before
_START_WITHIN_S = 300  # the first start compiles
_ABORT_WITHIN_S = 3  # a process that does not even die of SIGABRT has been stopped: the wheel must not wait for it
_CACHE = "rw-ekf"  # below /var/cache


@dataclass(frozen=True)
class Service:
    """What differs from wheel to wheel and from machine to machine; every path is absolute."""

    wheel: str
    port: str
    program: tuple[str, ...]  # the command line up to the verb
    config: str
    working_directory: str
    output_directories: tuple[str, ...]
    lock_directories: tuple[str, ...]  # where claims on ports may lie
    user: str
    group: str | None  # that may open the port; None: no other than the user's own
    devices: tuple[str, ...]  # kinds of device that the port may be, e.g. "ttyUSB"; none where it is on the network
    hung_after_s: float
    network: bool = False  # whether the run is queried, or sends, over it
    writes: bool = True  # False: another controller commands the wheel, and nothing may be written for it


def unit_text(service: Service) -> str:
    """Text of the unit. Raises BadInputError where a name cannot stand in one."""
    program = " ".join([executable(service.program[0]), *(word(part) for part in service.program[1:])])
    config = word(service.config)
    writable = " ".join(
        [*map(path_word, service.output_directories), *(f"-{path_word(path)}" for path in service.lock_directories)]
    )
    group = [f"SupplementaryGroups={word(service.group)}"] if service.group is not None else []
    stop = [
        "# Behind every end, a kill among them. Not confirmed: the unit has failed.",
        f"ExecStopPost={program} stop --config {config}",
    ]
    families = "AF_UNIX AF_INET AF_INET6" if service.network or not service.devices else "AF_UNIX"
    if not service.devices and service.port.startswith("can:"):
        families += " AF_CAN"
    lines = [
        "[Unit]",
        f"Description=rw-ekf, reaction wheel {line(service.wheel)} at {line(service.port)}",
        "# A wheel that is not plugged in yet is waited for, however long.",
        "StartLimitIntervalSec=0",
        "",
        "[Service]",
        "Type=notify",
        f"ExecStart={program} run --keep-safe --config {config}",
        *(stop if service.writes else []),
        f"WorkingDirectory={line(service.working_directory)}",
        f"User={word(service.user)}",
        *group,
        "",
        "# Fed at the end of completed turns only.",
        f"WatchdogSec={service.hung_after_s:g}",
        f"TimeoutAbortSec={_ABORT_WITHIN_S}",
        f"TimeoutStartSec={_START_WITHIN_S}",
        f"TimeoutStopSec={_STOP_WITHIN_S}",
        "KillMode=mixed",
        "Restart=on-failure",
        f"RestartSec={_RESTART_AFTER_S}",
        "# 2: the configuration must be mended. 5: SAFE, which only a person leads out of.",
        "RestartPreventExitStatus=2 5",
        "",
        "ProtectSystem=strict",
        "ProtectHome=read-only",
        f"ReadWritePaths={writable}",
        "# `rw-ekf stop` of any user finds the run by a lock file there.",
        "PrivateTmp=no",
        f"CacheDirectory={_CACHE}",
        f"Environment=RW_EKF_CACHE_DIR=%C/{_CACHE}",
        "DevicePolicy=closed",
        *(f"DeviceAllow=char-{kind} rw" for kind in service.devices),
        f"RestrictAddressFamilies={families}",
        "NoNewPrivileges=yes",
        "CapabilityBoundingSet=",
        "ProtectClock=yes",
        "ProtectControlGroups=yes",
        "ProtectHostname=yes",
        "ProtectKernelLogs=yes",
        "ProtectKernelModules=yes",
        "ProtectKernelTunables=yes",
        "RestrictNamespaces=yes",
        "RestrictRealtime=yes",
        "RestrictSUIDSGID=yes",
        "LockPersonality=yes",
        "SystemCallArchitectures=native",
        "SystemCallFilter=@system-service",
        "LimitCORE=0",
        "",
        "[Install]",
        "WantedBy=multi-user.target",
    ]
    return "\n".join(lines) + "\n"


def word(text: str) -> str:
    """One word of a command line in a unit."""
    text = line(text).replace("$", "$$")
    if _PLAIN.fullmatch(text):
        return text
    escaped = text.replace("\\", "\\\\").replace('"', '\\"')
    return f'"{escaped}"'


def executable(path: str) -> str:
    """The first word of a command line, in which systemd allows less and expands no variable."""
    if any(character in path for character in "\"'\\"):
        raise BadInputError(
            f"{path}: systemd starts no program whose path has quotes or a backslash: install elsewhere"
        )
    text = line(path)
    return text if _PLAIN.fullmatch(text) else f'"{text}"'


def path_word(path: str) -> str:
    """One path of a list of paths, where quotes count, but a backslash is itself."""
    text = line(path)
    if _PLAIN.fullmatch(text):
        return text
    if '"' in text and "'" in text:
        raise BadInputError(f"{path}: a path with both kinds of quotes cannot stand in a unit: give it another name")
    return f"'{text}'" if '"' in text else f'"{text}"'


def line(text: str) -> str:
    """The rest of a line; nothing in it is expanded."""
    if not text or not text.isprintable() or text != text.strip():
        raise BadInputError(f"{text!r} cannot stand in a systemd unit: give it a name without control characters")
    return text.replace("%", "%%")
