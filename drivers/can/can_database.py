"""The messages of a CAN map as cantools has them: of a DBC file beside the map, or of the map itself."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from rw_ekf.checking.findings import Where
from rw_ekf.errors import ConfigError, NotInstalledError

if TYPE_CHECKING:
    from rw_ekf.drivers.can.can_file import CanFile, CanMessage

_UNITS = {"°C": "degC", "C": "degC", "deg C": "degC", "1/min": "rpm", "Nm": "N m", "mNm": "mN m", "": "none"}
_MOST_BYTES = 16_000_000


def database_of(file: CanFile, where: Where) -> Any:
    """The cantools database. Raises NotInstalledError without cantools, ConfigError for a wrong DBC or messages."""
    try:
        import cantools.database as of_cantools
    except ImportError as error:
        package = (error.name or str(error)).partition(".")[0]
        raise NotInstalledError(
            f"{where(('family',))}: what reads a map of the family can is not installed ({package}): "
            'pip install "rw-ekf[can]"'
        ) from None
    if file.dbc is not None:
        return _of_dbc(of_cantools, folder_of(where) / file.dbc, where)
    messages, findings = [], []
    for index, message in enumerate(file.messages):
        try:
            messages.append(_message(of_cantools, message))
        except of_cantools.Error as error:
            findings.append(f"{where(('messages', index))}: messages.{index} ({message.name}): {error}")
    for key in ("name", "id"):
        seen: set[Any] = set()
        for index, message in enumerate(file.messages):
            value = (message.id, message.extended) if key == "id" else message.name
            if value in seen:
                findings.append(f"{where(('messages', index, key))}: messages.{index}.{key} is already used above")
            seen.add(value)
    if findings:
        raise ConfigError(findings)
    return of_cantools.Database(messages)


def folder_of(where: Where) -> Path:
    """Where the map stands; its DBC counts from there."""
    return Path(where(()).rsplit(":", 2)[0]).parent


def unit_of(signal: Any) -> str:
    """The unit of a signal, in the words of a map where they are known."""
    text = signal.unit or ""
    return _UNITS.get(text.strip(), text)


def _of_dbc(of_cantools: Any, path: Path, where: Where) -> Any:
    at = where(("dbc",))
    try:
        if path.stat().st_size > _MOST_BYTES:
            raise ConfigError(f"{at}: dbc: {path} is larger than any database of messages ({_MOST_BYTES} bytes)")
        content = path.read_bytes()
    except (OSError, ValueError) as error:
        stated = getattr(error, "strerror", None) or error
        raise ConfigError(
            f"{at}: dbc: {path} cannot be read ({stated}); its name counts from the map's folder"
        ) from None
    try:
        return of_cantools.load_string(content.decode("cp1252", errors="replace"), "dbc")
    except Exception as error:  # noqa: BLE001 - a parser's own kinds, and what a wrong file makes it stumble over
        raise ConfigError(f"{path}: is no DBC file that could be read: {error}") from None


def _message(of_cantools: Any, message: CanMessage) -> Any:
    from cantools.database.conversion import BaseConversion

    signals = [
        of_cantools.Signal(
            signal.name,
            signal.start,
            signal.length,
            byte_order=f"{signal.byte_order}_endian",
            is_signed=signal.type == "signed",
            conversion=BaseConversion.factory(signal.scale, signal.offset, None, signal.type == "float"),
            unit=signal.unit,
        )
        for signal in message.signals
    ]
    return of_cantools.Message(
        message.id, message.name, message.length, signals, is_extended_frame=message.extended, strict=True
    )
