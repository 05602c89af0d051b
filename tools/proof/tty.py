"""A case the whole way: `rw-ekf simulate` on a pty, `rw-ekf excite` logging over it, `rw-ekf diagnose` on the log.

Three commands in processes of their own, as a user starts them; the wheel's time runs faster, line included.
"""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

from tools.proof.cases import Case
from tools.proof.marks import cases_of
from tools.proof.sizes import RATE_HZ, commands

COMMAND = [sys.executable, "-m", "rw_ekf"]
# The host's own hesitation counts so many times more in the wheel's time. Logged less true delay of the commands, P1
# for 200 s on two cores, one run each: standard deviation 1.4 ms at factor 1, 6.8 ms at 5, 11.5 ms at 10.
SPEED_FACTOR = 6.0  # at which the line's speed is one that drivers know, 230400
_BAUD = 38400
_STARTING_S = 30.0
_DIAGNOSING_S = 600.0

CONFIGURATION = """\
wheel: {{port: {link}, name: proof, baud: {baud}}}
limits: {{current_A: 0.6, slew_A_per_s: 10000, speed_rpm: 8000}}
loop: {{rate_hz: {rate_hz}, reply_timeout_ms: {timeout_ms}}}
command: {{confirm_sign: false}}
output: {{directory: {directory}}}
simulation:
  {{motor_gain: {motor_gain!r}, viscous: {viscous!r}, coulomb: {coulomb!r}, static: {static!r},
   speed_noise_rpm: {noise_rpm!r}, acceleration_noise_rpm_per_sqrt_s: {process_rpm!r}}}
"""


class TtyError(Exception):
    """A command of the chain failed; the message is what it said."""


def tty_cases(count: int, seed: int) -> list[Case]:
    """Three wheels with an effect, then a healthy one, and so on; all with what the telemetry carries."""
    effects, healthy = cases_of("id-1rpm", count, seed), cases_of("healthy", count, seed)
    chosen = [healthy[number // 4] if number % 4 == 3 else effects[number] for number in range(count)]
    return [
        replace(
            case,
            name=f"tty-{number:03d}-{case.name}",
            mark="tty",
            noise_rpm=1.0,  # the wire's grid of 0.5 rpm is coarser than the least noises
            profile="identification",
            angle="none",
            telemetry=True,
        )
        for number, case in enumerate(chosen)
    ]


def diagnose_over_tty(
    case: Case, directory: Path, speed_factor: float = SPEED_FACTOR
) -> tuple[dict[str, Any], float, Path]:
    """Diagnosis document, seconds that `diagnose` took, and the log it judged. Raises TtyError."""
    directory.mkdir(parents=True, exist_ok=True)
    link, config = directory / "wheel", directory / "wheel.yaml"
    config.write_text(
        CONFIGURATION.format(
            link=link,
            rate_hz=RATE_HZ * speed_factor,
            baud=_BAUD * round(speed_factor),  # the line runs as much faster as the wheel
            timeout_ms=min(40.0, 0.8e3 / (RATE_HZ * speed_factor)),
            directory=directory / "runs",
            noise_rpm=case.noise_rpm,
            process_rpm=case.process_rpm,
            **{name: float(getattr(case.wheel, name)) for name in ("motor_gain", "viscous", "coulomb", "static")},
        )
    )
    log = _excited(case, link, config, speed_factor)
    began = time.perf_counter()
    document = _document("diagnose", str(log), "--json", timeout_s=_DIAGNOSING_S)
    return document, time.perf_counter() - began, log


def _excited(case: Case, link: Path, config: Path, speed_factor: float) -> Path:
    """Drive the simulated wheel through the case's profile; the log it left."""
    effects = [part for text in case.effects for part in ("--effect", text)]
    wheel = subprocess.Popen(
        [*COMMAND, "simulate", "--link", str(link), "--config", str(config), "--seed", str(case.seed % 65536),
         "--speed-factor", f"{speed_factor:g}", *effects],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )  # fmt: skip
    try:
        assert wheel.stdout is not None
        if not wheel.stdout.readline():
            _, errors = wheel.communicate(timeout=_STARTING_S)
            raise TtyError(f"simulate: {errors.strip()}")
        duration_s = float(commands(case.profile, case.profile_seed)[0][-1])
        run = _document(
            "excite", case.profile, "--config", str(config), "--seed", str(case.profile_seed), "--json",
            timeout_s=_STARTING_S + 2.0 * duration_s / speed_factor,
        )  # fmt: skip
    finally:
        wheel.send_signal(signal.SIGTERM)
        wheel.wait(timeout=10)
    return Path(run["logs"][0]["log"])


def _document(*arguments: str, timeout_s: float) -> dict[str, Any]:
    try:
        done = subprocess.run([*COMMAND, *arguments], capture_output=True, text=True, timeout=timeout_s, check=False)
    except subprocess.TimeoutExpired:
        raise TtyError(f"{arguments[0]}: not done after {timeout_s:.0f} s") from None
    if done.returncode != 0:
        raise TtyError(f"{arguments[0]}: status {done.returncode}: {done.stderr.strip()[-500:]}")
    document: dict[str, Any] = json.loads(done.stdout)
    return document
