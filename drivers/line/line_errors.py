"""What can be wrong with a serial line, in one sentence each: what was found, and what to do."""

from __future__ import annotations

import errno
import os
import shlex
from pathlib import Path

from rw_ekf.drivers.line.echo import EchoError
from rw_ekf.errors import DriverError

try:
    from termios import error as termios_error
except ImportError:  # not a POSIX system: pyserial raises nothing else there
    termios_error = OSError  # type: ignore[assignment,misc]

# Everything pyserial lets through: its own exceptions are OSErrors, a closed port gives TypeError, AttributeError or
# ValueError (file descriptor None or -1), line settings a port refuses give termios.error or NotImplementedError.
LINE_EXCEPTIONS = (OSError, termios_error, TypeError, AttributeError, ValueError, NotImplementedError)

_SIMULATED = "/tmp/wheel0"  # where `rw-ekf simulate` puts its wheel unless given another path
_HINT_SIMULATE = f"or try the simulated wheel at {_SIMULATED}: rw-ekf simulate"


def open_error(port: str, error: BaseException, parity: str) -> DriverError:
    """The DriverError for a port that could not be opened."""
    number, text = error_number(error), str(error)
    if isinstance(error, termios_error) and not isinstance(error, OSError):
        return DriverError(
            f"{port} refuses its line settings (parity {parity}): {text}. A pseudo terminal takes parity none only; "
            "set link.parity in the wire map"
        )
    if "exclusively lock" in text or number in (errno.EBUSY, errno.EAGAIN):
        return DriverError(
            f"{port} is in use by another process. Stop that one (rw-ekf stop --config F if it is a daemon of yours)"
        )
    if number == errno.ENOENT:
        return DriverError(
            f"there is no port {port}. Check the name and the cable (ls /dev/ttyUSB* /dev/ttyS*), {_hint_at(port)}"
        )
    if number in (errno.EACCES, errno.EPERM):
        return DriverError(
            f"no permission to open {port}. Join its group: sudo usermod -aG dialout $USER, then log in again"
        )
    if number == errno.ENOTTY:
        return DriverError(f"{port} is not a serial port. Check the name, {_HINT_SIMULATE}")
    if "://" in port:
        return DriverError(
            f"{port} could not be opened: {text}. Check that the server runs; behind rfc2217:// a pseudo terminal or a "
            "simple server needs ?ign_set_control at the end of the port"
        )
    return DriverError(f"{port} could not be opened: {text}. Check the name and the cable, {_HINT_SIMULATE}")


def _link_for(port: str) -> str:
    """Where `rw-ekf simulate --link` can put a wheel: at the port itself, if that is no device's and no address."""
    is_path = ":" not in port and not Path(port).absolute().is_relative_to("/dev")
    return shlex.quote(os.path.abspath(port)) if is_path else _SIMULATED


def _hint_at(port: str) -> str:
    """The command that puts a simulated wheel at a port that is not there, or at the usual place."""
    link = _link_for(port)
    return _HINT_SIMULATE if link == _SIMULATED else f"or try a simulated wheel there: rw-ekf simulate --link {link}"


def lost_error(port: str, error: BaseException) -> DriverError:
    """The DriverError for a port that failed while in use."""
    if isinstance(error, EchoError):
        return DriverError(f"{port}: {error}")
    return DriverError(
        f"{port} failed: {error}. The adapter was unplugged or the far end is gone, or a second process reads "
        "the same port; check both"
    )


def silent_error(port: str, baud: int, waited_s: float, received: int, good: int = 0, hint: str = "") -> DriverError:
    """The DriverError for a port that opened but where no wheel speaks. hint: a sentence on what came instead."""
    stated = f" {hint}." if hint else ""
    return DriverError(
        f"{port} opened but no valid frame in {waited_s:.1f} s ({received} bytes, {good} good CRC).{stated} "
        f"Check baud ({baud}), wiring and wheel power, {_HINT_SIMULATE}"
    )


def error_number(error: BaseException) -> int | None:
    """The errno of an exception; pyserial keeps it where OSError has it, else in the exception it hid."""
    if isinstance(error, OSError) and isinstance(error.errno, int):
        return error.errno
    for inner in (error.__cause__, error.__context__):
        if isinstance(inner, OSError) and isinstance(inner.errno, int):
            return inner.errno
    return None
