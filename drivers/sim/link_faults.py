"""Faults on the line of a simulated wheel: manipulators for a RegisterServer, for tests and demonstrations."""

from __future__ import annotations

from collections.abc import Sequence

from drivers.line.framing import Frame, decode, encode
from drivers.sim.register_server import Manipulator, RegisterServer, Reply


def healthy(server: RegisterServer, request: Frame, content: bytes) -> Sequence[Reply]:
    """What a healthy wheel sends."""
    return [Reply(content)] if content else []


def silent(server: RegisterServer, request: Frame, content: bytes) -> Sequence[Reply]:
    """Nothing at all."""
    return []


def late(by_s: float) -> Manipulator:
    """Every reply later by `by_s` [s]."""
    return lambda server, request, content: [Reply(content, by_s)] if content else []


def corrupt(byte: int = 6) -> Manipulator:
    """One bit of one byte of every reply is wrong."""

    def manipulate(server: RegisterServer, request: Frame, content: bytes) -> Sequence[Reply]:
        if not content:
            return []
        index = byte % len(content)
        return [Reply(content[:index] + bytes((content[index] ^ 0x10,)) + content[index + 1 :])]

    return manipulate


def wrong_seq(behind: int = 1) -> Manipulator:
    """Every reply bears the seq of `behind` requests ago, with a good CRC."""

    def manipulate(server: RegisterServer, request: Frame, content: bytes) -> Sequence[Reply]:
        framing = server.wire_map.framing
        return [
            Reply(encode(frame.seq - behind, frame.id, frame.data, framing))
            for frame in decode(content, framing).frames
        ]

    return manipulate


def babble(noise: bytes) -> Manipulator:
    """Noise in front of and behind every reply."""
    return lambda server, request, content: [Reply(noise + content + noise)]


def cut(byte_count: int) -> Manipulator:
    """Only the first bytes of every reply."""
    return lambda server, request, content: [Reply(content[:byte_count])]


def every(nth: int, fault: Manipulator) -> Manipulator:
    """The fault on every nth reply only."""
    count = 0

    def manipulate(server: RegisterServer, request: Frame, content: bytes) -> Sequence[Reply]:
        nonlocal count
        count += 1
        return (fault if count % nth == 0 else healthy)(server, request, content)

    return manipulate
