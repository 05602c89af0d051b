"""Pages and pictures of words from templates: whatever is put into one is escaped."""

from __future__ import annotations

import base64
import functools
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined

FOLDER = Path(__file__).parent / "templates"
_CODE = re.compile(r"`([^`]+)`")
_MEDIA = {"png": "image/png", "svg": "image/svg+xml"}


def rendered(name: str, values: Mapping[str, Any], folder: Path = FOLDER) -> str:
    """The text that a template makes of values; folder: where it is, beside those that all share."""
    return _environment(folder).get_template(name).render(values)


@functools.cache
def _environment(folder: Path) -> Environment:
    environment = Environment(
        loader=FileSystemLoader([folder, FOLDER]),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    environment.filters |= {"parts": prose_parts, "data_address": data_address}
    return environment


def prose_parts(text: str) -> list[tuple[bool, str]]:
    """(whether it is code, words) of a sentence with code in backticks; +- and -> as signs."""
    signs = text.replace(" +- ", "\u00a0±\u00a0").replace("->", "→")
    return [(number % 2 == 1, part) for number, part in enumerate(_CODE.split(signs)) if part]


def data_address(content: bytes, name: str) -> str:
    """A picture as an address that needs no file; name: of its file."""
    return f"data:{_MEDIA[name.rsplit('.', 1)[-1]]};base64,{base64.b64encode(content).decode('ascii')}"
