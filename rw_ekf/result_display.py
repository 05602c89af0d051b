"""What every result has in common: a document, a text for people, and how a notebook shows it."""

from __future__ import annotations

from abc import ABC, abstractmethod
from html import escape
from typing import Any

from rw_ekf.json_output import json_text


class Shown(ABC):
    """A result of the library."""

    @abstractmethod
    def document(self) -> dict[str, Any]:
        """The JSON document of the command (docs/contract.md#documents)."""

    @abstractmethod
    def text(self) -> str:
        """What the command prints."""

    def to_json(self) -> str:
        """The document as the command prints it."""
        return json_text(self.document())

    def _repr_html_(self) -> str:
        return f"<pre>{escape(self.text())}</pre>"
