"""A function's Python as the printer reads it: its tree, its comments, and where the names in it got their values."""

from __future__ import annotations

import ast
import functools
import importlib
import inspect
import io
import sys
import textwrap
import tokenize
from collections.abc import Callable
from dataclasses import dataclass
from types import ModuleType
from typing import Any

from rw_ekf.c_code.c_types import NotPrintableError

_NO_WORDS = ("noqa", "fmt:", "type: ignore")


@dataclass(frozen=True)
class Source:
    """A function's tree, and its comments by their lines."""

    tree: ast.FunctionDef
    comments: dict[int, str]

    @property
    def docstring(self) -> str:
        """Without its indentation."""
        return ast.get_docstring(self.tree) or ""


@functools.cache
def source_of(function: Callable[..., Any]) -> Source:
    """The source of a plain function, or of one that `wheel.dispatch` has written out."""
    text = vars(function).get("source")
    text = textwrap.dedent(inspect.getsource(function)) if text is None else text
    tree = ast.parse(text).body[0]
    if not isinstance(tree, ast.FunctionDef):
        raise NotPrintableError(f"{function.__qualname__} is no plain function")
    return Source(tree, _comments(text))


def _comments(text: str) -> dict[int, str]:
    found: dict[int, str] = {}
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type == tokenize.COMMENT:
            stated = token.string.lstrip("# ").strip()
            if stated and not stated.startswith(_NO_WORDS):
                found[token.start[0]] = stated
    return found


@functools.cache
def _module_comments(module: ModuleType) -> tuple[ast.Module, dict[int, str]]:
    text = inspect.getsource(module)
    return ast.parse(text), _comments(text)


def origin_of(function: Callable[..., Any], name: str) -> tuple[ModuleType, str]:
    """(module, name there) in which a global name of a function got its value."""
    module = sys.modules[function.__module__]
    while True:
        tree, _ = _module_comments(module)
        for node in tree.body:
            if isinstance(node, ast.ImportFrom) and node.module:
                for alias in node.names:
                    if (alias.asname or alias.name) == name:
                        module, name = importlib.import_module(node.module), alias.name
                        break
                else:
                    continue
                break
        else:
            return module, name


def comment_of_constant(module: ModuleType, name: str) -> str:
    """What stands behind a constant of a module."""
    tree, comments = _module_comments(module)
    for node in tree.body:
        if isinstance(node, ast.Assign) and any(name in ast.unparse(target) for target in node.targets):
            return comments.get(node.lineno, "")
    return ""


def comments_of_members(kind: type[Any]) -> dict[str, str]:
    """What stands behind each member of a named tuple."""
    made_by: Callable[..., Any] = kind
    return _comments_of_members(made_by)


@functools.cache
def _comments_of_members(kind: Callable[..., Any]) -> dict[str, str]:
    text = textwrap.dedent(inspect.getsource(kind))
    tree, comments = ast.parse(text).body[0], _comments(text)
    assert isinstance(tree, ast.ClassDef)
    found = {}
    for node in tree.body:
        if isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name):
            found[node.target.id] = comments.get(node.lineno, "")
    return found
