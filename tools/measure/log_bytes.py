"""Measure what a run's files are made of: bytes a sample, by column, as they are written and compressed.

python -m tools.measure.log_bytes runs/STEM.csv
"""

from __future__ import annotations

import argparse
import csv
import io
from pathlib import Path

import pyarrow as pa

from rw_ekf.logs.log_text import LogText
from rw_ekf.logs.parts import beside, parts_of


def main() -> int:
    """Print a table for the log and one for the estimates."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("log", type=Path)
    log = parser.parse_args().log
    for first in (log, beside(log, "estimates.csv")):
        if parts_of(first).files[0].exists():
            _print(first)
    return 0


def _print(first: Path) -> None:
    texts = [_text(part) for part in parts_of(first).files]
    names, *rows = (row for text in texts for row in csv.reader(io.StringIO(text)))
    rows = [row for row in rows if row != names]
    size, packed = sum(map(len, texts)), sum(_packed(text) for text in texts)
    print(f"{first.name}: {len(rows)} samples, {size / len(rows):.1f} bytes each, {packed / len(rows):.1f} compressed")
    for name, column in zip(names, zip(*rows, strict=True), strict=True):
        text = "\n".join(column)
        print(
            f"  {name:22} {(len(text) + 1) / len(rows):6.2f} {_packed(text) / len(rows):6.2f}  {column[len(rows) // 2]}"
        )


def _text(part: Path) -> str:
    if part.suffix == ".csv":
        return part.read_text(encoding="utf-8")
    text = LogText.unpack(part, "gzip" if part.suffix == ".gz" else "zstd", part.name)
    return (text.unpacked or b"").decode()


def _packed(text: str) -> int:
    return len(pa.compress(text.encode(), codec="zstd", asbytes=True))


if __name__ == "__main__":
    raise SystemExit(main())
