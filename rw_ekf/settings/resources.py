"""Files that the project ships in config/: found in a source checkout and in an installed package alike."""

from __future__ import annotations

import os
from collections.abc import Iterable
from pathlib import Path

from rw_ekf.errors import ConfigError

CONFIGURATIONS = ("example", "simulated", "bus")  # those of the shipped files that are configurations
_PACKAGE = Path(__file__).resolve().parent.parent


def config_directory() -> Path:
    """Directory of the shipped YAML files. Raises ConfigError if the installation lacks it."""
    installed = _PACKAGE / "_config"  # pyproject force-includes config/ there
    if installed.is_dir():
        return installed
    checkout = _PACKAGE.parent / "config"
    # A stray directory called config beside site-packages is not ours: a checkout also has the pyproject file.
    if checkout.is_dir() and (_PACKAGE.parent / "pyproject.toml").is_file():
        return checkout
    raise ConfigError(f"{installed}: the shipped configuration files are missing; install the package again")


def available_wire_maps() -> list[str]:
    """Names of the shipped files that are wire maps, sorted: each says `registers`, or a family."""
    named = ((path.stem, path.read_text(encoding="utf-8")) for path in config_directory().glob("*.yaml"))
    return sorted(name for name, text in named if any(f"\n{key}:" in text for key in ("registers", "family")))


def available_resources() -> list[str]:
    """Names (without .yaml) of the shipped files, sorted."""
    return sorted(path.stem for path in config_directory().glob("*.yaml"))


def config_resource(name: str) -> Path:
    """Path of the shipped file `name` (".yaml" may be left out). Raises ConfigError listing the available names."""
    file_name = name if name.endswith(".yaml") else f"{name}.yaml"
    path = config_directory() / file_name
    if Path(file_name).name != file_name or not os.path.isfile(path):
        names = ", ".join(available_resources()) or "none"
        raise ConfigError(f"no shipped file is called {name!r}; available: {names}")
    return path


def own_or_shipped(name: str | Path, shipped: Iterable[str]) -> Path:
    """Take a file as it is named; where none is called so here, a bare name stands for one of `shipped`.

    ".yaml" may be left out of either. Raises ConfigError where a bare name is neither.
    """
    text = str(name)
    if os.path.basename(text) != text:
        return Path(name)
    for own in (text, f"{text}.yaml"):
        if os.path.exists(own) and not os.path.isdir(own):  # a folder called `simulated` is no configuration
            return Path(own)
    known = list(shipped)
    if text.removesuffix(".yaml") in known:
        return config_resource(text)
    if os.path.exists(text):
        return Path(name)  # a folder, of which its reader speaks
    raise ConfigError(f"{text}: no such file here, and the program ships {', '.join(known)}")


def is_path(text: str) -> bool:
    """Whether a protocol is meant as a path: it has a slash or ends in .yaml or .yml."""
    return "/" in text or text.endswith((".yaml", ".yml"))


def protocol_path(protocol: str) -> Path:
    """Find the wire map: `protocol` is a name from config/ or a path. Raises ConfigError if there is no such file."""
    if not is_path(protocol):
        maps = available_wire_maps()
        if protocol in maps:
            return config_resource(protocol)
        raise ConfigError(f"no shipped wire map is called {protocol!r}; give a path, or one of: {', '.join(maps)}")
    path = Path(os.path.expanduser(protocol))
    if os.path.isfile(path):  # false also for what no file can be called
        return path
    raise ConfigError(f"{protocol}: no such wire map; give a path, or one of: {', '.join(available_wire_maps())}")
