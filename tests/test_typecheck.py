"""The type checker of the tests: shapes and types of arguments and results are checked as jaxtyping checks them."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import pytest
import typecheck
from jaxtyping import Float, TypeCheckError

FLAT, WIDE = np.zeros(3), np.zeros((3, 4))


def checked(function):
    return typecheck.jaxtyped(typechecker=typecheck.check)(function)


@checked
def sizes(a: Float[np.ndarray, "h w"], b: Float[np.ndarray, "w h"] | None = None) -> Float[np.ndarray, " w"]:
    return np.zeros(3) if b is None else a[0]


@checked
def wide(width: int) -> Float[np.ndarray, " {width}"]:
    return np.zeros(4)


@checked
def half(number: float, of: "float | None" = None, unknown: "GoneBefore | None" = None) -> str:  # noqa: F821
    return str(number) if of is None else number / of


@checked
def each(numbers: list[int]) -> Iterator[int]:
    yield from numbers


@checked
@dataclass
class Pair:
    left: Float[np.ndarray, " n"]
    right: Float[np.ndarray, " n"]


def test_what_fits_is_let_through():
    assert sizes(WIDE, WIDE.T).shape == (4,)
    assert sizes(WIDE.T).shape == (3,)
    assert wide(4).shape == (4,)
    assert half(1) == "1"  # an int is a float
    assert half(1, unknown="anything") == "1"
    assert list(each([1, 2])) == [1, 2]
    assert Pair(FLAT, FLAT).left is FLAT


@pytest.mark.parametrize(
    "call",
    [
        lambda: sizes(FLAT),
        lambda: sizes(WIDE.astype(int)),
        lambda: sizes(WIDE, WIDE),  # each fits by itself, not together
        lambda: sizes(WIDE),  # the result does not fit the argument
        lambda: wide(3),
        lambda: half("1"),
        lambda: half(1, "2"),
        lambda: half(1, 2),  # where a str is wanted
        lambda: each(3),
        lambda: Pair(FLAT, np.zeros(4)),
    ],
)
def test_what_does_not_fit_is_refused(call):
    with pytest.raises(TypeCheckError):
        call()


def test_the_axes_of_one_call_are_not_those_of_another():
    @checked
    def outer(a: Float[np.ndarray, "h w"]) -> Float[np.ndarray, " h"]:
        assert sizes(WIDE, WIDE.T).shape == (4,)  # in which h and w are others
        return a[:, 0]

    assert outer(np.zeros((7, 2))).shape == (7,)


def test_the_package_is_checked_while_tests_run():
    from tussock.world.geometry import column_azimuths

    with pytest.raises(TypeCheckError):
        column_azimuths("wide")
