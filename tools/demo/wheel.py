"""The demo's wheel, drawn at random: its friction and one effect, known to the simulator alone until the end."""

from __future__ import annotations

import json
import random
import shutil
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

COMMAND = [sys.executable, "-m", "rw_ekf"]
SPEED_FACTOR = 8.0  # of the wheel's time; the daemon polls as many times faster, on a line as many times as fast
BAUD = 307_200  # 8 x 38400

# Each of these is well above what 600 s at 1 rpm can show, and none is declared to anybody. Sizes: 4 to 12 % of Coulomb
# friction where they act most, or 0.4 to 0.9 of a sample for the delay; `+-`: either sign.
LOTS: dict[str, tuple[str, float, float, bool]] = {
    "offset_torque": ("torque_rad_s2", 0.02, 0.06, True),
    "viscous_asymmetry": ("difference_1_s", 1.5e-4, 4.0e-4, True),
    "viscous_temperature": ("slope_1_K", -0.03, -0.012, False),
    "coulomb_temperature": ("slope_1_K", 0.006, 0.015, True),
    "motor_saturation": ("slope_1_A", 0.06, 0.15, False),
    "transport_delay": ("delay_s", 0.04, 0.09, False),
}
_CK13 = {"motor_gain": 15.205, "viscous": 0.00322, "coulomb": 0.5863}
_SPREAD = 0.1  # wheels of a series differ

CONFIGURATION = """\
# The truth of the demo's wheel, drawn by `make demo`. Only `rw-ekf simulate` is given this file.
wheel: {{port: {link}}}
limits: {{current_A: 0.6}}
simulation:
  motor_gain: {motor_gain!r}
  viscous: {viscous!r}
  coulomb: {coulomb!r}
  static: {static!r}
  effects: ["{effect}"]
"""


@dataclass(frozen=True)
class Lot:
    """A wheel that was drawn."""

    seed: int
    parameters: dict[str, float]  # the four, per unit inertia
    effect: str  # id in the catalogue
    name: str  # of its coefficient
    value: float

    @property
    def effect_text(self) -> str:
        """As `rw-ekf simulate --effect` takes it."""
        return f"{self.effect}:{self.name}={self.value!r}"


def draw(seed: int) -> Lot:
    """Draw a wheel and its effect from a seed."""
    lots = random.Random(seed)
    effect = lots.choice(sorted(LOTS))
    name, low, high, either_sign = LOTS[effect]
    value = float(f"{lots.uniform(low, high):.3g}")
    if either_sign and lots.random() < 0.5:
        value = -value
    parameters = {key: centre * lots.uniform(1.0 - _SPREAD, 1.0 + _SPREAD) for key, centre in _CK13.items()}
    parameters["static"] = parameters["coulomb"] * lots.uniform(1.02, 1.06)
    return Lot(seed, {key: float(f"{number:.5g}") for key, number in parameters.items()}, effect, name, value)


@contextmanager
def simulated_wheel(lot: Lot, directory: Path) -> Iterator[dict[str, Any]]:
    """Serve the wheel in a second process for the length of a with block; yields where it is: `link`, `device`."""
    place = Path(tempfile.mkdtemp(prefix="rw-ekf-demo-"))
    link, config = place / "wheel", directory / "wheel.yaml"
    config.write_text(CONFIGURATION.format(link=link, effect=lot.effect_text, **lot.parameters), encoding="utf-8")
    process = subprocess.Popen(
        [*COMMAND, "simulate", "--link", str(link), "--config", str(config), "--seed", str(lot.seed % 65536),
         "--speed-factor", f"{SPEED_FACTOR:g}", "--json"],
        stdout=subprocess.PIPE,
        text=True,
    )  # fmt: skip
    try:
        stated = _first_document(process)
        yield {name: stated[name] for name in ("link", "device")}
    finally:
        process.send_signal(signal.SIGTERM)
        process.wait(timeout=10)
        shutil.rmtree(place, ignore_errors=True)


def _first_document(process: subprocess.Popen[str]) -> dict[str, Any]:
    """Read lines until one JSON document is whole."""
    assert process.stdout is not None
    text = ""
    while not text.rstrip().endswith("\n}"):
        line = process.stdout.readline()
        if not line:
            raise SystemExit("the simulated wheel did not start; its message stands above")
        text += line
    document: dict[str, Any] = json.loads(text)
    return document
