"""When two names mean one port: a symbolic link and its device, a URL with and without options."""

from __future__ import annotations

import os
from pathlib import Path
from urllib.parse import urlsplit

_ALIASES = ("/dev/serial/by-id", "/dev/serial/by-path")  # where udev keeps names that stay
_WRAPPERS = ("spy", "alt")  # pyserial's URLs around a device of this machine
_THIS_MACHINE = frozenset({"localhost", "127.0.0.1", "::1"})


def own_name(port: str) -> str:
    """The port as its configuration means it, without resolving links: an absolute path, or "tcp:host:port"."""
    if "://" not in port:
        return os.path.abspath(port)
    try:
        parts = urlsplit(port)
        host, number = (parts.hostname or "").lower(), parts.port
    except ValueError:  # no URL that anyone could open
        return port
    if parts.scheme.lower() in _WRAPPERS:
        return os.path.abspath(parts.netloc + parts.path)
    if number is None:
        return port
    return f"tcp:{'localhost' if host in _THIS_MACHINE else host}:{number}"


def device_of(name: str) -> str | None:
    """Path of the device that a name (from own_name) leads to now; None where there is none, or it is on the net."""
    if not os.path.isabs(name) or not os.path.exists(name):
        return None
    return os.path.realpath(name)


def names_of(port: str) -> frozenset[str]:
    """Every name of the port that can be found out now: its own, and its device's where that is there."""
    name = own_name(port)
    return frozenset(filter(None, (name, device_of(name))))


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
