"""`rw-ekf export`: a log in another format, under the names and units of docs/contract.md#logs; a wire map as XTCE."""

from __future__ import annotations

import argparse
import sys
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rw_ekf.driver import WheelProtocol

HELP = "convert a log: CSV, Parquet, MATLAB; a wire map: XTCE, COSMOS"
EXAMPLE = """example:
  rw-ekf export runs/2026-11-21.csv run.parquet
  rw-ekf export carriage.csv carriage.mat --columns columns-emps.yaml
  rw-ekf export sunspace-wheel wheel.xml"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("log", metavar="LOG", help="CSV, Parquet or MATLAB file; or a wire map, a name or a path")
    parser.add_argument(
        "out", metavar="OUT", help="file to write: .csv, .parquet or .mat; of a wire map .xml (XTCE) or .txt (COSMOS)"
    )
    parser.add_argument("--columns", metavar="MAP", help="column map (YAML) of a foreign log; see docs/logs.md")


def execute(args: argparse.Namespace) -> int:
    """Run the verb; raises LogError or BadInputError."""
    if args.out.endswith((".xml", ".txt")):
        return _export_map(args)
    from rw_ekf.commands.answer import answer
    from rw_ekf.commands.inputs import read_logs, refuse_to_overwrite
    from rw_ekf.logs.tables import check_suffix

    check_suffix(args.out)
    refuse_to_overwrite([args.out], [args.log, args.columns])
    (log,) = read_logs([args.log], args.columns)
    log.save(args.out)
    for text in log.warnings:
        sys.stderr.write(f"warning: {text}\n")
    document = {
        "schema": "rw_ekf.export/1",
        "log": log.name,
        "out": args.out,
        "samples": len(log),
        "warnings": log.warnings,
    }
    answer(args, lambda: document, lambda: f"{args.out}: {len(log)} samples")
    return 0


def _why_not(protocol: WheelProtocol) -> str:
    """What is so of a map whose packets are not written down; a family of somebody else's need not say."""
    why = getattr(protocol, "undescribed", None)
    text = "XTCE and COSMOS are written of wire maps of registers alone, and this one is of another family"
    return f"{text}; {why} (docs/wire-protocol.md#for-ground-systems)" if why else text


def _export_map(args: argparse.Namespace) -> int:
    from collections import Counter
    from pathlib import Path

    from rw_ekf.attach.wire import load_protocol
    from rw_ekf.commands.answer import answer
    from rw_ekf.commands.inputs import refuse_to_overwrite
    from rw_ekf.driver import DescribedProtocol
    from rw_ekf.errors import BadInputError
    from rw_ekf.ground.cosmos import cosmos_text
    from rw_ekf.ground.xtce import xtce_text
    from rw_ekf.logs.atomic import write_text

    refuse_to_overwrite([args.out], [args.log])
    protocol = load_protocol(args.log)
    if not isinstance(protocol, DescribedProtocol):
        raise BadInputError(f"{args.log}: {_why_not(protocol)}")
    counts = Counter((packet.is_command, packet.name) for packet in protocol.packets)
    twice = next((name for (_, name), count in counts.items() if count > 1), None)
    if twice is not None:
        raise BadInputError(f"{args.log}: two packets would be called {twice}: give one of the registers another name")
    name = Path(args.log).name.removesuffix(".yaml")
    written = xtce_text if args.out.endswith(".xml") else cosmos_text
    write_text(args.out, written(name, protocol.packets))
    packets = len(protocol.packets)
    document = {"schema": "rw_ekf.export/1", "map": args.log, "out": args.out, "packets": packets}
    answer(args, lambda: document, lambda: f"{args.out}: {packets} packets")
    return 0
