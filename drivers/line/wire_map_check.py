"""Checks of a wire map, all findings at once: each says where, what was found, and what is expected."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from drivers.line.framing import CRCS
from drivers.line.wire_layout import QUANTITIES, TYPES, UNITS, Field, Framing, LineSettings, Register
from drivers.line.wire_map import STATUS_OK, WireMap

if TYPE_CHECKING:
    from drivers.line.wire_map import Where

Path = tuple[str | int, ...]
NAME = re.compile(r"[a-z][a-z0-9_]*\Z")
TOP_KEYS = ("name", "framing", "link", "ids", "statuses", "registers")
DEFAULT_STATUSES = {0: "ok", 1: "unknown_id", 2: "wrong_length", 3: "out_of_range", 4: "refused_in_this_mode"}


class MapReader:
    """Reads one map; `findings` collects what is wrong. A method that found something returns None or a default."""

    def __init__(self, where: Where) -> None:
        self.where = where
        self.findings: list[str] = []

    def wire_map(self, data: object) -> WireMap | None:
        """The whole map, or None when there were findings."""
        top = self.mapping(data, (), TOP_KEYS, required=("registers",))
        if top is None:
            return None
        framing = self.framing(top.get("framing", {}))
        byte_order = self.byte_order(top.get("framing", {}))
        line = self.line(top.get("link", {}))
        write_ids, read_ids = self.ids(top.get("ids", {}))
        statuses = self.statuses(top.get("statuses", DEFAULT_STATUSES))
        registers = self.registers(top["registers"], byte_order, write_ids, read_ids) if "registers" in top else ()
        name = top.get("name", "wheel")
        if not isinstance(name, str) or not name:
            self.found(("name",), f"name must be a word, not {name!r}")
        if self.findings:
            return None
        return WireMap(str(name), registers, framing, line, statuses, write_ids, read_ids)

    # --- the parts of a map -------------------------------------------------------------------------------------

    def framing(self, data: object) -> Framing:
        """The framing bytes and the checksum."""
        default = Framing()
        section = self.mapping(data, ("framing",), ("escape", "start", "end", "crc", "byte_order"))
        if section is None:
            return default
        marks = {
            key: self.integer(section.get(key, getattr(default, key)), ("framing", key), 0, 255)
            for key in ("escape", "start", "end")
        }
        if len(set(marks.values())) < 3:
            self.found(("framing",), "escape, start and end must be three different bytes")
        crc = self.choice(section.get("crc", default.crc), ("framing", "crc"), tuple(CRCS))
        return Framing(marks["escape"], marks["start"], marks["end"], crc)

    def byte_order(self, data: object) -> str:
        """Byte order of the values in the data."""
        order = data.get("byte_order", "little") if isinstance(data, Mapping) else "little"
        return self.choice(order, ("framing", "byte_order"), ("little", "big"))

    def line(self, data: object) -> LineSettings:
        """Baud rate and the like."""
        default = LineSettings()
        section = self.mapping(data, ("link",), ("baud", "data_bits", "parity", "stop_bits", "reply_timeout_ms"))
        if section is None:
            return default
        return LineSettings(
            self.integer(section.get("baud", default.baud), ("link", "baud"), 50, 4_000_000),
            self.integer(section.get("data_bits", default.data_bits), ("link", "data_bits"), 8, 8),
            self.choice(section.get("parity", default.parity), ("link", "parity"), ("none", "even", "odd")),
            self.integer(section.get("stop_bits", default.stop_bits), ("link", "stop_bits"), 1, 2),
            self.number(section.get("reply_timeout_ms", 40.0), ("link", "reply_timeout_ms"), 1.0, 60_000.0) / 1000.0,
        )

    def ids(self, data: object) -> tuple[tuple[int, int], tuple[int, int]]:
        """The id ranges that write and that read, both ends included."""
        section = self.mapping(data, ("ids",), ("write", "read")) or {}
        write = self.id_range(section.get("write", [0, 127]), ("ids", "write"), (0, 127))
        read = self.id_range(section.get("read", [128, 255]), ("ids", "read"), (128, 255))
        if max(write[0], read[0]) <= min(write[1], read[1]):
            self.found(
                ("ids",), f"the ranges write {list(write)} and read {list(read)} overlap; an id either writes or reads"
            )
        return write, read

    def id_range(self, data: object, path: Path, default: tuple[int, int]) -> tuple[int, int]:
        """A pair [first, last] of ids."""
        if not isinstance(data, Sequence) or isinstance(data, str) or len(data) != 2:
            self.found(path, f"expected [first id, last id], not {data!r}")
            return default
        first, last = (self.integer(data[i], (*path, i), 0, 255) for i in (0, 1))
        if first > last:
            self.found(path, f"first id {first} is above last id {last}")
        return first, last

    def statuses(self, data: object) -> Mapping[int, str]:
        """Names of the status byte that answers a write."""
        if not isinstance(data, Mapping):
            self.found(("statuses",), f"expected status number: name pairs, not {data!r}")
            return DEFAULT_STATUSES
        for status, name in data.items():
            if not isinstance(status, int) or isinstance(status, bool) or not 0 <= status <= 255:
                self.found(("statuses", status), f"a status is a number from 0 to 255, not {status!r}")
            elif not isinstance(name, str) or not NAME.match(name):
                self.found(("statuses", status), f"status {status} needs a name like out_of_range, not {name!r}")
        if data.get(STATUS_OK) != "ok":
            self.found(("statuses",), "status 0 must be named ok: it is what a wheel answers when it accepted a write")
        return dict(data)

    def registers(
        self, data: object, byte_order: str, write_ids: tuple[int, int], read_ids: tuple[int, int]
    ) -> tuple[Register, ...]:
        """All registers, each checked alone and against the others."""
        if not isinstance(data, Sequence) or isinstance(data, str):
            self.found(("registers",), f"expected a list of registers, not {data!r}")
            return ()
        registers: list[Register] = []
        for index, entry in enumerate(data):
            register = self.register(entry, ("registers", index), byte_order)
            if register is None:
                continue
            low, high = write_ids if register.access == "write" else read_ids
            if not low <= register.id <= high:
                self.found(
                    ("registers", index, "id"),
                    f"register {register.name} has access {register.access} but id {register.id}; "
                    f"ids that {register.access} are {low} to {high} (see ids)",
                )
            for key in ("id", "name"):
                value = getattr(register, key)
                if any(getattr(other, key) == value for other in registers):
                    self.found(("registers", index, key), f"{key} {value} is already used by a register above")
            registers.append(register)
        self.needed(registers)
        return tuple(registers)

    def register(self, data: object, path: Path, byte_order: str) -> Register | None:
        """One register."""
        known = ("id", "name", "access", "fields")
        entry = self.mapping(data, path, known, required=known)
        if entry is None or any(key not in entry for key in known):
            return None
        before = len(self.findings)
        register_id = self.integer(entry["id"], (*path, "id"), 0, 255)
        name = self.word(entry["name"], (*path, "name"))
        access = self.choice(entry["access"], (*path, "access"), ("read", "write"))
        fields = self.fields(entry["fields"], (*path, "fields"))
        if len(self.findings) > before:
            return None
        return Register(register_id, name, access, fields, byte_order)

    def fields(self, data: object, path: Path) -> tuple[Field, ...]:
        """The fields of one register, in the order of their bytes."""
        if not isinstance(data, Sequence) or isinstance(data, str) or not data:
            self.found(path, f"expected a list with at least one field, not {data!r}")
            return ()
        fields: list[Field] = []
        for index, entry in enumerate(data):
            field = self.field(entry, (*path, index))
            if field is None:
                continue
            if any(other.name == field.name for other in fields):
                self.found((*path, index, "name"), f"field {field.name} stands twice in this register")
            fields.append(field)
        return tuple(fields)

    def field(self, data: object, path: Path) -> Field | None:
        """One field; a name the program knows must come in a unit of its quantity."""
        known = ("name", "type", "unit", "scale", "offset", "constant")
        entry = self.mapping(data, path, known, required=("name", "type"))
        if entry is None or "name" not in entry or "type" not in entry:
            return None
        before = len(self.findings)
        name = self.word(entry["name"], (*path, "name"))
        kind = self.choice(entry["type"], (*path, "type"), tuple(TYPES))
        unit = self.choice(entry.get("unit", "none"), (*path, "unit"), tuple(UNITS))
        scale = self.number(entry.get("scale", 1.0), (*path, "scale"))
        offset = self.number(entry.get("offset", 0.0), (*path, "offset"))
        constant = self.number(entry["constant"], (*path, "constant")) if "constant" in entry else None
        if scale == 0.0:
            self.found((*path, "scale"), "scale must not be 0: the value could not be written")
        if len(self.findings) > before:
            return None
        wanted = QUANTITIES.get(name)
        if wanted is not None and UNITS[unit][0] != wanted:
            units = ", ".join(u for u, (quantity, _) in UNITS.items() if quantity == wanted)
            self.found(
                (*path, "unit" if "unit" in entry else "name"), f"{name} in {unit}; its unit must be one of {units}"
            )
        if constant is not None and not TYPES[kind][1] <= constant <= TYPES[kind][2]:
            self.found((*path, "constant"), f"constant {constant:g} does not fit into {kind}")
        return Field(name, kind, unit, scale, offset, constant)

    def needed(self, registers: Sequence[Register]) -> None:
        """What no map may lack: a speed to read and a current to write."""
        if not any(register.access == "read" and register.field("speed") for register in registers):
            self.found(
                ("registers",),
                "no register with access read has a field named speed; the speed is what is estimated from",
            )
        writers = [register for register in registers if register.name == "current_command"]
        if not any(register.access == "write" for register in writers):
            self.found(
                ("registers",), "no register named current_command with access write; without it no wheel can be driven"
            )
        elif [field.name for field in writers[0].fields] != ["current_command"]:
            self.found(("registers",), "register current_command must have exactly one field, named current_command")

    # --- the values of a map ------------------------------------------------------------------------------------

    def found(self, path: Path, message: str) -> None:
        """Note a finding."""
        self.findings.append(f"{self.where(path)}: {message}")

    def mapping(
        self, data: object, path: Path, known: Sequence[str], required: Sequence[str] = ()
    ) -> Mapping[str, object] | None:
        """A mapping with no key but the known ones."""
        name = ".".join(str(part) for part in path) or "a wire map"
        if not isinstance(data, Mapping):
            self.found(path, f"{name} must be a mapping with the keys {', '.join(known)}, not {data!r}")
            return None
        for key in data:
            if key not in known:
                self.found((*path, key), f"unknown key {key!r}; known here: {', '.join(known)}")
        for key in required:
            if key not in data:
                self.found(path, f"{name} lacks the key {key}")
        return data

    def word(self, value: object, path: Path) -> str:
        """A name in small letters."""
        if not isinstance(value, str) or not NAME.match(value):
            self.found(path, f"expected a name in small letters, digits and _, not {value!r}")
            return ""
        return value

    def choice(self, value: object, path: Path, choices: Sequence[str]) -> str:
        """One of some words."""
        if not isinstance(value, str) or value not in choices:
            self.found(path, f"unknown {path[-1]} {value!r}; one of {', '.join(choices)}")
            return choices[0]
        return value

    def integer(self, value: object, path: Path, low: int, high: int) -> int:
        """A whole number in a range."""
        if not isinstance(value, int) or isinstance(value, bool) or not low <= value <= high:
            self.found(path, f"{path[-1]} must be a whole number from {low} to {high}, not {value!r}")
            return low
        return value

    def number(self, value: object, path: Path, low: float = -math.inf, high: float = math.inf) -> float:
        """A finite number in a range."""
        if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
            self.found(path, f"{path[-1]} must be a finite number, not {value!r}")
            return 1.0
        if not low <= value <= high:
            self.found(path, f"{path[-1]} must lie between {low:g} and {high:g}, not {value!r}")
        return float(value)
