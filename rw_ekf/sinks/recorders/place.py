"""HOST:PORT of the configuration as the two that a socket takes."""

from __future__ import annotations


def host_and_port(place: str) -> tuple[str, int]:
    """Take HOST:PORT apart, brackets around an address of IPv6 removed. Raises OSError for a port that is none."""
    host, _, port = place.rpartition(":")
    if int(port) > 65535:
        raise OSError(None, f"{port} is no port, the largest is 65535")
    return host.strip("[]"), int(port)
