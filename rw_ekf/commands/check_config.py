"""`rw-ekf check-config`: validate a configuration and show what it comes to."""

from __future__ import annotations

import argparse
import sys

from rw_ekf.commands.inputs import CONFIG_HELP

HELP = "validate a configuration and print it with every default"
EXAMPLE = """example:
  rw-ekf check-config my-wheel.yaml"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("config", metavar="F", help=CONFIG_HELP)


def execute(args: argparse.Namespace) -> int:
    """Run the verb; raises ConfigError with every finding."""
    from rw_ekf.attach import beyond_wire, load_protocol, plant_of
    from rw_ekf.checking.yaml_loader import load_yaml
    from rw_ekf.errors import BadInputError, ConfigError
    from rw_ekf.json_output import print_json
    from rw_ekf.settings.load import configuration_from, configuration_path, resolved_lines

    document = load_yaml(configuration_path(args.config))
    configuration = configuration_from(document)
    wire = load_protocol(configuration.wheel.protocol).limits
    found = [f"{document.where(keys)}: {text}" for keys, text in beyond_wire(configuration, wire)]
    try:
        plant_of(configuration, [])
    except (BadInputError, ValueError) as error:
        found.append(f"{document.where(('simulation', 'effects'))}: {error}")
    if configuration.filter.model is not None:
        from pathlib import Path

        from rw_ekf.wheel.model_file import read_model

        try:
            read_model(Path(configuration.filter.model))
        except ConfigError as error:
            found += error.findings
    if found:
        raise ConfigError(found)
    if args.json:
        print_json({"schema": "rw_ekf.configuration/1", "configuration": configuration.model_dump(mode="json")})
    else:
        sys.stdout.write(resolved_lines(configuration, document))
    return 0
