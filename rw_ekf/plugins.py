"""What others add: wheel protocols, log formats, effects, compensations and sinks, by entry points (docs/extending.md).

What rw_ekf brings itself is registered in the same way; what installed packages register comes behind.
"""

from __future__ import annotations

import functools
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Literal

from rw_ekf.errors import ConfigError

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint

Group = Literal["rw_ekf.protocols", "rw_ekf.log_formats", "rw_ekf.effects", "rw_ekf.compensations", "rw_ekf.sinks"]


def registered(group: Group, own: Mapping[str, str]) -> dict[str, EntryPoint]:
    """Entry points of a group by name: rw_ekf's own, and those of whatever is installed beside it.

    own: name -> "module:attribute". Raises ConfigError where two have one name: nobody could say which one runs.
    """
    from importlib.metadata import EntryPoint

    found = {name: EntryPoint(name, value, group) for name, value in own.items()}
    for point in _installed(group):
        if point.name in found and found[point.name].value != point.value:
            other = _origin(found[point.name])
            raise ConfigError(
                f"{group}: {_origin(point)} registers {point.name!r}, which {other} has already: uninstall one, or "
                "give it another name in its pyproject.toml"
            )
        found.setdefault(point.name, point)
    return found


def loaded(point: EntryPoint) -> Any:
    """What an entry point names. Raises ConfigError, with whose it is, where it cannot be imported."""
    try:
        return point.load()
    except ConfigError:
        raise
    except Exception as error:
        what = f"{type(error).__name__}: {error}"
        raise ConfigError(
            f"{point.group}: {point.name!r} of {_origin(point)} ({point.value}) cannot be loaded ({what}): mend or "
            "uninstall that package"
        ) from error


def refused(point: EntryPoint, why: str) -> ConfigError:
    """The error for an entry point that is not what its group asks for."""
    return ConfigError(f"{point.group}: {point.name!r} of {_origin(point)} ({point.value}) {why}")


@functools.cache
def _installed(group: Group) -> tuple[EntryPoint, ...]:
    from importlib.metadata import entry_points

    return tuple(sorted(entry_points(group=group), key=lambda point: point.name))


def _origin(point: EntryPoint) -> str:
    return "rw_ekf" if point.dist is None else f"the package {point.dist.name} {point.dist.version}"
