"""Specs: a text and what it stands for are inverse to each other, and an invalid text is refused with its reason."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tussock.navigation.steering import NAVIGATORS
from tussock.world.errors import SettingError
from tussock.world.specs import (
    Spec,
    format_spec,
    own_parameters,
    parse_spec,
    parse_value,
    split_list,
    split_words,
)


class Thing:
    """Something with a parameter of each kind."""

    def __init__(
        self,
        cells: int = 10,
        rate: float = 0.5,
        rule: str = "hebb",
        layers: tuple[int, ...] = (3, 4),
        weights: tuple[float, ...] = (0.5,),
        units: int | None = None,
        fast: bool = False,
        seed: int = 0,
    ):
        self.values = {"cells": cells, "rate": rate, "rule": rule, "layers": layers, "weights": weights}
        self.values |= {"units": units, "fast": fast}
        self.seed = seed


def find(name: str) -> Any:
    return {"thing": Thing, "anything": lambda **parameters: parameters, "needs": lambda size: size, "number": 3}[name]


finite = st.floats(allow_nan=False, allow_infinity=False)
VALUES = {
    "cells": st.integers(-(10**17), 10**17),
    "rate": finite,
    "rule": st.sampled_from(["hebb", "delta", "a-b"]),
    "layers": st.lists(st.integers(-99, 10**9), max_size=4).map(tuple),
    "weights": st.lists(finite, max_size=4).map(tuple),
    "units": st.none() | st.integers(0, 10**9),
    "fast": st.booleans(),
}


@given(st.fixed_dictionaries({}, optional=VALUES))
def test_a_formatted_spec_is_read_as_itself(parameters):
    text = format_spec("thing", parameters)
    spec = parse_spec(text, find)
    made = spec.make().values
    assert made == Thing(**parameters).values
    assert [type(value) for value in made.values()] == [type(value) for value in Thing(**parameters).values.values()]
    assert parse_spec(str(spec), find) == spec


def test_parameters_that_equal_their_defaults_are_left_out():
    assert str(parse_spec("thing cells=10 rate=0.7 layers=(3,4)", find)) == "thing rate=0.7"


def test_a_spec_makes_the_object_with_the_reserved_parameters_that_it_takes():
    spec = parse_spec("thing cells=3", find)
    assert spec.make(seed=5, device="cpu").seed == 5  # a Thing takes no device
    assert parse_spec("anything a=1", find).make(seed=5) == {"a": 1, "seed": 5}
    assert list(own_parameters(Thing)) == list(VALUES)


@pytest.mark.parametrize(
    ("text", "parts"),
    [
        ("thing colour=red", ("thing has no parameter 'colour'", "cells, rate")),
        ("thing seed=3", ("seed", "seed=")),
        ("thing device=cuda", ("device", "device=")),
        ("thing 3", ("'3'", "name=value")),
        ("thing rate = 3", ("'rate'", "name=value")),
        ("thing rate=", ("'rate='", "name=value")),
        ("thing =3", ("'=3'", "name=value")),
        ("thing cells=3 cells=4", ("cells is given twice",)),
        ("number", ("'number'", "not a class or function")),
    ],
)
def test_an_invalid_spec_is_refused_with_what_is_wrong(text, parts):
    with pytest.raises(SettingError) as refusal:
        parse_spec(text, find)
    assert all(part in str(refusal.value) for part in parts), refusal.value


@pytest.mark.parametrize(
    ("spec", "more", "part"),
    [
        (parse_spec("needs", find), {}, "missing a required argument: 'size'"),
        (parse_spec("needs size=3", find), {"size": 4}, "multiple values"),
        (parse_spec("thing", find), {"colour": "red"}, "'colour'"),
    ],
)
def test_an_object_that_cannot_be_made_is_refused_with_its_spec(spec, more, part):
    with pytest.raises(SettingError, match=part) as refusal:
        spec.make(**more)
    assert repr(str(spec)) in str(refusal.value)


@pytest.mark.parametrize(
    ("text", "default", "value"),
    [
        ("3", 0.5, 3.0),
        ("3", 5, 3),
        ("3", None, 3),
        ("3.5", 5, 3.5),
        ("1e-2", None, 0.01),
        ("none", 5, None),
        ("true", False, True),
        ("100,50", (1,), (100, 50)),
        ("(100, 50)", (1,), (100, 50)),
        ("(100,)", (1,), (100,)),
        ("100", (1,), (100,)),
        ("-45", (0.5,), (-45.0,)),
        ("()", (1,), ()),
        ("1,2", 5, (1, 2)),
        ("fast", 0.5, "fast"),
        ("9" * 400, 5, float("inf")),
    ],
)
def test_a_value_is_read_by_its_default(text, default, value):
    read = parse_value(text, default)
    assert read == value
    assert type(read) is type(value)


@pytest.mark.parametrize(
    ("text", "parts"),
    [
        ("a,b", ["a", "b"]),
        (" a , b c=1 ", ["a", "b c=1"]),
        ("a x=(1,2),b", ["a x=(1,2)", "b"]),
        ("a x=(1, 2) y=(3,4), b", ["a x=(1, 2) y=(3,4)", "b"]),
        ("a x=1,2", ["a x=1", "2"]),
        ("", [""]),
        ("a,", ["a", ""]),
    ],
)
def test_a_list_is_split_at_commas_outside_parentheses(text, parts):
    assert split_list(text) == parts


def test_words_are_split_at_white_space_outside_parentheses():
    assert split_words("  a\tx=(1, 2)  y=3\n") == ["a", "x=(1, 2)", "y=3"]
    assert split_words(" ") == []


def test_a_spec_without_parameters_is_its_name():
    assert str(Spec("thing", Thing)) == "thing"


def test_one_angle_in_degrees_is_one_of_several():
    assert NAVIGATORS.spec("lateral bank_deg=45").make(model=None).bank == (pytest.approx(np.pi / 4),)
