"""Count what becomes of many bytes in the deframer: noise, torn and wrong frames, and good ones in between.

    python -m tools.fuzz.deframer [--bytes 10000000] [--seed 0]

Checked all the while: nothing raises; what is kept never exceeds one frame; cut anywhere, the bytes give the same
frames, the same count of damaged ones and the same rest; a good frame comes out whatever stood before it, unless noise
that passes the checksum by chance (one in 65536) has swallowed it. Exit status 1 where one of these does not hold.
"""

from __future__ import annotations

import argparse
import random
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass

from rw_ekf.drivers.line.framing import MAX_DATA_BYTES, Frame, decode, encode

LONGEST_REST = 2 + 2 * (MAX_DATA_BYTES + 4) + 2
STRETCH_BYTES = 20_000  # compared whole and in pieces
MEANINGFUL = (b"\x1f", b"\x7f", b"\xff", b"\x1f\x7f", b"\x1f\xff", b"\x1f\x1f", b"\x00")


@dataclass
class Count:
    """What went in and what came out."""

    bytes: int = 0
    pieces: int = 0
    sent: int = 0
    received: int = 0  # of those sent
    by_chance: int = 0  # frames that nobody sent
    damaged: int = 0
    longest_rest: int = 0


def stretch(chance: random.Random, count: Count) -> tuple[bytes, list[Frame]]:
    """Some bytes, and the good frames in them."""
    line, sent = bytearray(), []
    kinds: tuple[Callable[[], bytes], ...] = (
        lambda: chance.randbytes(chance.randrange(200)),
        lambda: b"".join(chance.choices(MEANINGFUL, k=chance.randrange(60))),
        lambda: b"\x1f\x7f" + bytes(chance.randrange(1500)),
        lambda: _torn(chance),
        lambda: _wrong(chance),
    )
    while len(line) < STRETCH_BYTES:
        line += chance.choice(kinds)()
        if chance.random() < 0.5:
            sent.append(_frame(chance))
            line += encode(*sent[-1])
    count.sent += len(sent)
    return bytes(line), sent


def check(line: bytes, sent: list[Frame], chance: random.Random, count: Count) -> None:
    """Run bytes through whole and in pieces. Raises AssertionError where an invariant does not hold."""
    whole = decode(line)
    received: list[Frame] = []
    rest, damaged, position = b"", 0, 0
    longest = chance.choice((1, 8, 64, 1024))
    while position < len(line):
        size = chance.randint(1, longest)
        piece = decode(rest + line[position : position + size])
        received += piece.frames
        damaged += piece.damaged
        rest = piece.rest
        count.pieces += 1
        count.longest_rest = max(count.longest_rest, len(rest))
        assert len(rest) <= LONGEST_REST, f"{len(rest)} bytes kept"
        position += size
    assert (tuple(received), damaged, rest) == (whole.frames, whole.damaged, whole.rest), "it matters where it is cut"
    at = missing = 0
    for frame in sent:
        try:
            at = received.index(frame, at) + 1
        except ValueError:
            missing += 1
    found = len(sent) - missing
    assert missing <= len(received) - found, f"{missing} good frames lost, and nothing swallowed them"
    count.bytes += len(line)
    count.received += found
    count.by_chance += len(received) - found
    count.damaged += damaged


def run(total_bytes: int, seed: int, clock: Callable[[], float] = time.process_time) -> tuple[Count, float]:
    """Fuzz with so many bytes; what was counted, and the processor time [s]. Raises AssertionError."""
    count, chance, began = Count(), random.Random(seed), clock()
    while count.bytes < total_bytes:
        check(*stretch(chance, count), chance, count)
    return count, clock() - began


def main() -> int:
    """Print the counts."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--bytes", type=int, default=10_000_000, help="default 10000000")
    parser.add_argument("--seed", type=int, default=0, help="default 0")
    args = parser.parse_args()
    try:
        count, took_s = run(args.bytes, args.seed)
    except AssertionError as error:
        print(f"does not hold: {error}")
        return 1
    print(f"bytes            {count.bytes}, in {count.pieces} pieces, seed {args.seed}")
    print(f"good frames      {count.received} of {count.sent} came out ({count.received / count.sent:.6f})")
    print(f"by chance        {count.by_chance} frames that nobody sent")
    print(f"damaged          {count.damaged} counted ({count.damaged / count.bytes * 1e3:.2f} per 1000 bytes)")
    print(f"longest rest     {count.longest_rest} bytes, of {LONGEST_REST} that a frame may have")
    print(f"time             {took_s:.1f} s for bytes that are decoded twice")
    return 0


def _frame(chance: random.Random) -> Frame:
    data = chance.randbytes(chance.choice((0, 1, 2, 16, 16, 40)))
    return Frame(chance.randrange(256), chance.randrange(256), data)


def _torn(chance: random.Random) -> bytes:
    whole = encode(*_frame(chance))
    return whole[: chance.randrange(len(whole))]


def _wrong(chance: random.Random) -> bytes:
    spoilt = bytearray(encode(*_frame(chance)))
    spoilt[chance.randrange(len(spoilt))] ^= 1 << chance.randrange(8)
    return bytes(spoilt)


if __name__ == "__main__":
    sys.exit(main())
