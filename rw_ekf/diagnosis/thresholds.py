"""Every number that decides what a diagnosis says: what it decides, and where it comes from (docs/thresholds.md).

Others, of the same modules, are of the arithmetic (grids, tolerances, how far a budget reaches) and move no verdict.
What the proof's marks do where one of these is a third smaller or larger: `python -m tools.measure.thresholds`.
"""

from __future__ import annotations

from typing import NamedTuple

from rw_ekf.logs import joined


class Threshold(NamedTuple):
    """A row of the table."""

    value: float
    unit: str
    decides: str
    source: str


TABLE: dict[str, Threshold] = {}


def _number(name: str, value: float, unit: str, decides: str, source: str) -> float:
    TABLE[name] = Threshold(value, unit, decides, source)
    return value


# Readings
OUTLIER_NOISES = _number(
    "OUTLIER_NOISES", 15.0, "noises", "a reading so far from its neighbours' median is none", "7e-51 for Gaussian noise"
)
OUTLIER_CHANGES = _number(
    "OUTLIER_CHANGES", 4.0, "usual changes", "and so far, in changes that nine in ten samples stay below",
    "chosen",
)  # fmt: skip
OUTLIERS_AT_EDGES = _number(
    "OUTLIERS_AT_EDGES", 3.0, "", "times as far at the ends of a stretch", "a ramp leaves the median on one side"
)
MOST_OUTLIERS = _number("MOST_OUTLIERS", 0.1, "share", "more are no errors but the record itself", "chosen")
LEAST_READINGS = int(_number("LEAST_READINGS", 100, "", "fewer cannot be judged", "chosen"))
LEAST_SECONDS = _number(
    "LEAST_SECONDS", 5.0, "s", "shorter cannot be judged", "16 healthy motors of 7 s at 100 Hz are adequate"
)
LEAST_MOVE = _number("LEAST_MOVE", 0.05, "of top speed", "a speed that changes by less shows no friction law", "chosen")
SAME_ROWS = _number(
    "SAME_ROWS",
    joined.SAME_ROWS,
    "share",
    "two logs that share more rows are one log",
    "two runs do not read the same noise",
)
GRID_NOISES = _number("GRID_NOISES", 1.5, "noises", "a grid that is finer is none", "chosen")
GRID_REGISTER_RPM = _number(
    "GRID_REGISTER_RPM", 0.6, "rpm", "a grid that is finer is the wire's own register", "wire map: 0.5 rpm"
)
GRID_GAINS = _number(
    "GRID_GAINS", 0.5, "%", "a grid that makes held-out errors smaller by less is named only where it is coarse",
    "grids of 3, 3.5 and 4 noises take off .16, .6, 1.5 % (eq. 11a)",
)  # fmt: skip

# What enters
SIGNIFICANT_P = _number(
    "SIGNIFICANT_P", 1e-4, "p", "an effect may enter, and must be missed when it is left out",
    "twenty effects, one healthy record in 500",
)  # fmt: skip
INFLATION = _number("INFLATION", 1.15, "", "statistics over chi-square", "fitted to healthy simulated wheels")
WORTH_A_FIT_P = _number("WORTH_A_FIT_P", 1e-2, "p", "an effect that is scored by a secant is fitted", "chosen")
ALIAS_SHARE = _number(
    "ALIAS_SHARE", 0.5, "of the statistic", "a candidate that scores less beside the best is not fitted", "chosen"
)
MOST_TRIED = int(_number("MOST_TRIED", 3, "", "candidates that are fitted in full beside a row", "chosen"))
MOST_EFFECTS = int(_number("MOST_EFFECTS", 4, "", "effects in a row", "chosen"))
MOST_LAWS = int(_number("MOST_LAWS", 3, "", "laws without a formula in a row", "chosen"))
BEAM = int(_number("BEAM", 2, "", "rows from which others are grown", "chosen"))
MOST_GROWN = int(_number("MOST_GROWN", 7, "", "rows that are grown from", "chosen"))
OWN_GAIN = _number(
    "OWN_GAIN", 0.5, "of the gain", "with less of its own, the model before an effect had not been fitted to the end",
    "ripple on a grid of 9 rpm: a gain of 81, .4 its own",
)  # fmt: skip
KEPT_SHARE = _number(
    "KEPT_SHARE", 0.5, "of the score", "a fit that keeps less went astray, and is begun along the filter's path",
    "chosen",
)  # fmt: skip
LAW_BESIDE_EVENT = _number(
    "LAW_BESIDE_EVENT", 16.0, "statistic", "a law more beside an event has to gain", "p = 6e-5 of one coefficient"
)

# What goes with what
IS_FUNCTION = _number(
    "IS_FUNCTION", 0.5, "of variance", "one quantity goes with another: effects of time are asked beside it",
    "chosen",
)  # fmt: skip
IS_ONE = _number(
    "IS_ONE", 0.9, "of variance", "one quantity is another: no likelihood decides between their laws",
    "chosen",
)  # fmt: skip
LEAST_KELVIN = _number("LEAST_KELVIN", 1.0, "K", "a temperature that moves less shows nothing", "chosen")

# Weights
INDISTINGUISHABLE = _number(
    "INDISTINGUISHABLE", 4.5, "log", "rows within it are told together; odds against what only a clock tells",
    "three sigma: 9/2",
)  # fmt: skip
TIE = _number(
    "TIE", 0.5, "log", "rows, or valleys, within it are equally likely: the catalogue's first, or where a fit began",
    "chosen",
)  # fmt: skip
UNNAMED_LOG_ODDS = _number(
    "UNNAMED_LOG_ODDS", -3.0, "log", "a law, or a walk, that no catalogue has, beforehand", "one wheel in twenty"
)
CHOSEN_LOG = _number(
    "CHOSEN_LOG", 4.0, "log", "what a law pays for its quantity, kind, size and smoothness, chosen by likelihood",
    "twenty kinds and a few sizes: log 20 + 1",
)  # fmt: skip
TEMPERATURE = _number(
    "TEMPERATURE", 1.5, "", "evidence is too sure of itself by it", "fitted to simulated wheels, tried on others"
)
LEAST_POSTERIOR = _number(
    "LEAST_POSTERIOR", 0.01, "", "an explanation below it does not stand, and no rival is named beside an effect",
    "chosen",
)  # fmt: skip
NOTHING_ODDS = _number(
    "NOTHING_ODDS", 5.0, "times", "as likely beforehand nothing is missing as something is",
    "five wheels in six are in order; of 300 such 4 wanted more at even odds",
)  # fmt: skip
HARDLY_MISSED = _number(
    "HARDLY_MISSED", 40.0, "statistic", "of an effect with less, the model without it is weighed too",
    "chosen",
)  # fmt: skip
BESIDE = _number(
    "BESIDE", 2.0, "times", "as likely something else is beside an effect that foretells all as instead of it",
    "chosen: named is then what takes errors to .57 of themselves (.42, .65 a third less, more)",
)  # fmt: skip
ELSE_BIAS = _number(
    "ELSE_BIAS", -5.0, "logit", "something else, where map and residual show nothing", "fitted to simulated wheels"
)
ELSE_SLOPE = _number(
    "ELSE_SLOPE", 1.0, "logit a decade", "something else, by the smallest p of map and residual",
    "fitted to simulated wheels",
)  # fmt: skip
NOISE_COUNTS = _number(
    "NOISE_COUNTS", 0.5, "of a decade", "what a decade of the p of varying torque noise counts for something else",
    "its tail is carried on from 400 draws: of 563 healthy wheels one had 4e-7",
)  # fmt: skip
ORDERS_COUNT = _number(
    "ORDERS_COUNT", 0.5, "of the log", "evidence between orders of a ripple whose angle is lost",
    "chosen",
)  # fmt: skip

# Checks
LEAST_SIGMAS = _number("LEAST_SIGMAS", 2.5, "sigma", "a size must be known to it", "chosen")
LAW_GAINS = _number(
    "LAW_GAINS", 0.5, "%", "by which a law without a formula has to make the held-out error smaller",
    "two steps that took off what a law held at its edge leaves: 0.0 %",
)  # fmt: skip
MOST_DISPUTED = _number(
    "MOST_DISPUTED", 1.0 / 3.0, "of chi-square", "two parts of a record that dispute more do not agree",
    "derived: each predicts the other with gain (eq. 10b)",
)  # fmt: skip
WORSE = _number(
    "WORSE",
    0.03,
    "share",
    "a held-out figure that grows by it refuses an effect; a law held at its edge that adds as much is sought anew",
    "chosen",
)
WORSE_NIS = _number("WORSE_NIS", 1.15, "factor", "and a NIS that is so much further from 1", "chosen")
WORST = _number("WORST", 0.07, "share", "the same where the free run gains", "chosen")
WORST_NIS = _number(
    "WORST_NIS", 1.35, "factor", "the same where the free run gains; by turns, any figure that grows by it", "chosen"
)
REAL_GAIN = _number("REAL_GAIN", 0.05, "share", "the free run gains", "chosen")
GREAT_GAIN = _number(
    "GREAT_GAIN", 0.5, "share", "the free run gains so much that only errors far ahead count",
    "a model that leaves no torque noise predicts one step as its free run",
)  # fmt: skip
BLIND = _number(
    "BLIND", 0.025, "share", "a part whose predictions are worse by it for want of knowledge has no say",
    "24 healthy wheels: .016 on average, four times by chance",
)  # fmt: skip
UNDOUBTED_P = _number(
    "UNDOUBTED_P", 1e-6, "p", "below it held-out figures refuse only whichever part is held out, or by turns", "chosen"
)
EXPLAINED_SHARE = _number(
    "EXPLAINED_SHARE",
    0.8,
    "of structure",
    "with less, what was found is not the explanation",
    "chosen",
)
MAP_P = _number("MAP_P", 3e-4, "p", "structure is left in the map of the residual", "seven questions a record")
NOISE_P = _number("NOISE_P", 1e-3, "p", "torque noise varies", "so often by noise alone, by construction")
FAR_OFF = _number("FAR_OFF", 4.0, "sigma", "a reading is far off", "one in 16,000 of normal noise")
USUAL_TORQUE_NOISE = _number(
    "USUAL_TORQUE_NOISE", 5.4, "times", "torque noise is not a wheel's", "one wheel in a thousand has more, a priori"
)
FALSE_ALARM = _number("FALSE_ALARM", 1e-4, "p", "a test of the residual fails", "four tests a record")
BEYOND_DOUBT_P = _number(
    "BEYOND_DOUBT_P",
    1e-9,
    "p",
    "a trifle is let in where nothing else leaves noise; readings far off, torque noise are more than chance; "
    "held-out figures refuse only whichever part is held out",
    "chosen",
)

# Words
DOUBTFUL = _number("DOUBTFUL", 0.1, "", "probability of an effect that is mentioned where none was named", "chosen")
GROUP = int(_number("GROUP", 3, "", "effects that are named together", "chosen"))
