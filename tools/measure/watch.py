"""What the watch of the daemon is worth: false alarms on healthy wheels, delay on drag spikes, names, cost.

    python -m tools.measure.watch healthy --hours 3 --seeds 30        the table of docs/watch.md, a quarter of an hour
    python -m tools.measure.watch spikes | names | cost

Everything is simulated by the plant, which shares no propagation with the filter, and seeded.
"""

from __future__ import annotations

import argparse
import time
from collections import Counter
from typing import NamedTuple

import numpy as np
from tqdm import tqdm

from rw_ekf.watch.alarms import DRAG_SPIKE, RESIDUAL
from tools.measure.watch_runs import PROFILES, commands, drawn_wheel, filtered, heard, simulated, stream, watch_of

AMPLITUDES_MNM = (0.2, 0.5, 1.0, 2.0, 7.0)
INERTIA_KG_M2 = 1.5e-3
SPIKE_PROFILES = ("steady", "biased", "S4", "P2", "random-sines", "identification")
TURNING_RAD_S = 5.0  # a spike of 7 mNm needs a second to stop such a wheel
EFFECTS = (
    "offset_torque:torque_rad_s2=0.03",
    "viscous_asymmetry",
    "quadratic_drag:coefficient_1_rad=2e-6",
    "viscous_temperature",
    "coulomb_temperature",
    "motor_gain_temperature",
    "motor_saturation",
    "actuator_lag",
    "presliding_hysteresis",
    "coulomb_drift",
)


def healthy(hours: float, seeds: int, noise_rpm: float, first_seed: int) -> None:
    """Alarms on wheels without any effect, by profile."""
    raised: Counter[tuple[str, str]] = Counter()
    total_h = 0.0
    for seed in tqdm(range(first_seed, first_seed + seeds), disable=None):
        for number, profile in enumerate(PROFILES):
            time_s, current_A = commands(profile, hours, seed)
            run = simulated(
                drawn_wheel(31 * seed + number), time_s, current_A, 100 * seed + number, noise_rpm=noise_rpm
            )
            total_h += hours
            for found in heard(run, noise_rpm):
                if found.alarm.ended_s is None:
                    raised[profile, found.alarm.name] += 1
                    print(f"{profile} seed {seed} {found.time_s:.1f} s: {found.alarm.sentence('then')}")
    print(f"{total_h:.0f} h of healthy wheels at {noise_rpm:g} rpm: {sum(raised.values())} alarms {dict(raised)}")


def spikes(seeds: int, noise_rpm: float) -> None:
    """Delay, amplitude and end of spikes of 0.2 to 7 mNm that decay in 60 to 400 s."""
    print("| profile | mNm | median s | 90 % s | within 5 s | of those turning | amplitude ratio | end, decays |")
    for profile in SPIKE_PROFILES:
        for size_mNm in AMPLITUDES_MNM:
            fates = [_fate(profile, size_mNm, seed, noise_rpm) for seed in range(seeds)]
            delay = np.array([fate.delay_s for fate in fates])
            free = np.array([fate.turning for fate in fates])
            ratio = [fate.ratio for fate in fates if fate.turning and fate.ratio is not None]
            print(
                f"| {profile} | {size_mNm:g} | {np.median(delay):.1f} | {np.quantile(delay, 0.9):.1f} "
                f"| {np.mean(delay <= 5.0):.0%} | {np.sum(delay[free] <= 5.0)} of {free.sum()} "
                f"| {np.mean(ratio):.2f} +- {np.std(ratio):.2f} | {np.median([f.ended for f in fates]):.1f} |",
                flush=True,
            )


class Fate(NamedTuple):
    """What became of one spike."""

    delay_s: float  # infinite: never reported
    turning: bool  # the wheel turned at its onset
    ratio: float | None  # amplitude found over true; None: only a bound
    ended: float  # after so many decay times; infinite: not within the record


def _fate(profile: str, size_mNm: float, seed: int, noise_rpm: float) -> Fate:
    draw = np.random.default_rng([seed, 7])
    onset_s, decay_s = draw.uniform(400.0, 500.0), float(draw.choice([60.0, 150.0, 400.0]))
    amplitude = 1.0e-3 * size_mNm / INERTIA_KG_M2
    time_s, current_A = commands(profile, (520.0 + 6.0 * decay_s) / 3600.0, seed + 1)
    effect = f"drag_spike:amplitude_rad_s2={amplitude},onset_s={onset_s},decay_s={decay_s}"
    run = simulated(drawn_wheel(seed + 10), time_s, current_A, seed + 100, noise_rpm=noise_rpm, effect=effect)
    turning = abs(float(run.speed_rad_s[int(10 * onset_s)])) > TURNING_RAD_S
    stated = [h for h in heard(run, noise_rpm) if h.alarm.name == DRAG_SPIKE and h.time_s > onset_s]
    begun = [h for h in stated if h.alarm.ended_s is None]
    over = [h for h in stated if h.alarm.ended_s is not None]
    if not begun:
        return Fate(np.inf, turning, None, np.inf)
    details = begun[0].alarm.details
    ratio = None if details["std_rad_s2"] is None else float(str(details["amplitude_rad_s2"])) / amplitude
    ended = (over[0].time_s - onset_s) / decay_s if over else np.inf
    return Fate(begun[0].time_s - onset_s, turning, ratio, ended)


def names(seeds: int, from_s: float) -> None:
    """First and last name that the alarm gives to effects that set in at from_s, and spikes wrongly reported."""
    for profile in ("identification", "random-sines"):
        for effect in EFFECTS:
            words = []
            for seed in range(seeds):
                time_s, current_A = commands(profile, 0.7, seed)
                run = simulated(drawn_wheel(seed + 10), time_s, current_A, seed, effect=effect, from_s=from_s)
                begun = [h for h in heard(run) if h.alarm.ended_s is None]
                stated = [h for h in begun if h.alarm.name == RESIDUAL]
                false = len(begun) - len(stated)
                if stated:
                    first, last = (stated[i].alarm.details["largest_dependence"] for i in (0, -1))
                    words.append(
                        f"{stated[0].time_s - from_s:.0f} s {first} > {last}" + f" ({false} spikes)" * (false > 0)
                    )
                else:
                    words.append("none" + f" ({false} spikes)" * (false > 0))
            print(f"| {profile} | {effect.split(':')[0]} | {'; '.join(words)} |", flush=True)


def cost() -> None:
    """Microseconds a sample."""
    time_s, current_A = commands("P2", 1.0, 1)
    constants, done = filtered(run := simulated(drawn_wheel(1), time_s, current_A, 1))
    steps = list(stream(run, constants, done))
    watch = watch_of(constants)
    began_s = time.process_time()
    longest_s = 0.0
    for step in steps:
        before_s = time.process_time()
        watch.step(step)
        longest_s = max(longest_s, time.process_time() - before_s)
    spent_s = time.process_time() - began_s
    print(f"{1e6 * spent_s / len(steps):.1f} us a sample, at most {1e3 * longest_s:.1f} ms")


def main() -> None:
    """Run what was asked for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=("healthy", "spikes", "names", "cost"))
    parser.add_argument("--hours", type=float, default=3.0, help="of each healthy run [h]")
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--first-seed", type=int, default=0)
    parser.add_argument("--noise-rpm", type=float, default=1.0)
    parser.add_argument(
        "--from-s", type=float, default=900.0, help="when the effects of `names` set in; 0: at once [s]"
    )
    args = parser.parse_args()
    if args.what == "healthy":
        healthy(args.hours, args.seeds, args.noise_rpm, args.first_seed)
    elif args.what == "spikes":
        spikes(args.seeds, args.noise_rpm)
    elif args.what == "names":
        names(args.seeds, args.from_s)
    else:
        cost()


if __name__ == "__main__":
    main()
