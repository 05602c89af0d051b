"""Fuzz a target guided by coverage. Needs the extra `fuzz` (atheris).

    python -m tools.fuzz.guided frames [CORPUS_DIRECTORY] [-max_total_time=120] [...]

Everything behind the target goes to libFuzzer. Without a directory it begins with the target's own seeds.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import atheris

with atheris.instrument_imports(include=["drivers", "rw_ekf"]):
    from tools.fuzz.targets import TARGETS


def main() -> int:
    """Fuzz until libFuzzer ends."""
    if len(sys.argv) < 2 or sys.argv[1] not in TARGETS:
        print(f"usage: python -m tools.fuzz.guided {{{','.join(TARGETS)}}} [libFuzzer's options]", file=sys.stderr)
        return 2
    name, options = sys.argv[1], sys.argv[2:]
    target = TARGETS[name]
    if all(option.startswith("-") for option in options):
        directory = Path(tempfile.mkdtemp(prefix=f"fuzz-{name}-"))
        for number, content in enumerate(target.seeds):
            (directory / f"seed{number}").write_bytes(content)
        options += [f"-artifact_prefix={directory}/", str(directory)]
    atheris.Setup([sys.argv[0], *options], target.run)
    atheris.Fuzz()
    return 0


if __name__ == "__main__":
    sys.exit(main())
