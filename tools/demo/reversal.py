"""The same reversal three times: without compensation, with the first model's friction, with the diagnosed model's.

    python -m tools.demo.reversal      with the wheel and the models that the last `make demo` left

Three wheels, three daemons and three tables at once, in real time: an air-bearing table pushed by a fan, whose wheel
gives the fan's momentum way until it reverses, as in [CK13] 4. Peaks as there, curves as in its figures 7 and 10.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import shutil
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import matplotlib as mpl
import numpy as np

from tools.demo.table import LASTS_S, OUTPUT, Crossing, cross, wheel_of_table
from tools.demo.wheel import COMMAND, Lot, draw

mpl.use("Agg")
from matplotlib import pyplot as plt

WITHOUT, FIRST, DIAGNOSED = "without compensation", "with the first model", "with the diagnosed model"
_COLOURS = {WITHOUT: "#b3442e", FIRST: "#8a5fb0", DIAGNOSED: "#0b6e4f"}

CONFIGURATION = """\
# Written by `make demo`: torques come in over the socket; `pid_current` is the wheel in current mode, nothing added.
wheel: {{port: {link}, name: {name}}}
limits: {{current_A: 0.6}}
filter: {{model: {model}}}
command: {{profile: zero}}
compensation: {{scheme: {scheme}, request: socket, socket: {socket}}}
output: {{directory: {directory}}}
"""


def reversals(lot: Lot, first_model: Path, diagnosed_model: Path, output: Path) -> dict[str, Crossing]:
    """Run the three at once; what each came to, by its name."""
    cases = {WITHOUT: ("pid_current", first_model), FIRST: ("dmc", first_model), DIAGNOSED: ("dmc", diagnosed_model)}
    place = Path(tempfile.mkdtemp(prefix="rw-ekf-demo-"))
    try:
        with ThreadPoolExecutor(len(cases)) as pool:
            running = {
                name: pool.submit(_reversal, lot, scheme, model, output / f"reversal-{i}", place / f"s{i}")
                for i, (name, (scheme, model)) in enumerate(cases.items(), start=1)
            }
            return {name: future.result() for name, future in running.items()}
    finally:
        shutil.rmtree(place, ignore_errors=True)


def _reversal(lot: Lot, scheme: str, model: Path, directory: Path, path: Path) -> Crossing:
    """One wheel, one daemon, one table."""
    shutil.rmtree(directory, ignore_errors=True)  # what the daemon learned there is of another demo
    directory.mkdir(parents=True)
    link = path.with_suffix(".tty")
    with wheel_of_table(lot, link) as wheel:
        config = directory / "run.yaml"
        config.write_text(
            CONFIGURATION.format(
                link=link,
                name=directory.name,
                model=json.dumps(str(model.resolve())),
                scheme=scheme,
                socket=path,
                directory=directory,
            ),
            encoding="utf-8",
        )
        with _daemon(config, directory / "daemon.log"):
            return cross(wheel, path, lot.seed)


@contextlib.contextmanager
def _daemon(config: Path, log: Path) -> Iterator[None]:
    """`rw-ekf run` for the length of a with block; what it says goes to `log`."""
    with log.open("w", encoding="utf-8") as stated:
        process = subprocess.Popen([*COMMAND, "run", "--config", str(config)], stdout=stated, stderr=stated)
        try:
            yield
        finally:
            process.send_signal(signal.SIGTERM)
            process.wait()  # zero is sent at once; the run judges itself before it ends


def print_peaks(crossings: Mapping[str, Crossing]) -> bool:
    """Three peaks in degrees; whether each wheel reversed, and the diagnosed model cut the error to a quarter."""
    for name, crossing in crossings.items():
        note = "" if crossing.crossed else "   (the wheel did NOT reverse)"
        print(f"   {name:<26}{crossing.peak_deg:>9.3f} deg{note}")
    better = 4.0 * crossings[DIAGNOSED].peak_deg <= crossings[WITHOUT].peak_deg
    return better and all(crossing.crossed for crossing in crossings.values())


def draw_reversal(path: Path, crossings: Mapping[str, Crossing]) -> None:
    """A PNG: attitude error of the three, the same near zero, and the wheels' speeds."""
    figure, (whole, near, speed) = plt.subplots(3, 1, figsize=(9, 8), sharex=True, height_ratios=[1.5, 1.2, 1.0])
    for name, crossing in crossings.items():
        time_s, label = np.array(crossing.time_s), f"{name}: {crossing.peak_deg:.3f} deg"
        for axis in (whole, near):
            axis.plot(time_s, crossing.attitude_deg, color=_COLOURS[name], lw=1.6, label=label)
        speed.plot(time_s, crossing.speed_rpm, color=_COLOURS[name], lw=1.4)
    least = min(crossing.peak_deg for crossing in crossings.values())
    near.set_ylim(-4.0 * least, 4.0 * least)
    near.set_ylabel("the same,\nnear zero [deg]")
    whole.set_ylabel("attitude error [deg]")
    whole.legend(frameon=False, loc="best")
    speed.set_ylabel("wheel [rpm]")
    speed.axhline(0.0, color="0.5", lw=0.8)
    speed.set_xlabel("time since the integral has settled [s]")
    speed.set_xlim(-2.0, LASTS_S)
    shown = [v for c in crossings.values() for t, v in zip(c.time_s, c.attitude_deg, strict=True) if t >= -2.0]
    whole.set_ylim(1.15 * min(shown), 1.15 * max(shown))
    for axis in (whole, near, speed):
        axis.grid(visible=True, alpha=0.25)
        axis.spines[["top", "right"]].set_visible(False)
    figure.suptitle("A table held by its wheel while the wheel reverses [CK13, figures 7 and 10]", fontsize=12)
    figure.align_ylabels()
    figure.tight_layout()
    figure.savefig(path, dpi=110)
    plt.close(figure)


def main() -> int:
    """The reversal alone, with what the last demo left. Raises SystemExit where it left nothing."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int, required=True, help="of the demo's wheel; it said so at its beginning")
    lot = draw(parser.parse_args().seed)
    models = sorted((OUTPUT / "runs").glob("*.model.yaml"))
    diagnosed = OUTPUT / "diagnosis" / "augmented-model.yaml"
    if not models or not diagnosed.exists():
        raise SystemExit(f"{OUTPUT}: no models of a demo: run `make demo` first")
    crossings = reversals(lot, models[0], diagnosed, OUTPUT)
    well = print_peaks(crossings)
    draw_reversal(OUTPUT / "reversal.png", crossings)
    print(f"   picture: {OUTPUT / 'reversal.png'}")
    return 0 if well else 1


if __name__ == "__main__":
    sys.exit(main())
