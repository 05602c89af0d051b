"""Plain words for what pydantic finds: `file:line:column: section.key ...`, what was found, and what to do."""

from __future__ import annotations

import difflib
from collections.abc import Mapping
from typing import Any, get_args

from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

from rw_ekf.settings.schema import Section
from rw_ekf.settings.wording import shown, suggestion
from rw_ekf.settings.yaml_loader import PathTuple, YamlDocument

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
    "tuple_type": "a list",
    "list_type": "a list",
    "model_type": "a table of keys",
    "finite_number": "a finite number",
}


def validation_findings(
    document: YamlDocument, prefix: PathTuple, model: type[BaseModel], error: ValidationError
) -> list[str]:
    """One line per mistake that pydantic found in the part of `document` at `prefix`, checked against `model`."""
    return [_finding(document, prefix, model, detail) for detail in error.errors(include_url=False)]


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
            findings += validation_findings(document, (name,), model, error)
    return sections, findings


def _finding(document: YamlDocument, prefix: PathTuple, model: type[BaseModel], detail: ErrorDetails) -> str:
    path = (*prefix, *detail["loc"])
    key = ".".join(str(part) for part in path)
    parent, description = _described(model, detail["loc"])
    kind, found = detail["type"], detail["input"]
    meaning = f" ({description})" if description else ""
    if kind == "missing":
        return f"{document.where_key(path)}: {key} is required: {description}; there is no default"
    if kind == "extra_forbidden":
        known = list(parent.model_fields) if parent is not None else []
        return f"{document.where_key(path)}: unknown key {key}; {suggestion(path[-1], known)}"
    return f"{document.where(path)}: {key} {_fault(kind, found, detail)}{meaning}"


def _fault(kind: str, found: object, detail: ErrorDetails) -> str:
    context: dict[str, Any] = detail.get("ctx", {})
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


def _described(model: type[BaseModel], loc: tuple[int | str, ...]) -> tuple[type[BaseModel] | None, str]:
    """Model that holds the last key of `loc`, and the description of that key (or of the list it is in)."""
    current: type[BaseModel] | None = model
    parent, description = current, ""
    for part in loc:
        if isinstance(part, int):
            continue
        parent = current
        info = current.model_fields.get(part) if current is not None else None
        description = (info.description or "") if info is not None else ""
        current = _model_of(info.annotation) if info is not None else None
    return parent, description


def _model_of(annotation: Any) -> type[BaseModel] | None:
    """Give the model in an annotation such as `PriorSection | None`; None where there is none."""
    for candidate in (annotation, *get_args(annotation)):
        if isinstance(candidate, type) and issubclass(candidate, BaseModel):
            return candidate
    return None
