"""When two names mean one port: a symbolic link and its device, a URL with and without options, a bus and its wheel."""

from __future__ import annotations

import ipaddress
import os
import socket
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

_ALIASES = ("/dev/serial/by-id", "/dev/serial/by-path")  # where udev keeps names that stay
_WRAPPERS = ("spy", "alt")  # pyserial's URLs around a device of this machine
_BUS, _ADAPTER = "can:", "can:slcan:"  # a bus is shared: `can:socketcan:can0#WHEEL` is the name of one wheel on it


def own_name(port: str) -> str:
    """The port as its configuration means it, without resolving links: an absolute path, "tcp:host:port", or a bus."""
    if port.startswith(_ADAPTER):
        port = port.removeprefix(_ADAPTER)
    elif port.startswith(_BUS):
        return port
    if "://" not in port:
        return os.path.abspath(port)
    try:
        parts = urlsplit(port)
        host, number = (parts.hostname or "").rstrip("."), parts.port
    except ValueError:  # no URL that anyone could open
        return port
    if parts.scheme.lower() in _WRAPPERS:
        return os.path.abspath(parts.netloc + parts.path)
    if number is None:
        return port
    return f"tcp:{_address_of(host)}:{number}"


def _address_of(host: str) -> str:
    """One spelling for a host as it is written: names as they are, addresses in their shortest form."""
    text = host.partition("%")[0]
    try:
        address = ipaddress.ip_address(text)
    except ValueError:
        try:
            address = ipaddress.IPv4Address(socket.inet_aton(text))  # 127.1 and the like, which pyserial opens too
        except (OSError, ValueError):
            return "localhost" if text == "localhost" else host
    address = getattr(address, "ipv4_mapped", None) or address
    return "localhost" if address.is_loopback or address.is_unspecified else str(address)


def _addresses(name: str) -> list[str]:
    """Other names of a port on the net: by each address that its host has now; none where that cannot be determined."""
    kind, host, number = name.partition(":")[0], *name.partition(":")[2].rpartition(":")[::2]
    if kind != "tcp" or host == "localhost":
        return []
    try:
        found = socket.getaddrinfo(host, int(number), type=socket.SOCK_STREAM)
    except (OSError, ValueError):
        return []
    hosts = {"localhost" if _is_this_machine(info) else _address_of(str(info[4][0])) for info in found}
    return [f"tcp:{one}:{number}" for one in sorted(hosts)]


def _is_this_machine(info: tuple[socket.AddressFamily, socket.SocketKind, int, str, Any]) -> bool:
    """Whether an address, as getaddrinfo gives it, is one of this machine's own: only those can be bound."""
    family, _, _, _, address = info
    try:
        with socket.socket(family, socket.SOCK_DGRAM) as probe:
            probe.bind((address[0], 0, *address[2:]))
    except OSError:
        return False
    return True


def device_of(name: str) -> str | None:
    """Path of the device that a name (from own_name) leads to now; None where there is none, or it is on the net."""
    if not os.path.isabs(name) or not os.path.exists(name):
        return None
    return os.path.realpath(name)


def names_of(port: str) -> frozenset[str]:
    """Every name of the port that can be found out now: its own, and its device's where that is there."""
    name = own_name(port)
    return frozenset(filter(None, (name, device_of(name), *_addresses(name))))


def other_names_of(name: str) -> list[str]:
    """What else a name (from own_name) is known by for as long as a run lasts: its adapter's names, its addresses."""
    return [*aliases_of(device_of(name)), *_addresses(name)]


def aliases_of(device: str | None) -> list[str]:
    """The names that udev keeps for a device; they say which adapter it was once it has been pulled out."""
    if device is None:
        return []
    found = []
    for directory in map(Path, _ALIASES):
        try:
            found += [str(link) for link in sorted(directory.iterdir()) if os.path.realpath(link) == device]
        except OSError:
            continue
    return found


def serial_ports() -> list[str]:
    """Serial ports of this machine, adapters before what is built in, each by the name that stays where it has one."""
    from serial.tools.list_ports import comports

    ports = sorted(comports(), key=lambda port: (port.vid is None, port.device))
    return [next(iter(aliases_of(device_of(port.device))), port.device) for port in ports]
