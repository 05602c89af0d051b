"""What can go wrong for reasons outside the code. Each message says what was found, where, and what to do.

RwEkfError              exit status 1: the work failed
├── BadInputError       exit status 2: a file, key, value or option that the user can mend
│   ├── UsageError      a command line that is none
│   ├── ConfigError     a configuration, wire map, model or column map (file:line:column: message; one line per finding)
│   │   └── NotInstalledError   what a file requires is there, but not what reads it
│   └── LogError        a log that cannot be read or used (EmptyLogError: because there is no row in it)
├── PictureError        a picture that matplotlib cannot draw; what it shows is there without it
├── DriverError         the wheel's link: cannot be opened, lost, answers garbage
│   └── NotStartedError     its boot loader answers, and nobody has allowed the write that starts its program
└── FilterError         the filter was given something that is not a number, or its covariance broke
EndOfRecord             not an error: a replayed record has no more samples

`kind` identifies them to a program (docs/contract.md#error).
"""

from __future__ import annotations


class RwEkfError(Exception):
    """The root: a message for the user, never a traceback."""

    exit_status = 1
    kind = "work"


class BadInputError(RwEkfError):
    """Something the user gave is wrong and can be mended by the user."""

    exit_status = 2
    kind = "input"


class UsageError(BadInputError):
    """The command line is not one of this program."""

    kind = "usage"


class ConfigError(BadInputError):
    """A YAML file is not what it must be; `findings` holds one line for each thing found."""

    kind = "file"

    def __init__(self, findings: list[str] | str) -> None:
        self.findings = [findings] if isinstance(findings, str) else list(findings)
        super().__init__("\n".join(self.findings))

    def __reduce__(self) -> tuple[type[ConfigError], tuple[list[str]]]:
        """From another process it comes with each finding by itself."""
        return type(self), (self.findings,)


class NotInstalledError(ConfigError):
    """A file requires what a package that is not installed does."""


class LogError(BadInputError):
    """A log cannot be read, or does not hold what it must."""

    kind = "log"


class EmptyLogError(LogError):
    """A log holds no row: there is nothing in it, and nothing wrong with it."""


class PictureError(RwEkfError):
    """A picture could not be drawn."""

    kind = "picture"


class DriverError(RwEkfError):
    """The link to the wheel failed."""

    kind = "driver"


class NotStartedError(DriverError):
    """A wheel's boot loader answers; what starts its program is a write that was not allowed."""


class FilterError(RwEkfError):
    """The filter refuses to continue: a non-finite number or a covariance that is not one."""

    kind = "filter"


class EndOfRecord(Exception):  # noqa: N818 - an outcome, not an error
    """A replayed record has been read to its end."""


def reason_of(error: Exception) -> str:
    """Why the system refused something, in its own words; of any other error what it says."""
    return error.strerror if isinstance(error, OSError) and error.strerror else str(error)
