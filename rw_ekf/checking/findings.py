"""Plain words for what pydantic finds: `file:line:column: section.key ...`, what was found, and what to do."""

from __future__ import annotations

import difflib
from collections.abc import Callable, Mapping
from typing import Any, TypeVar, get_args

from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

from rw_ekf.checking.section import STATED, Section
from rw_ekf.checking.wording import shown, suggestion
from rw_ekf.checking.yaml_loader import PathTuple, YamlDocument
from rw_ekf.errors import ConfigError

Where = Callable[[PathTuple], str]  # ("registers", 3, "id") -> "file:line:column"
Checked = TypeVar("Checked", bound=BaseModel)

_BOUNDS = {
    "greater_than": ("gt", "above"),
    "greater_than_equal": ("ge", "at least"),
    "less_than": ("lt", "below"),
    "less_than_equal": ("le", "at most"),
}
_KINDS = {
    "float_type": "a number",
    "int_type": "a whole number",
    "int_from_float": "a whole number",
    "string_type": "text",
    "bool_type": "true or false",
    "tuple_type": "a list",
    "list_type": "a list",
    "model_type": "a table of keys",
    "dict_type": "a table of keys",
    "finite_number": "a finite number",
}
_KEY = "[key]"  # what pydantic adds to the path where the key of an entry is at fault, not its value


def checked(model: type[Checked], data: object, what: str, where: Where, where_key: Where | None = None) -> Checked:
    """Hold plain data against a model; `what` names the whole in words, `where_key` places keys where `where` does not.

    Raises ConfigError with one finding for each mistake.
    """
    try:
        return model.model_validate(data)
    except ValidationError as error:
        if not isinstance(data, Mapping):
            known = ", ".join(model.model_fields)
            raise ConfigError(f"{where(())}: {what} must be a table of {known}; found {shown(data)}") from None
        raise ConfigError(validation_findings(model, error, where, where_key or where)) from None


def validated_sections(
    document: YamlDocument, data: Mapping[str, Any], models: Mapping[str, type[Section]]
) -> tuple[dict[str, Section], list[str]]:
    """The sections of `data` that hold, by name, and one line for each mistake in the others.

    A section written with nothing under it is the same as one left out: all defaults.
    """
    findings = [
        f"{document.where_key((name,))}: unknown section {name}; {suggestion(name, models)}"
        for name in data
        if name not in models
    ]
    sections: dict[str, Section] = {}
    for name, model in models.items():
        try:
            sections[name] = model.model_validate({} if data.get(name) is None else data[name])
        except ValidationError as error:
            findings += validation_findings(model, error, document.where, document.where_key, (name,))
    return sections, findings


def validation_findings(
    model: type[BaseModel], error: ValidationError, where: Where, where_key: Where, prefix: PathTuple = ()
) -> list[str]:
    """One line for each mistake that pydantic found in what stands at `prefix`, held against `model`."""
    return [_finding(model, detail, where, where_key, prefix) for detail in error.errors(include_url=False)]


def _finding(model: type[BaseModel], detail: ErrorDetails, where: Where, where_key: Where, prefix: PathTuple) -> str:
    kind, loc, found = detail["type"], detail["loc"], detail["input"]
    unknown = kind in {"extra_forbidden", "invalid_key"}
    of_key = bool(loc) and loc[-1] == _KEY and not unknown
    if of_key:
        loc, where = loc[:-1], where_key
    path = (*prefix, *loc)
    key = ("the key of " if of_key else "") + ".".join(str(part) for part in path)
    if unknown:
        holder, _ = _described(model, loc[:-1])
        return f"{where_key(path)}: unknown key {key}; {suggestion(path[-1], holder.model_fields if holder else ())}"
    _, description = _described(model, loc)
    if kind == "missing":
        meaning = f": {description}" if description else ""
        return f"{where_key(path)}: {key} is required{meaning}; there is no default"
    meaning = f" ({description})" if description and kind != STATED else ""
    return f"{where(path)}: {key}{' ' if key else ''}{_fault(kind, found, detail)}{meaning}"


def _fault(kind: str, found: object, detail: ErrorDetails) -> str:
    context: dict[str, Any] = detail.get("ctx", {})
    if kind == STATED:
        return detail["msg"]
    if kind in _BOUNDS:
        name, words = _BOUNDS[kind]
        return f"must be {words} {context[name]:g}, found {shown(found)}"
    if kind in _KINDS:
        return f"must be {_KINDS[kind]}, found {shown(found)}"
    if kind == "literal_error":
        choices = str(context["expected"]).replace(" or ", ", ").replace("'", "").split(", ")
        near = difflib.get_close_matches(str(found), choices, n=1)
        hint = f"; did you mean '{near[0]}'?" if near else ""
        return f"must be one of {', '.join(choices)}; found {shown(found)}{hint}"
    if kind == "string_too_short":
        return "must not be empty"
    if kind in {"too_short", "too_long"}:
        bound = f"at least {context['min_length']}" if kind == "too_short" else f"at most {context['max_length']}"
        return f"must have {bound} entries, found {context['actual_length']}"
    if kind == "value_error":
        return f"is not understood, found {shown(found)}: {context.get('error', '')}"
    return f"is not accepted ({detail['msg']}), found {shown(found)}"


def _described(model: type[BaseModel], loc: PathTuple) -> tuple[type[BaseModel] | None, str]:
    """Model that stands at `loc`, if one does, and the description of its last key (or of the list it is in)."""
    current: type[BaseModel] | None = model
    description = ""
    for part in loc:
        if isinstance(part, int):
            continue
        info = current.model_fields.get(part) if current is not None else None
        description = (info.description or "") if info is not None else ""
        current = _model_of(info.annotation) if info is not None else None
    return current, description


def _model_of(annotation: Any) -> type[BaseModel] | None:
    """Give the model in an annotation such as `list[PriorSection] | None`; None where there is none."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    return next((model for part in get_args(annotation) if (model := _model_of(part)) is not None), None)
