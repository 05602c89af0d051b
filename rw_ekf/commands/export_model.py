"""`rw-ekf export-model`: the estimator of a model as C99, or its wheel for FMI, MATLAB or Basilisk."""

from __future__ import annotations

import argparse
import sys
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rw_ekf.commands.answer import answer
from rw_ekf.commands.inputs import add_config_option, read_configuration, read_wheel_model

if TYPE_CHECKING:
    from rw_ekf.flight.fmu_description import Version
    from rw_ekf.flight.plant_model import PlantModel
    from rw_ekf.settings.schema import Configuration
    from rw_ekf.starting_point import FilterSetup

HELP = "the estimator of a model as C99, or its wheel for FMI, MATLAB or Basilisk"
EXAMPLE = """example:
  rw-ekf export-model --c flight model.yaml && make -C flight test
  rw-ekf export-model --c flight --float model.yaml
  rw-ekf export-model --fmu wheel.fmu --fmi 3 model.yaml
  rw-ekf export-model --fmu wheel.fmu --platforms linux64,win64 model.yaml
  rw-ekf export-model --matlab wheel.m model.yaml
  rw-ekf export-model --basilisk wheel.json --inertia-kg-m2 1.5e-3 model.yaml"""
_RATE_HZ = 10.0
_FASTEST_HZ = 1.0e5
_OF_ONE = {  # options that belong to some forms alone
    "single": ("--float", ("c",)),
    "fmi": ("--fmi", ("fmu",)),
    "platforms": ("--platforms", ("fmu",)),
    "inertia_kg_m2": ("--inertia-kg-m2", ("fmu", "basilisk")),
}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("model", metavar="MODEL", help="model YAML, as `fit --out`, `diagnose` or a run writes it")
    form = parser.add_mutually_exclusive_group(required=True)
    form.add_argument(
        "--c", metavar="DIR", help="estimator as C99: folder to write to; files of an export are replaced"
    )
    form.add_argument("--fmu", metavar="F", help="wheel as a co-simulation FMU, F ending in .fmu")
    form.add_argument("--matlab", metavar="F", help="wheel as a MATLAB function, F ending in .m")
    form.add_argument("--basilisk", metavar="F", help="parameters of Basilisk's reaction wheel, F ending in .json")
    parser.add_argument("--float", dest="single", action="store_true", help="single precision; with --c")
    parser.add_argument("--fmi", type=int, choices=(2, 3), help="version of FMI; default 2")
    parser.add_argument(
        "--platforms",
        metavar="P,...",
        help="with --fmu: that it has libraries for, by ziglang: all, or linux64, win64, aarch64-linux and so on; "
        "default this machine",
    )
    parser.add_argument(
        "--inertia-kg-m2", type=float, metavar="J", help="of the wheel, for torques; default the model's, or --config's"
    )
    parser.add_argument("--rate-hz", type=float, metavar="R", help=f"of readings; default {_RATE_HZ:g}, or --config's")
    add_config_option(parser, "noises, gate and gap as the daemon has them; without it the model's own")


def execute(args: argparse.Namespace) -> int:
    """Run the verb; raises RwEkfError."""
    from rw_ekf.filter.constants import DEFAULT_ACCELERATION_NOISE, DEFAULT_SPEED_NOISE_RAD_S
    from rw_ekf.starting_point import belief_of_model, setup_of_configuration, setup_of_model

    form = next(name for name in ("c", "fmu", "matlab", "basilisk") if getattr(args, name) is not None)
    _check(args, form)
    configuration = read_configuration(args)
    model = read_wheel_model(args.model, configuration)
    assert model is not None
    if configuration is not None:
        period_s = 1.0 / (args.rate_hz or configuration.loop.rate_hz)
        setup = setup_of_configuration(configuration, model, period_s)
    else:
        period_s = 1.0 / (args.rate_hz or _RATE_HZ)
        setup = setup_of_model(model, DEFAULT_SPEED_NOISE_RAD_S, DEFAULT_ACCELERATION_NOISE, period_s)
    for remark in model.remarks:
        sys.stderr.write(f"warning: {remark}\n")
    if form == "c":
        found, text = _as_c(args, setup, period_s)
    else:
        setup = replace(setup, prior=belief_of_model(model))  # its own numbers, whatever the filter is to start from
        found, text = _as_wheel(args, form, setup, period_s, configuration)
    answer(args, lambda: found, lambda: text.removesuffix("\n"))
    return 0


def _check(args: argparse.Namespace, form: str) -> None:
    """Raises BadInputError for a number that cannot be, or an option of another form."""
    from rw_ekf.errors import BadInputError
    from rw_ekf.model.bounds import INERTIA_KG_M2

    if args.rate_hz is not None and not 0.0 < args.rate_hz <= _FASTEST_HZ:
        raise BadInputError(f"--rate-hz {args.rate_hz:g}: give readings per second, above 0, up to {_FASTEST_HZ:g}")
    for name, (option, forms) in _OF_ONE.items():
        if getattr(args, name) not in (None, False) and form not in forms:
            belongs = " or ".join(f"--{of}" for of in forms)
            raise BadInputError(f"{option} is an option of {belongs}: leave it out with --{form}")
    least, most = INERTIA_KG_M2
    if args.inertia_kg_m2 is not None and not least <= args.inertia_kg_m2 <= most:
        raise BadInputError(f"--inertia-kg-m2 {args.inertia_kg_m2:g}: give kg m^2, {least:g} to {most:g}")
    ends = {"fmu": ".fmu", "matlab": ".m", "basilisk": ".json"}.get(form, "")
    place = getattr(args, form)
    if not place.endswith(ends):
        raise BadInputError(f"--{form} {place}: give a file that ends in {ends}")


def _as_c(args: argparse.Namespace, setup: FilterSetup, period_s: float) -> tuple[dict[str, Any], str]:
    """The estimator: its document, and what is printed."""
    from rw_ekf.flight.c_export import export_c

    found = export_c(setup, Path(args.model).name, Path(args.c), period_s, single=args.single)
    return found, (
        f"{args.c}: {', '.join(found['files'])}\n"
        f"  {len(found['states'])} states, {found['precision']}; {found['estimator_bytes']} bytes of memory, "
        f"{found['constant_bytes']} of constants, at most {found['statements_at_most']:,} statements a reading\n"
        f"  make -C {args.c} test\n"
    )


def _as_wheel(
    args: argparse.Namespace, form: str, setup: FilterSetup, period_s: float, configuration: Configuration | None
) -> tuple[dict[str, Any], str]:
    """The wheel: its document, and what is printed."""
    from rw_ekf.flight.plant_model import plant_model

    model = plant_model(setup, Path(args.model).name, period_s, args.inertia_kg_m2)
    if form == "fmu":
        return _as_fmu(args, model)
    if form == "matlab":
        from rw_ekf.flight.matlab_export import export_matlab

        found = export_matlab(model, Path(args.matlab))
        return found, f"{args.matlab}: {found['call']}\n{_listed(found['remarks'])}"
    from rw_ekf.flight.basilisk import export_basilisk

    most = None if configuration is None else configuration.limits.current_A
    found = export_basilisk(model, Path(args.basilisk), most)
    return found, f"{args.basilisk}: {', '.join(found['create'])}\n  not carried:\n{_listed(found['not_carried'])}"


def _as_fmu(args: argparse.Namespace, model: PlantModel) -> tuple[dict[str, Any], str]:
    from rw_ekf.flight.fmu_export import export_fmu
    from rw_ekf.flight.fmu_libraries import platforms_of

    version: Version = args.fmi or 2
    platforms = None if args.platforms is None else platforms_of(args.platforms, version)
    found = export_fmu(model, Path(args.fmu), version, platforms)
    if found["without_binary"] is not None:
        sys.stderr.write(
            f"warning: {found['without_binary']}: {args.fmu} has C sources and no library; import it where sources are "
            "compiled, or write it again where there is a compiler\n"
        )
    return found, (
        f"{args.fmu}: FMI {found['fmi']}, co-simulation; {', '.join(found['binaries']) or 'sources alone'}\n"
        f"  in: {', '.join(found['inputs'])}; out: {', '.join(found['outputs'])}\n{_listed(found['remarks'])}"
    )


def _listed(sentences: list[str]) -> str:
    return "".join(f"  - {sentence}\n" for sentence in sentences)
