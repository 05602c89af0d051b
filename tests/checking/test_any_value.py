"""Any value in place of any key: a wire map, a column map or a model is used, or refused in words with a place."""

from __future__ import annotations

import copy
import re
from collections.abc import Callable
from typing import Any

import pytest
import yaml
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from rw_ekf.checking.yaml_loader import YamlDocument, parse_yaml
from rw_ekf.drivers.protocols import protocol_of
from rw_ekf.errors import ConfigError
from rw_ekf.logs.column_map_file import column_map_from
from rw_ekf.settings.load import configuration_from
from rw_ekf.settings.resources import config_resource
from rw_ekf.wheel.model_file import model_from_data
from rw_ekf.wheel.wheel_tag import WheelTag
from tests.wheel.test_model_file import model_with, pair

_PLACE = re.compile(r"f\.yaml:\d+:\d+: ")
_COLUMNS = """
delimiter: ";"
skip_rows: 3
header: false
decimate: 10
reverse: true
variable: data
layout: cells
time_s: {column: t, scale: 0.001, offset: 1.0}
speed_rad_s: {derivative_of: x, wrap: 65536}
current_A: {column: 3, sign_of: direction}
temperature_degC: {constant: 20.0}
"""
_MODEL = model_with(pair("torque_ripple", 0.1, 0.2)).document() | {
    "wheel": WheelTag(17, 6, 1, "sunspace-wheel", "ab", "/dev/ttyUSB0", sign_confirmed=True).document(),
    "inertia_from": "assumed",
}
CHECKS: dict[str, tuple[Any, Callable[[YamlDocument], object]]] = {
    "wire map": (
        yaml.safe_load(config_resource("sunspace-wheel").read_text(encoding="utf-8")) | {"family": "registers"},
        lambda document: protocol_of(document.data, document.where),
    ),
    "column map": (yaml.safe_load(_COLUMNS), column_map_from),
    "model": (_MODEL, lambda document: model_from_data(document.data, document.where)),
    "configuration": (
        {"wheel": {"port": "x", "baud": 9600}, "limits": {"current_A": 0.1}, "simulation": {"effects": ["cubic_drag"]}},
        configuration_from,
    ),
}
_WORDS = st.sampled_from(["", "none", "rpm", "column", "v", "1e-5", "current_command", "[key]", "{words}", "\t"])
_NUMBERS = st.one_of(st.integers(), st.sampled_from([2**63, 10**299]), st.floats(allow_nan=False, allow_infinity=False))
_VALUES = st.recursive(
    st.one_of(st.none(), st.booleans(), _NUMBERS, _WORDS),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(_WORDS | st.integers(0, 300), inner, max_size=3),
    max_leaves=8,
)


def tables(data: Any) -> list[Any]:
    """Every table and list in plain data, itself included."""
    inside = data.values() if isinstance(data, dict) else data if isinstance(data, list) else None
    return [] if inside is None else [data, *(table for value in inside for table in tables(value))]


@st.composite
def spoilt(draw: st.DrawFn, good: Any) -> Any:
    """The data with values of one to three keys replaced, taken out, or put in under any name."""
    data = copy.deepcopy(good)
    for _ in range(draw(st.integers(1, 3))):
        table = draw(st.sampled_from(tables(data)))
        keys = list(table) if isinstance(table, dict) else list(range(len(table)))
        key = draw(st.sampled_from(keys)) if keys else None
        if isinstance(table, dict) and (key is None or draw(st.integers(0, 4)) == 0):
            key = draw(_WORDS | st.integers(0, 300))
        if key is not None:
            table[key] = draw(_VALUES)
            if key in keys and draw(st.integers(0, 4)) == 0:
                del table[key]
    return data


@pytest.mark.parametrize("name", CHECKS)
def test_any_value_is_used_or_refused_with_its_place(name: str) -> None:
    """No traceback and no warning, whatever stands where; every finding begins with file, line and column."""
    good, check = CHECKS[name]
    check(parse_yaml(yaml.safe_dump(good), "f.yaml"))

    @settings(max_examples=400, deadline=None, suppress_health_check=list(HealthCheck), derandomize=True)
    @given(spoilt(good))
    def holds(data: Any) -> None:
        try:
            check(parse_yaml(yaml.safe_dump(data), "f.yaml"))
            return
        except ConfigError as error:
            findings = error.findings
        assert findings
        assert all(_PLACE.match(finding) for finding in findings), findings

    holds()
