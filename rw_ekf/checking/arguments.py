"""What a function of the library was given, held against a model as the sections of a file are."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TypeVar

from pydantic import ValidationError

from rw_ekf.checking.findings import validation_findings
from rw_ekf.checking.section import Section
from rw_ekf.errors import BadInputError

Held = TypeVar("Held", bound=Section)


def arguments(model: type[Held], given: Mapping[str, object], of: str) -> Held:
    """The arguments of what is called `of`, by name, numpy's numbers and arrays as Python's.

    Raises BadInputError with a sentence on each that cannot be.
    """
    plain = {name: value.tolist() if hasattr(value, "tolist") else value for name, value in given.items()}
    try:
        return model.model_validate(plain)
    except ValidationError as error:
        raise BadInputError("; ".join(validation_findings(model, error, lambda _: of, lambda _: of))) from None
