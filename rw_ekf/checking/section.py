"""What the models of all files share: strictness, and validators that say more than a type can."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable
from typing import Any

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, ValidationError
from pydantic_core import InitErrorDetails, PydanticCustomError, PydanticKnownError

from rw_ekf.checking.yaml_loader import PathTuple

Mistake = tuple[PathTuple, str]  # a path below what is validated, and the words that follow the key

STATED = "said"  # kind of a mistake that brings its own words


class Section(BaseModel):
    """What all sections share: unknown keys refused, strict types, finite numbers, no change after loading."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False, protected_namespaces=())


def refuse(mistakes: Iterable[Mistake]) -> None:
    """Raise, in a validator, all that it found; nothing where it found nothing."""
    details = [
        InitErrorDetails(type=PydanticCustomError(STATED, "{words}", {"words": words}), loc=path, input=None)
        for path, words in mistakes
    ]
    if details:
        raise ValidationError.from_exception_data("", details)


def one_of(names: Iterable[str] | Callable[[], Iterable[str]]) -> BeforeValidator:
    """Give the validator of a text that must be one of `names`, where they are known at run time only.

    names: or what finds them, which is called when there is a text.
    """

    def check(value: Any) -> Any:
        known = tuple(names() if callable(names) else names)
        if isinstance(value, str) and value in known:
            return value
        raise PydanticKnownError("literal_error", {"expected": ", ".join(known)})

    return BeforeValidator(check)


def matching(pattern: str, advice: str) -> AfterValidator:
    """Give the validator of a text that a pattern must match whole; advice: what to write, where it does not."""
    known = re.compile(pattern)

    def check(text: str) -> str:
        if not known.fullmatch(text):
            raise ValueError(advice)
        return text

    return AfterValidator(check)


def _not_null(value: Any) -> Any:
    if value is None:
        refuse([((), "is written with nothing behind it: give a value, or leave it out")])
    return value


NOT_NULL = BeforeValidator(_not_null)  # of a key that may be left out, but not be null
