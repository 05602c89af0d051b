"""What a diagnosis gains at a reversal: python -m tools.measure.diagnosed_against_base [EFFECT ...] [--seeds 5].

For a wheel with one effect each: peak attitude error [deg], median and worst of the seeds at 1 rpm, of
dynamic model compensation and of predictive crossing, both with the four parameters alone and with the effects that
`diagnose` found on the identification record of seed 0; coefficients are learned on each seed's own.
"""

from __future__ import annotations

import argparse

import numpy as np

from rw_ekf.attitude_bench.contest import hold_contest, models_of
from rw_ekf.attitude_bench.scenario import Scenario

EFFECTS = (
    "offset_torque",
    "coulomb_temperature",
    "presliding_hysteresis",
    "friction_lag",
    "actuator_lag",
    "transport_delay",
    "torque_ripple",
    "motor_saturation",
    "current_deadzone",
    "drag_spike:onset_s=285",  # just before the reversal, and in the record
)
SCHEMES = ("dmc", "dmc_diagnosed", "predictive_crossing", "predictive_diagnosed")


def main() -> None:
    """Print a line for each effect."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("effects", nargs="*", metavar="EFFECT", help='as "ID:name=value"; default: all of the study')
    parser.add_argument("--seeds", type=int, default=5, help="wheels of each effect (default: 5)")
    options = parser.parse_args()
    print(f"{'effect':24}" + "".join(f"{name:>22}" for name in SCHEMES) + "  found")
    for effect in options.effects or EFFECTS:
        scenario = Scenario.model_validate({"wheel": {"effects": [effect]}, "cycle": {"speed_noise_rpm": [1.0]}})
        models = models_of(SCHEMES, scenario)
        contest = hold_contest(SCHEMES, scenario, options.seeds, models)
        peaks = {
            name: [figures.peak_deg for entry, figures in contest.figures.items() if entry.scheme == name]
            for name in SCHEMES
        }
        figures = "".join(f"{np.median(values):14.4f} {max(values):7.4f}" for values in peaks.values())
        found = ", ".join(effect_id for model in models.values() for effect_id in model.effects.ids)
        print(f"{effect:24}{figures}  {found or 'nothing'}", flush=True)


if __name__ == "__main__":
    main()
