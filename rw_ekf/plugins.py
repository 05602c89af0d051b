"""What others add: wheel protocols, log formats, effects, compensations and sinks, by entry points (docs/extending.md).

What rw_ekf brings itself is registered in the same way; what installed packages register comes behind.
"""

from __future__ import annotations

import functools
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any, Literal, TypeVar

from rw_ekf.errors import ConfigError

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint

Group = Literal["rw_ekf.protocols", "rw_ekf.log_formats", "rw_ekf.effects", "rw_ekf.compensations", "rw_ekf.sinks"]
Kind = TypeVar("Kind")


def registered(group: Group, own: Mapping[str, str]) -> dict[str, EntryPoint]:
    """Entry points of a group by name: rw_ekf's own, and those of whatever is installed beside it.

    own: name -> "module:attribute". Raises ConfigError as `added`.
    """
    from importlib.metadata import EntryPoint

    return {name: EntryPoint(name, value, group) for name, value in own.items()} | added(group, own)


def added(group: Group, taken: Iterable[str] = ()) -> dict[str, EntryPoint]:
    """What installed packages register in a group, by name.

    taken: names that rw_ekf has itself. Raises ConfigError for one of them, and where two packages register one name
    for different things: nobody could say which one runs.
    """
    owners = dict.fromkeys(taken, "rw_ekf")
    found: dict[str, EntryPoint] = {}
    for point in _installed(group):
        if point.name in found and found[point.name].value == point.value:
            continue
        if point.name in owners:
            both = f"{_origin(point)} registers {point.name!r}, which {owners[point.name]} has already"
            raise ConfigError(f"{group}: {both}: uninstall one, or give it another name in its pyproject.toml")
        found[point.name], owners[point.name] = point, _origin(point)
    return found


def loaded(point: EntryPoint) -> Any:
    """What an entry point names. Raises ConfigError, with whose it is, where it cannot be imported."""
    try:
        return _imported(point)
    except ConfigError:
        raise
    except Exception as error:
        what = f"{type(error).__name__}: {error}"
        raise refused(point, f"cannot be loaded ({what}): mend or uninstall that package") from error


def loaded_as(kind: type[Kind], point: EntryPoint) -> Kind:
    """The same, where it has to be of a kind. Raises ConfigError for another."""
    thing = loaded(point)
    if not isinstance(thing, kind):
        raise refused(point, f"must be a {kind.__name__} of {kind.__module__}; found {type(thing).__name__}")
    return thing


def refused(point: EntryPoint, why: str) -> ConfigError:
    """The error for an entry point that is not what its group requires."""
    return ConfigError(f"{point.group}: {point.name!r} of {_origin(point)} ({point.value}) {why}")


@functools.cache  # each log is tried with twenty-five formats
def _imported(point: EntryPoint) -> Any:
    return point.load()


@functools.cache
def _installed(group: Group) -> tuple[EntryPoint, ...]:
    from importlib.metadata import entry_points

    return tuple(sorted(entry_points(group=group), key=lambda point: point.name))


def _origin(point: EntryPoint) -> str:
    return "rw_ekf" if point.dist is None else f"the package {point.dist.name} {point.dist.version}"
