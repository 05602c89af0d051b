"""A pseudo terminal with a name of the user's choosing: the far end of a simulated serial line."""

from __future__ import annotations

import contextlib
import os
import secrets
import termios
import tty
from collections import deque
from pathlib import Path

from rw_ekf.errors import DriverError

NUMBERS_KEPT = 4
_BAUD = {
    getattr(termios, name): int(name[1:]) for name in dir(termios) if name[0] == "B" and name[1:].isdigit()
}  # by the number that termios has for it


class PtyLink:
    """A pty whose device is reachable at `link_path` (a symbolic link) until close().

    The device stays open here too, so that a client may come and go: without that the master would get an error when
    the client closes. Raises DriverError where the path cannot be used; a file of the user's is never replaced.
    """

    def __init__(self, link_path: str | Path) -> None:
        self.link_path = Path(link_path)
        _check_free(self.link_path)
        self.master = self._device = -1
        self.device_path = ""
        self._gone: deque[int] = deque()
        self.plug()

    @property
    def is_plugged(self) -> bool:
        """Whether there is a pty at present."""
        return self.master >= 0

    def plug(self) -> None:
        """Make the pty, and the link to it."""
        self.master, self._device = os.openpty()
        tty.setraw(self._device, termios.TCSANOW)
        settings = termios.tcgetattr(self._device)
        settings[4] = settings[5] = termios.B38400
        termios.tcsetattr(self._device, termios.TCSANOW, settings)
        os.set_blocking(self.master, False)
        self.device_path = os.ttyname(self._device)
        try:
            self._link()
        except OSError as error:
            self._close_files()
            raise DriverError(
                f"the link {self.link_path} cannot be made: {error.strerror}. Choose a path where you may write"
            ) from error

    def unplug(self) -> None:
        """The pty vanishes and so does the link, as an adapter's do that is pulled out. It can be plugged in again.

        Its number stays taken for a while, as that of an adapter does that somebody still holds: it comes back as
        another device.
        """
        self._gone.append(os.dup(self._device))
        while len(self._gone) > NUMBERS_KEPT:
            os.close(self._gone.popleft())
        self._unlink()
        self._close_files()

    def read(self) -> bytes:
        """What clients have written so far; no bytes where there is nothing."""
        try:
            return os.read(self.master, 4096)
        except (BlockingIOError, InterruptedError):
            return b""

    def write(self, content: bytes) -> None:
        """Send bytes; what a client that does not read leaves no room for is lost, as on a line."""
        with contextlib.suppress(BlockingIOError, InterruptedError):
            os.write(self.master, content)

    @property
    def baud(self) -> int | None:
        """The speed that a client has set on the device [baud]; None: one that termios has no name for."""
        return _BAUD.get(termios.tcgetattr(self.master)[5])

    def close(self) -> None:
        """Remove the link, if it is still ours, and close the pty. Safe to call twice."""
        self._unlink()
        self._close_files()
        while self._gone:
            os.close(self._gone.pop())

    def _unlink(self) -> None:
        """Remove the link, if it is still ours."""
        with contextlib.suppress(OSError):
            if os.readlink(self.link_path) == self.device_path:
                self.link_path.unlink()

    def _link(self) -> None:
        """Put the link in place in one step, so that no client ever sees a half-made one."""
        beside = self.link_path.with_name(f".{self.link_path.name}.{secrets.token_hex(4)}")
        os.symlink(self.device_path, beside)
        try:
            os.replace(beside, self.link_path)
        except OSError:
            beside.unlink()
            raise

    def _close_files(self) -> None:
        """Close both ends once."""
        for name in ("master", "_device"):
            descriptor = getattr(self, name)
            if descriptor >= 0:
                os.close(descriptor)
                setattr(self, name, -1)


def _check_free(path: Path) -> None:
    """Raise DriverError unless there is nothing at `path`, or a link left behind by a simulator that is gone."""
    if not path.parent.is_dir():
        raise DriverError(
            f"there is no directory {path.parent} for the link {path.name}. Make it, or choose another path"
        )
    if not os.path.lexists(path):
        return
    if not path.is_symlink():
        raise DriverError(
            f"{path} exists and is not a link of a simulated wheel. Choose another path, or remove it yourself"
        )
    target = os.readlink(path)
    if not target.startswith("/dev/"):
        raise DriverError(
            f"{path} is a link to {target}, not to a simulated wheel. Choose another path, or remove it yourself"
        )
    if os.path.exists(target):
        raise DriverError(
            f"{path} leads to {target}, which is in use: another simulated wheel may be serving it. Stop that one, "
            "choose another path, or remove the link"
        )
