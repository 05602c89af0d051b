"""The main job, end to end: an unknown wheel, a residual, the effect behind it, a better filter, and the proof.

    python -m tools.demo             a wheel drawn at random
    python -m tools.demo --seed 7    the same wheel again

Nothing here is the product: it starts the product's own commands and compares what they say. Which effect the wheel has
is known to the simulator alone until the last step; `diagnose` is given the log and nothing else.
"""

from __future__ import annotations

import argparse
import secrets
import shutil
import sys
from pathlib import Path
from typing import Any

from tools.demo.commands import command_json, run_daemon, write_configuration
from tools.demo.frozen import frozen_figures
from tools.demo.reversal import draw_reversal, print_peaks, reversals
from tools.demo.table import OUTPUT
from tools.demo.wheel import SPEED_FACTOR, Lot, draw, simulated_wheel
from tools.demo.words import (
    draw_run,
    draw_so_far,
    print_before_after,
    print_estimates,
    print_link,
    print_truth,
    print_verdict,
    say,
    wrapped,
)

FIRST_S, SECOND_S, EARLY_S = 600.0, 300.0, 60.0  # of the wheel's time
SAME = 1.0e-6  # of a sigma: a replay gives the run's own numbers


def main() -> int:
    """Run the demonstration; returns the exit status: 0 if the effect was named, the error fell, the table was held."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int, help="of the wheel's lot; default: another each time")
    seed: int | None = parser.parse_args().seed
    lot = draw(secrets.randbelow(10_000) if seed is None else seed)
    runs = OUTPUT / "runs"
    for old in (runs, OUTPUT / "diagnosis", OUTPUT / "diagnosis-2"):
        shutil.rmtree(old, ignore_errors=True)
    OUTPUT.mkdir(exist_ok=True)

    say(f"a simulated wheel in a process of its own: friction and one undeclared effect at random, seed {lot.seed}")
    print("   what it drew stays with it until step 9")
    with simulated_wheel(lot, OUTPUT) as wheel:
        say(
            f"the daemon on {wheel['device']}: the identification profile, {FIRST_S:.0f} s at 10 Hz; "
            f"the wheel's time runs {SPEED_FACTOR:g} times as fast"
        )
        first_config = write_configuration(
            OUTPUT / "run-1.yaml", link=wheel["link"], runs=runs, command="{profile: identification}"
        )
        first = run_daemon(first_config, FIRST_S, runs, at=EARLY_S, then=lambda log: draw_early(lot, log))
        command_json("compile")  # all at once, and not beside a run: a wheel's line would wait for it
        identical = report_first_run(first, first_config)
        found = diagnose_first_run(first)
        if found["model"] is None:
            print_truth(lot, [("first run", first["logs"][0])], found)
            return 1
        say("the daemon again, on the same wheel, with that model (filter.model): random sines, another 300 s")
        second_config = write_configuration(
            OUTPUT / "run-2.yaml",
            link=wheel["link"],
            runs=runs,
            command=f"{{profile: random-sines, amplitude_A: 0.35, period_s: 60, seed: {lot.seed}}}",
            model=f"diagnosis/{found['model']}",
        )
        second = run_daemon(second_config, SECOND_S, runs)
        print_link(second)
    better = judge_second_run(first, second)

    say("the truth, which only the simulator knew")
    named = print_truth(lot, [("first run", first["logs"][0]), ("second run", second["logs"][0])], found)
    draw_pictures(lot, (first, first_config), (second, second_config))
    pointed = reverse(lot, first, found)
    return 0 if identical and named and better and pointed else 1


def report_first_run(run: dict[str, Any], config: Path) -> bool:
    """Steps 3 and 4: what the filter learned, and whether the replay of its log says the same."""
    entry = run["logs"][0]
    print_link(run)
    say("what the four-parameter filter learned, with the sigma it believes")
    print_estimates(entry)
    say(f"replay of the log it has just written: {entry['log']}")
    replayed = command_json("replay", entry["log"], "--config", str(config))["logs"][0]
    worst = max(abs(replayed["state"][name] - entry["state"][name]) / entry["std"][name] for name in entry["state"])
    late = entry["missing"]
    gaps = f"; {late} replies came too late for this busy machine, and our clock timed those gaps" if late else ""
    print(wrapped(f"the same estimates within {worst:.1e} of their own sigma{gaps}"))
    return bool(worst <= SAME or late > 0)


def diagnose_first_run(run: dict[str, Any]) -> dict[str, Any]:
    """Step 5: `diagnose` on the log alone."""
    log = run["logs"][0]["log"]
    say(f"rw-ekf diagnose {log}")
    document = command_json("diagnose", log, "--out", str(OUTPUT / "diagnosis"))
    print_verdict(document)
    print(f"   report: {OUTPUT / 'diagnosis' / 'report.html'}")
    if document["model"] is not None:
        print(f"   model:  {OUTPUT / 'diagnosis' / document['model']}")
    return document


def judge_second_run(first: dict[str, Any], second: dict[str, Any]) -> bool:
    """Step 7: both models of the first run put to the second; whether the free-run error fell."""
    log, model = second["logs"][0]["log"], OUTPUT / "diagnosis" / "augmented-model.yaml"
    say(f"before and after on the second run, which no model has seen: {log}")
    better = print_before_after(frozen_figures(log, Path(first["model"])), frozen_figures(log, model))
    say("diagnosed again, with the model: nothing should be left, or the next effect named")
    print_verdict(command_json("diagnose", log, "--model", str(model), "--out", str(OUTPUT / "diagnosis-2")))
    return better


def draw_early(lot: Lot, log: Path) -> None:
    """A first picture, while the first run goes on."""
    draw_so_far(OUTPUT / "first-minute.png", log, lot.parameters)
    print(f"   picture so far: {OUTPUT / 'first-minute.png'}", flush=True)


def reverse(lot: Lot, first: dict[str, Any], found: dict[str, Any]) -> bool:
    """Step 10: what the models are for; whether compensation kept the attitude. Nothing else may keep its turns."""
    say("what it is for: a table held by this wheel while the wheel reverses; three at once, in real time, 70 s")
    print("   a fan pushes the table, the attitude controller asks the daemon for torques; largest attitude error")
    crossings = reversals(lot, Path(first["model"]), OUTPUT / "diagnosis" / found["model"], OUTPUT)
    pointed = print_peaks(crossings)
    draw_reversal(OUTPUT / "reversal.png", crossings)
    print(f"   picture: {OUTPUT / 'reversal.png'}")
    return pointed


def draw_pictures(lot: Lot, *runs: tuple[dict[str, Any], Path]) -> None:
    """A picture of each run: the parameters converge beside the truth, or, in the first, do not."""
    titles = ("first run: four parameters", "second run: the effect is a state of the filter")
    for number, ((run, config), title) in enumerate(zip(runs, titles, strict=True), start=1):
        picture = OUTPUT / f"run-{number}.png"
        draw_run(picture, run["logs"][0]["log"], config, lot.parameters, f"demo, {title}")
        print(f"   picture: {picture}")


if __name__ == "__main__":
    sys.exit(main())
