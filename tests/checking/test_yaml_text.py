"""YAML as it is written."""

from __future__ import annotations

from typing import Any

import pytest
import yaml

from rw_ekf.checking.yaml_text import yaml_text

MODEL: dict[str, Any] = {"default_flow_style": None, "width": 120}
DATA = {
    "covariance": [[1.2345678901234567e-5 * (i + 1) * (-1) ** j for j in range(9)] for i in range(9)],
    "text": [
        "a: b",
        "- x",
        "1e-5",
        "true",
        "null",
        "",
        " around ",
        "two\nlines",
        "long " * 60,
        "x" * 200,
        "#",
        "'",
        '"',
    ],
    "letters": "Rad für Ω – °C",
    "numbers": [0.1, -0.0, 1e300, 5e-324, 12, -7, True, None],
    "empty": [{}, []],
    "deep": {"list": [{"a": [1, {"b": [2.5]}]}]},
}


@pytest.mark.parametrize("options", [MODEL, {"allow_unicode": True}])
@pytest.mark.parametrize("has_libyaml", [True, False])
def test_the_text_is_that_of_plain_pyyaml(
    options: dict[str, Any], has_libyaml: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With libyaml or without it: the same characters, which read back as they were."""
    if not has_libyaml:
        monkeypatch.delattr(yaml, "CSafeDumper", raising=False)
    text = yaml_text(DATA, **options)
    assert text == yaml.safe_dump(DATA, sort_keys=False, **options)
    assert yaml.safe_load(text) == DATA
