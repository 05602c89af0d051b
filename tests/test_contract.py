"""docs/contract.md says what the code does: every list on that page is compared with the code's own."""

from __future__ import annotations

import argparse
import re

import pytest

from rw_ekf.checking.yaml_loader import load_yaml
from rw_ekf.cli import build_parser
from rw_ekf.effects.catalogue import CATALOGUE
from rw_ekf.errors import BadInputError, RwEkfError
from rw_ekf.log_replay import REASONS
from rw_ekf.logs.log_columns import LOG_COLUMNS
from rw_ekf.logs.writer import estimate_columns
from rw_ekf.model.state import STATE_NAMES, STATE_UNITS
from rw_ekf.settings.resources import config_resource
from rw_ekf.settings.schema import SECTIONS
from tests.contract import check_document, examples, quoted, rows, section


def indented(title: str) -> list[str]:
    """The lists of names that stand indented in a section, each without its blanks."""
    blocks = re.findall(r"(?:^ {4}.+\n)+", section(title), re.MULTILINE)
    return [re.sub(r"\s+", "", block) for block in blocks]


def every_error(error: type[RwEkfError]) -> set[type[RwEkfError]]:
    """A class of errors and all that come from it."""
    return {error}.union(*map(every_error, error.__subclasses__()))


def test_the_state_has_the_contract_s_names_units_and_order() -> None:
    """The table of symbols is the state vector."""
    shown = [(quoted(row[1])[0], row[2]) for row in rows("Symbols and units")]
    assert shown == [(name, STATE_UNITS[name]) for name in STATE_NAMES]


def test_logs_and_estimates_have_the_contract_s_columns() -> None:
    """Both lists of columns are those that the writers use, and every reason for a sample is named."""
    log, estimates = indented("Logs")
    assert log.split(",") == list(LOG_COLUMNS)
    state = ",".join(STATE_NAMES)
    spelt = estimates.replace("std_STATE", ",".join(f"std_{name}" for name in STATE_NAMES)).replace("STATE", state)
    assert spelt.split(",") == list(estimate_columns())
    assert {reason for reason in REASONS if reason} <= set(quoted(section("Logs")))


def test_the_command_line_has_the_contract_s_verbs_and_options() -> None:
    """Verbs in their order, and every option of each but --help, --json, --verbose and what is hidden."""
    (verbs,) = [a for a in build_parser()._actions if isinstance(a, argparse._SubParsersAction)]
    shown = {}
    for cells in rows("Command line"):
        if len(cells) == 3:
            shown[quoted(cells[0])[0].split()[0]] = set(" ".join(quoted(cells[2])).split())
    found = {}
    for verb, parser in verbs.choices.items():
        options = {a.option_strings[-1] for a in parser._actions if a.option_strings and a.help != argparse.SUPPRESS}
        found[verb] = options - {"--help", "--json", "--verbose"}
    assert found == shown
    assert list(found) == list(shown)


def test_errors_end_with_the_contract_s_statuses() -> None:
    """Bad input is status 2, failed work 1; no error of the package has another status, or a kind that is not shown."""
    of_classes = {error.kind for error in every_error(RwEkfError)}
    assert {quoted(row[0])[0] for row in rows("Error")} == of_classes | {"system", "memory", "interrupted"}
    assert [row[0] for row in rows("Command line") if len(row) == 2] == ["0", "1", "2", "3", "4", "5", "130"]
    assert {error.exit_status for error in every_error(BadInputError)} == {2}
    assert {error.exit_status for error in every_error(RwEkfError) - every_error(BadInputError)} == {1}


def test_the_ids_of_effects_are_the_catalogue() -> None:
    """The contract lists the ids of the catalogue, in its order."""
    assert quoted(section("Effects").split("\n\n")[1]) == list(CATALOGUE)


def test_the_registers_are_those_of_the_shipped_wire_map() -> None:
    """Id, name, and of each field name, type, and scale with unit: as config/sunspace-wheel.yaml has them."""
    data = load_yaml(config_resource("sunspace-wheel")).data
    found = {}
    for register in data["registers"]:
        fields = []
        for field in register["fields"]:
            step = f", {field.get('scale', 1):g} {field['unit']}" if "unit" in field else ""
            fields.append(f"`{field['name']}` {field['type']}{step}")
        found[str(register["id"])] = (register["name"], fields)
    shown = {row[0]: (quoted(row[1])[0], row[2]) for row in rows("Wire protocol")}
    assert shown.keys() == found.keys()
    for number, (name, fields) in found.items():
        assert shown[number][0] == name
        assert len(quoted(shown[number][1])) == len(fields)
        for field in fields:
            assert field in shown[number][1], (number, field)


def test_the_configuration_has_the_contract_s_keys() -> None:
    """Sections and keys in the order of the schema."""
    shown = {quoted(row[0])[0]: quoted(row[1]) for row in rows("Configuration")}
    assert shown == {name: list(model.model_fields) for name, model in SECTIONS.items()}


def test_a_document_that_is_not_as_shown_is_found() -> None:
    """The check itself: an example passes, one key more or less at any depth does not."""
    for schema in ("rw_ekf.replay/1", "rw_ekf.diagnosis/1", "rw_ekf.state/1"):
        for example in examples(schema):
            check_document(example)
            with pytest.raises(AssertionError):
                check_document({**example, "more": 1})
    spoilt = {**examples("rw_ekf.diagnosis/1")[0], "verdict": {"kind": "effect"}}
    with pytest.raises(AssertionError, match="statement"):
        check_document(spoilt)
