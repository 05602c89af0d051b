"""What a faulty wheel says and does: telemetry that stands still or is wild, writes refused, restarts, heat."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, NamedTuple

from rw_ekf.drivers.line.framing import Frame
from rw_ekf.drivers.line.wire_layout import Register
from rw_ekf.drivers.sim.faults import FaultInjector
from rw_ekf.units import rad_s_from_rpm

if TYPE_CHECKING:
    from rw_ekf.drivers.sim.register_server import RegisterServer


class Refusal(NamedTuple):
    """A write is answered with this status; whether it is done all the same."""

    status: int
    acts: bool


class WheelFaults:
    """The faults of the electronics of one simulated wheel."""

    def __init__(self, faults: FaultInjector) -> None:
        self._faults = faults
        self._cool_degC: float | None = None  # temperature before the heat

    def happen(self, server: RegisterServer, time_s: float) -> None:
        """Let what is due at time_s [s] happen to the wheel: restart, jump of its clock, heat."""
        now = self._faults.by_kind(time_s)
        if not now and self._cool_degC is None:
            return
        for fault in now.get("reset", ()):
            if fault.begins(time_s):
                server.restart()
        for _ in now.get("dead", ()):
            server.restart()  # as long as there is no power
        for fault in now.get("clock", ()):
            if fault.begins(time_s):
                server.jump_clock(fault.fault.time_s)
        hot = next(iter(now.get("heat", ())), None)
        plant = server.plant
        if hot is not None:
            if self._cool_degC is None:
                self._cool_degC = plant.state.temperature_degC
            plant.state = plant.state._replace(temperature_degC=hot.fault.number)
        elif self._cool_degC is not None:
            plant.state = plant.state._replace(temperature_degC=self._cool_degC)
            self._cool_degC = None

    def is_dead(self, time_s: float) -> bool:
        """Whether the wheel has no power."""
        return bool(self._faults.on("dead", time_s))

    def refusal(self, register: str, time_s: float) -> Refusal | None:
        """How a write to a register is refused, where it is."""
        for kind, acts in (("nack", False), ("nack-acted", True)):
            fault = self._faults.striking(kind, time_s, register)
            if fault is not None:
                return Refusal(fault.fault.count, acts)
        return None

    def in_force(self, current_A: float, time_s: float) -> float:
        """The current that a write of `current_A` has in force."""
        for fault in self._faults.by_kind(time_s).get("residue", ()):
            if current_A == 0.0:
                return fault.fault.number * float(fault.memory.get("last", 0.0))
            fault.memory["last"] = current_A
        return current_A

    def telemetry(self, register: Register, values: Mapping[str, float], time_s: float) -> dict[str, float]:
        """The SI values that the register reports in place of the true ones."""
        reported = dict(values)
        now = self._faults.by_kind(time_s)
        if not now:
            return reported
        for fault in now.get("flag", ()):
            if "flags" in reported and fault.strikes(time_s):
                reported["flags"] = float(int(reported["flags"]) | fault.fault.count)
        for fault in now.get("serial", ()):
            reported["serial_number"] = float(fault.fault.count)
        wild = self._faults.striking("spike", time_s, register.name) if "speed" in reported else None
        if wild is not None:
            reported["speed"] += wild.random.choice((-1.0, 1.0)) * rad_s_from_rpm(wild.fault.number)
        for fault in now.get("value", ()):
            of_this = fault.fault.register in (None, register.name) and register.field(fault.fault.name)
            if of_this and fault.strikes(time_s):
                reported[fault.fault.name] = fault.fault.number
        for fault in now.get("freeze", ()):
            if fault.fault.register in (None, register.name) and fault.strikes(time_s):
                before = fault.memory.setdefault(register.name, dict(reported))
                name = fault.fault.name
                reported |= {
                    key: old for key, old in before.items() if key == name or (name == "all" and key != "uptime")
                }
        return reported

    def reply(self, request: Frame, register: Register | None, data: bytes, time_s: float) -> Frame:
        """The frame that answers a request: seq, id and data as they should be, or as a fault makes them."""
        seq, register_id = request.seq, request.id
        if not self._faults.by_kind(time_s):
            return Frame(seq, register_id, data)
        name = register.name if register is not None else None
        if register is not None and register.access == "read":
            again = self._faults.striking("repeat", time_s, name)
            if again is not None:
                data = again.memory.setdefault(name, data)
        old = self._faults.striking("seq", time_s, name)
        if old is not None:
            seq = (seq - old.fault.count) & 0xFF
        if self._faults.striking("id", time_s, name) is not None:
            register_id = (register_id + 1) & 0xFF
        if self._faults.striking("length", time_s, name) is not None:
            data += b"\0"
        return Frame(seq, register_id, data)
