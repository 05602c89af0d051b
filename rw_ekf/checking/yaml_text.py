"""YAML as it is written: by libyaml, where PyYAML was built with it, in a quarter of the time."""

from __future__ import annotations

from typing import Any


def yaml_text(data: Any, **options: Any) -> str:
    """The text of plain data; options: as `yaml.dump` takes them. Keys stay in their order."""
    import yaml  # here, for a program starts without it

    dumper = getattr(yaml, "CSafeDumper", yaml.SafeDumper)
    return str(yaml.dump(data, Dumper=dumper, sort_keys=False, **options))
