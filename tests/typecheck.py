"""Shapes and types in signatures are checked while the tests run, by beartype: int is accepted where float is asked for, as PEP 484 has it.

jaxtyping's import hook writes `@jaxtyping.jaxtyped(typechecker=..)` above each function. What jaxtyping makes of it binds the arguments
anew at each call and checks them twice, which took more time than what is tested. `jaxtyped` below makes the same checks of the same
annotations in one pass, where it can.
"""

import functools
import inspect
import typing
from collections.abc import Callable
from typing import Any

import jaxtyping
from beartype import BeartypeConf, beartype

check = beartype(conf=BeartypeConf(is_pep484_tower=True, violation_type=jaxtyping.TypeCheckError))

_jaxtyped = jaxtyping.jaxtyped
SHAPES = _jaxtyped("context")  # within it, the axes of one call have one length each


def parts(annotation: Any) -> list[Any]:
    """An annotation and all that it is made of."""
    inner = annotation if isinstance(annotation, list) else typing.get_args(annotation)
    return [annotation, *(part for each in inner for part in parts(each))]


def resolved(annotation: Any, names: dict[str, Any]) -> Any:
    """An annotation with the names in its texts looked up; Any where one is not known yet, as jaxtyping has it."""

    def holder() -> None: ...

    holder.__annotations__ = {"it": annotation}
    try:
        return typing.get_type_hints(holder, names, include_extras=True)["it"]
    except Exception:
        return Any


def jaxtyped(fn: Any = None, *, typechecker: Callable) -> Any:
    """A function whose arguments and result are checked, in place of jaxtyping's decorator of this name.

    Left to jaxtyping: classes, generators, and shapes that hold the value of an argument ("{width}").
    """
    if fn is None:
        return functools.partial(jaxtyped, typechecker=typechecker)
    if not inspect.isfunction(fn) or inspect.isgeneratorfunction(fn):
        return _jaxtyped(fn, typechecker=typechecker)
    written = fn.__annotations__
    annotations = {name: resolved(each, fn.__globals__) for name, each in written.items()}
    shapes = [part.dim_str for each in annotations.values() for part in parts(each) if hasattr(part, "dim_str")]
    if any("{" in shape for shape in shapes):
        return _jaxtyped(fn, typechecker=typechecker)
    try:
        fn.__annotations__ = annotations
        checked = typechecker(fn)
    finally:
        fn.__annotations__ = written
    if not shapes:
        return checked

    @functools.wraps(fn)
    def with_shapes(*args: Any, **kwargs: Any) -> Any:
        with SHAPES:
            return checked(*args, **kwargs)

    return with_shapes


def install() -> None:
    """Check the package in each module that is imported from now on."""
    jaxtyping.jaxtyped = jaxtyped
    jaxtyping.install_import_hook(["tussock.world", "tussock.render", "tussock.navigation"], "typecheck.check")
