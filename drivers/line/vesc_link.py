"""A line to a VESC: nothing answers a command, so the current that flows behind it says whether it was taken.

A VESC tells the mean current since it was asked last. So the first reading behind a command may hold some of the one
before it: it can bear the command out, and does not count against it.
"""

from __future__ import annotations

from typing import Any

from rw_ekf.drivers.line.bearing_out import Bearing, Standing
from rw_ekf.drivers.line.line import Exchange
from rw_ekf.drivers.line.registers import decode_register
from rw_ekf.drivers.line.serial_link import SerialLink
from rw_ekf.drivers.line.vesc import FIRST_READ
from rw_ekf.drivers.line.vesc_map import VescMap
from rw_ekf.drivers.line.wire_map import STATUS_OK

_REPLIES = 2  # each of which may take its time: as a write and its reading back of another wheel


class VescLink(SerialLink):
    """An open line to a wheel of such a map."""

    def __init__(self, settings: Any, wire_map: VescMap, *more: Any) -> None:
        self._map = wire_map
        self._sent_A = 0.0  # the last that was commanded
        self._standing = Standing()
        super().__init__(settings, wire_map.codec(), *more)

    def request(self, register_id: int, data: bytes, reply_bytes: int, timeout_s: float | None = None) -> Exchange:
        """As `SerialLink.request`; a command is acknowledged when the current behind it is the one commanded."""
        if register_id >= FIRST_READ:
            return super().request(register_id, data, reply_bytes, timeout_s)
        command = self._map.current_command
        wanted_A = decode_register(command, data)["current_command"] if register_id == command.id else 0.0
        limit_s = _REPLIES * self.reply_timeout_s if timeout_s is None else timeout_s
        exchange = self._confirmed(self.codec.request(0, register_id, data), wanted_A, limit_s)
        self._sent_A = wanted_A
        return exchange

    def _confirmed(self, frame: bytes, wanted_A: float, limit_s: float) -> Exchange:
        """Send a command and ask for the current; taken where it is this one, refused where several are another."""
        sent = self._tell(frame)
        until_s = sent.received_by_wheel_s + limit_s
        bearing, told_A = Bearing(wanted_A, self._sent_A, self._map.command.tolerance), self._told_A(sent, until_s)
        if told_A is not None and abs(told_A - wanted_A) > self._map.command.tolerance:
            told_A = self._told_A(sent, until_s)
        while told_A is not None:
            if bearing.is_borne_out(told_A):
                self._standing.note_taken()
                return sent._replace(data=bytes((STATUS_OK,)), replied_s=self._came_s)
            if bearing.is_refused:
                break
            if bearing.is_due_again:
                sent = self._tell(frame)
            told_A = self._told_A(sent, until_s)
        if bearing.status is None:
            return sent._replace(data=None)
        self.news = self._standing.note_against(self._clock.monotonic()) or self.news
        return sent._replace(data=bytes((bearing.status,)), replied_s=self._clock.monotonic())

    def _told_A(self, sent: Exchange, until_s: float) -> float | None:
        """The current that is told; None where nothing was sent, or no reply comes until a time [s]."""
        register, left_s = self._map.speed_register, until_s - self._clock.monotonic()
        if sent.data is None or left_s <= 0.0:
            return None
        data = super().request(register.id, b"", register.size, left_s).data
        return None if data is None else decode_register(register, data)["current"]
