"""Of the cases of a test, those that the quick tests run: `make test-slow` runs the others."""

from collections.abc import Iterable
from typing import Any

import pytest


def quick(cases: Iterable[Any], *chosen: Any) -> list[Any]:
    """The cases of a parametrised test, of which those that are not chosen are marked as slow."""
    cases = list(cases)
    assert all(each in cases for each in chosen), "a case was chosen that there is not"
    return [
        case if case in chosen else pytest.param(*(case if isinstance(case, tuple) else [case]), marks=pytest.mark.slow)
        for case in cases
    ]
