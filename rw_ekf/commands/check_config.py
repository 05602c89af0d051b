"""`rw-ekf check-config`: validate a configuration and show what it comes to."""

from __future__ import annotations

import argparse
import sys
from typing import TYPE_CHECKING

from rw_ekf.commands.inputs import CONFIG_HELP

if TYPE_CHECKING:
    from rw_ekf.checking.yaml_loader import YamlDocument
    from rw_ekf.settings.schema import Configuration

HELP = "validate a configuration and print it with every default"
EXAMPLE = """example:
  rw-ekf check-config my-wheel.yaml"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("config", metavar="F", help=CONFIG_HELP)


def execute(args: argparse.Namespace) -> int:
    """Run the verb; raises ConfigError with every finding."""
    from rw_ekf.checking.yaml_loader import load_yaml
    from rw_ekf.errors import ConfigError
    from rw_ekf.json_output import print_json
    from rw_ekf.settings.load import configuration_path, resolved_lines, wheels_from

    document = load_yaml(configuration_path(args.config))
    try:
        wheels = wheels_from(document)
    except ConfigError as error:
        raise ConfigError([*error.findings, *_of_maps(document)]) from None
    found = [text for document, configuration in wheels for text in _beyond(document, configuration)]
    found = list(dict.fromkeys(found)) or _together(wheels)
    if found:
        raise ConfigError(found)
    if args.json:
        dumped = [configuration.model_dump(mode="json") for _, configuration in wheels]
        if len(wheels) == 1:
            print_json({"schema": "rw_ekf.configuration/1", "configuration": dumped[0]})
        else:
            print_json({"schema": "rw_ekf.bus_configuration/1", "wheels": [{"configuration": one} for one in dumped]})
        return 0
    for document, configuration in wheels:
        if len(wheels) > 1:
            sys.stdout.write(f"# {configuration.wheel.name}\n")
        sys.stdout.write(resolved_lines(configuration, document))
    return 0


def _of_maps(document: YamlDocument) -> list[str]:
    """What is wrong in the wire maps of a configuration that cannot be used as it is."""
    from rw_ekf.attach.wire import load_protocol
    from rw_ekf.errors import ConfigError
    from rw_ekf.settings.load import protocols_named

    found = []
    for name in protocols_named(document):
        try:
            load_protocol(name)
        except ConfigError as error:
            found += error.findings
    return found


def _beyond(document: YamlDocument, configuration: Configuration) -> list[str]:
    """What is wrong with one wheel that only its wire map, its model or the effects' catalogue can show."""
    from rw_ekf.attach.simulated import plant_of
    from rw_ekf.attach.wire import beyond_wire, spoken_by
    from rw_ekf.errors import BadInputError, ConfigError

    found = []
    try:
        wire = spoken_by(configuration).limits
        found += [f"{document.where(keys)}: {text}" for keys, text in beyond_wire(configuration, wire)]
    except ConfigError as error:
        place = f"{document.where(('wheel', 'address'))}: "
        found += [place + text if text.startswith("wheel.address") else text for text in error.findings]
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
    return found


def _together(wheels: list[tuple[YamlDocument, Configuration]]) -> list[str]:
    """What keeps wheels from sharing their line, and what a line is too slow for."""
    from rw_ekf.attach.wire import beyond_line, beyond_rate, spoken_by

    configurations = [configuration for _, configuration in wheels]
    protocols = [spoken_by(configuration) for configuration in configurations]
    alone = len(wheels) == 1
    found = ([] if alone else beyond_line(configurations, protocols)) or beyond_rate(configurations, protocols)
    return [f"{wheels[index][0].where(keys)}: {text}" for index, keys, text in found]
