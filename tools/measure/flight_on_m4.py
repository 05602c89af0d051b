"""An exported estimator on an emulated Cortex-M4: its self-test, instructions and stack of a reading.

    python -m tools.measure.flight_on_m4 DIR

DIR as `rw-ekf export-model --c DIR` leaves it; needs arm-none-eabi-gcc with newlib, and qemu-system-arm. qemu counts
instructions, not cycles: a Cortex-M4 takes 1.2 to 1.5 cycles for one of these.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

TOOLS = ("arm-none-eabi-gcc", "qemu-system-arm")
_HERE = Path(__file__).parent / "cortex_m4"
_TARGET = ["-mcpu=cortex-m4", "-mthumb", "-mfloat-abi=hard", "-mfpu=fpv4-sp-d16"]
_LINK = ["-nostartfiles", "--specs=rdimon.specs", "-Wl,--wrap=rw_ekf_step,--wrap=main"]
_MACHINE = ["-M", "mps2-an386", "-cpu", "cortex-m4", "-nographic", "-monitor", "none", "-serial", "none"]
_LONGEST_S = 300


def missing() -> str | None:
    """The tool that is not there; None where all are."""
    return next((tool for tool in TOOLS if shutil.which(tool) is None), None)


def run_on_m4(folder: Path, *, other_libm: bool) -> tuple[int, str]:
    """(exit status of the self-test, what it and the counters printed). Raises CalledProcessError."""
    with tempfile.TemporaryDirectory() as place:
        program = Path(place) / "m4.elf"
        sources = [folder / "rw_ekf.c", folder / "test_rw_ekf.c", _HERE / "startup.c", _HERE / "count.c"]
        subprocess.run(
            [
                TOOLS[0], "-std=c99", "-O2", "-ffp-contract=off", *_TARGET, f"-I{folder}", *_LINK,
                *["-DRW_EKF_OTHER_LIBM"] * other_libm, "-T", str(_HERE / "mps2.ld"), *map(str, sources), "-lm",
                "-o", str(program),
            ],
            check=True, capture_output=True, text=True,
        )  # fmt: skip
        done = subprocess.run(
            [TOOLS[1], *_MACHINE, "-icount", "shift=0", "-semihosting", "-kernel", str(program)],
            check=False, capture_output=True, text=True, timeout=_LONGEST_S,
        )  # fmt: skip
    return done.returncode, done.stdout


if __name__ == "__main__":
    status, stated = run_on_m4(Path(sys.argv[1]), other_libm=True)
    sys.stdout.write(stated)
    sys.exit(status)
