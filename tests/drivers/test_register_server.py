"""The simulated wheel's electronics: every status, mode and silence of the protocol, from bytes to bytes."""

from __future__ import annotations

import pytest

from rw_ekf.drivers.line.framing import decode, encode
from rw_ekf.drivers.line.registers import decode_register, encode_register
from rw_ekf.drivers.line.wire_map import WireMap
from rw_ekf.drivers.sim.plant_parameters import PlantNoise, PlantParameters, PlantState
from rw_ekf.drivers.sim.plant_runner import PlantRunner
from rw_ekf.drivers.sim.register_server import (
    CURRENT,
    FLAG_FAULT,
    FLAG_LIMITED,
    FLAG_OVER_TEMPERATURE,
    FLAG_RESET,
    IDLE,
    OK,
    OUT_OF_RANGE,
    REFUSED,
    SPEED,
    UNKNOWN_ID,
    WRONG_LENGTH,
    RegisterServer,
)


class Wheel:
    """A server with its map, asked by register name."""

    def __init__(self, wire_map: WireMap, state: PlantState | None = None, max_current_A: float = 1.0) -> None:
        self.map = wire_map
        self.plant = PlantRunner(PlantParameters(), PlantNoise(0.0), 1, state)
        self.server = RegisterServer(wire_map, self.plant, max_current_A=max_current_A)

    def raw(self, register_id: int, data: bytes = b"") -> bytes | None:
        """Data of the reply, None where there is none."""
        replies = self.server.handle(encode(9, register_id, data), self.plant.time_s)
        if not replies:
            return None
        (frame,) = decode(replies[0].content).frames
        assert (frame.seq, frame.id) == (9, register_id)
        return frame.data

    def write(self, name: str, value: float = 0.0) -> int:
        """Status of a write."""
        register = self.map.register(name)
        assert register is not None
        reply = self.raw(register.id, encode_register(register, {name: value}))
        assert reply is not None
        return reply[0]

    def ask(self, name: str) -> dict[str, float]:
        """Values of a read."""
        register = self.map.register(name)
        assert register is not None
        reply = self.raw(register.id)
        assert reply is not None
        return decode_register(register, reply)


@pytest.fixture
def wheel(wire_map: WireMap) -> Wheel:
    """A wheel at 50 rad/s."""
    return Wheel(wire_map, PlantState(speed_rad_s=50.0))


def test_statuses_are_those_of_the_contract(wheel: Wheel) -> None:
    """0 ok, 1 unknown id, 2 wrong length, 3 out of range, 4 refused in this mode."""
    assert wheel.write("current_command", 0.1) == OK
    assert wheel.raw(99, b"\x00") == bytes((UNKNOWN_ID,))
    assert wheel.raw(3, b"\x00") == bytes((WRONG_LENGTH,))
    assert wheel.write("current_command", 1.1) == OUT_OF_RANGE
    assert wheel.write("mode", 3) == OUT_OF_RANGE
    assert wheel.raw(1, b"\x54") == bytes((OUT_OF_RANGE,))
    wheel.server.fault = True
    assert wheel.write("speed_reference", 10.0) == REFUSED
    assert wheel.write("current_command", 0.1) == REFUSED
    assert wheel.write("current_command", 0.0) == OK


def test_what_gets_no_reply(wheel: Wheel) -> None:
    """An unknown read, a read with data, and a damaged frame are met with silence; the next good one is answered."""
    assert wheel.raw(200) is None
    assert wheel.raw(133, b"\x00") is None
    assert wheel.server.handle(encode(1, 133)[:-3] + b"\x00\x1f\xff", 0.0) == []
    assert wheel.server.damaged == 1
    assert wheel.raw(133) is not None


def test_a_frame_may_come_in_pieces(wheel: Wheel) -> None:
    """Bytes arrive as the line brings them."""
    request = encode(1, 133)
    replies = [reply for i in range(len(request)) for reply in wheel.server.handle(request[i : i + 1], 0.01 * i)]
    assert len(replies) == 1


def test_modes(wheel: Wheel) -> None:
    """It starts idle; a current enters current mode, a reference speed mode; changes take the current off."""
    assert wheel.ask("status")["mode"] == IDLE
    wheel.write("current_command", 0.2)
    assert wheel.ask("status")["mode"] == CURRENT
    assert wheel.ask("current")["current"] == pytest.approx(0.2)
    wheel.write("mode", IDLE)
    assert wheel.ask("current")["current"] == 0.0
    wheel.write("speed_reference", 60.0)
    assert wheel.ask("status")["mode"] == SPEED
    wheel.write("mode", CURRENT)
    assert wheel.ask("cycle")["current_command"] == 0.0


def test_the_last_current_is_held_for_ever(wheel: Wheel) -> None:
    """Nothing stops the wheel but a command: after ten minutes of silence the current still acts."""
    wheel.write("current_command", 0.06)
    wheel.server.advance_to(600.0)
    cycle = wheel.ask("cycle")
    assert cycle["current"] == pytest.approx(0.06)
    assert cycle["speed"] > 70.0
    assert cycle["uptime"] == pytest.approx(600.0)


def test_speed_mode_holds_a_speed(wheel: Wheel) -> None:
    """The loop inside the wheel reaches its reference and limits its current on the way, with the flag that says so."""
    wheel.write("speed_reference", 80.0)
    wheel.server.advance_to(0.5)
    assert int(wheel.ask("status")["flags"]) & FLAG_LIMITED
    wheel.server.advance_to(60.0)
    assert wheel.ask("speed")["speed"] == pytest.approx(80.0, abs=0.1)
    assert not int(wheel.ask("status")["flags"]) & FLAG_LIMITED


def test_reset_and_its_flag(wheel: Wheel) -> None:
    """A reset takes the current off, starts the uptime anew and raises a flag that one read clears."""
    assert int(wheel.ask("status")["flags"]) == FLAG_RESET
    assert int(wheel.ask("status")["flags"]) == 0
    wheel.write("current_command", 0.2)
    wheel.server.advance_to(5.0)
    assert wheel.write("reset") == OK
    assert int(wheel.ask("status")["flags"]) == FLAG_RESET
    assert wheel.ask("identity")["uptime"] == 0.0
    assert wheel.ask("current")["current"] == 0.0
    wheel.server.advance_to(5.25)
    assert wheel.ask("cycle")["uptime"] == pytest.approx(0.25)


def test_fault_and_heat_are_flagged(wire_map: WireMap) -> None:
    """Flags 1 and 4 show a fault and a temperature beyond the limit."""
    wheel = Wheel(wire_map, PlantState(temperature_degC=80.0))
    wheel.server.fault = True
    assert int(wheel.ask("status")["flags"]) == FLAG_FAULT | FLAG_OVER_TEMPERATURE | FLAG_RESET


def test_identity(wheel: Wheel) -> None:
    """Type 6, version 1, the serial number it was given."""
    identity = wheel.ask("identity")
    assert (identity["type"], identity["version"], identity["serial_number"]) == (6, 1, 1)
