"""`rw-ekf flyby`: when wheels reverse during a nadir-pointed flyby ([L17] Appendix A)."""

from __future__ import annotations

import argparse
import re

from rw_ekf.commands.inputs import duration_s

HELP = "when reaction wheels cross zero during a nadir-pointed flyby"
EXAMPLE = """example:
  rw-ekf flyby                                                    # table A1 of Lee 2017: Cassini at Titan
  rw-ekf flyby --rates 300,600,900 -300,-600,900 --avoid 300
  rw-ekf flyby --geometry my-flyby.yaml --rates 500,500,500,500 --out flyby.png

config/flyby-titan.yaml is a geometry to start from; its keys and the equations are in docs/flyby.md"""
_LIST = re.compile(r"-?[\d.].*")  # a list of numbers, though it begins like an option
_MOST_RPM = 1.0e6


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser._negative_number_matcher = _LIST  # argparse would take "-300,600,900" for an option
    parser.add_argument(
        "--geometry", metavar="F", help="wheels, spacecraft and track (YAML); without it Cassini at Titan"
    )
    parser.add_argument(
        "--rates",
        metavar="W1,W2,W3",
        nargs="+",
        type=_rates,
        help="wheel rates at the start [rpm], one set or several; without it those of table A1",
    )
    parser.add_argument(
        "--avoid",
        metavar="T",
        type=duration_s,
        help="which rates keep all wheels from zero within T of closest approach: 300 or 300s, 5m",
    )
    parser.add_argument("-o", "--out", metavar="FILE", help="picture of the wheel rates over time: .png, .svg or .pdf")


def _rates(text: str) -> tuple[float, ...]:
    try:
        rates = tuple(float(item) for item in text.split(","))
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is no list of rates: write 300,600,900 [rpm]") from None
    if not all(abs(rate) <= _MOST_RPM for rate in rates):
        raise argparse.ArgumentTypeError(f"{text!r}: a rate must be a number within {_MOST_RPM:g} rpm")
    return rates


def execute(args: argparse.Namespace) -> int:
    """Run the verb; raises BadInputError."""
    from rw_ekf.commands.answer import answer, drawn
    from rw_ekf.commands.inputs import refuse_to_overwrite
    from rw_ekf.errors import BadInputError
    from rw_ekf.flyby.flyby_plan import TABLE_A1_RPM, case_of, plan_document, plan_text
    from rw_ekf.flyby.settings import read_flyby
    from rw_ekf.logs.picture_file import check_picture_suffix

    check_picture_suffix(args.out)
    refuse_to_overwrite([args.out], [args.geometry])
    flyby = read_flyby(args.geometry)
    count = len(flyby.wheels)
    if args.rates is None and args.geometry is not None:
        raise BadInputError(f"--rates: give the {count} wheel rates at the start [rpm]: table A1 is Cassini's")
    wanted = args.rates or TABLE_A1_RPM
    for rates in wanted:
        if len(rates) != count:
            shown = ",".join(f"{rate:g}" for rate in rates)
            raise BadInputError(
                f"--rates {shown}: {len(rates)} rates for {count} wheels ({', '.join(flyby.wheels.names)})"
            )
    cases = [case_of(flyby, rates) for rates in wanted]
    whole = True
    if args.out is not None:
        from rw_ekf.flyby.flyby_picture import plan_picture

        whole = drawn(lambda: plan_picture(args.out, flyby, cases))
    stated = (flyby, cases, args.avoid)
    answer(args, lambda: plan_document(*stated), lambda: plan_text(*stated))
    return 0 if whole else 1
