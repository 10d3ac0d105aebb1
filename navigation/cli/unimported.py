"""Classes that are read in their files and not imported, as importing them takes seconds."""

import ast
from functools import cache
from importlib.util import find_spec
from pathlib import Path


def class_at(location: str) -> ast.ClassDef:
    """The class at a location, `package.module:Class`, of this package."""
    module, _, name = location.partition(":")
    (found,) = (each for each in _syntax(module).body if isinstance(each, ast.ClassDef) and each.name == name)
    return found


@cache
def _syntax(module: str) -> ast.Module:
    spec = find_spec(module)
    assert spec is not None
    assert spec.origin is not None
    return ast.parse(Path(spec.origin).read_text(encoding="utf-8"))
