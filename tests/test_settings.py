"""Fields that check themselves: what they accept is kept, what they do not is refused with its name, value and range."""

import math
import pickle
from fractions import Fraction
from typing import Any, ClassVar

import attrs
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tussock.world.errors import FieldError, SettingError
from tussock.world.settings import (
    RGB,
    choice,
    colour,
    converted,
    describe,
    instance_of,
    number,
    numbers,
    settings,
    switch,
    text,
    whole,
    wholes,
)


@settings
class Body:
    step: float = number(0.05, above=0, high=2, unit="m")
    turn: float | None = number(1.0, low=-math.pi, high=math.pi, unit="rad", optional=True)
    rate: float | str = number("slow", low=0, names=("slow", "fast"))
    legs: int = whole(6, low=2, high=100, unit="legs")
    layers: tuple[int, ...] = wholes((3, 4), single=True)
    weights: tuple[float, ...] = numbers((0.5,), low=0, high=1)
    rgb: RGB = colour((1, 2, 3))
    gait: str = choice("tripod", ("tripod", "wave"))
    blind: bool = switch(False)
    label: str | None = text(None, optional=True)
    parent: Any = instance_of((dict, type(None)), None, "a dict or None")


ACCEPTED = {
    "step": (1e-300, 1, 2, np.float32(0.5), np.int64(1), Fraction(1, 4)),
    "turn": (None, -math.pi, 3),
    "rate": ("fast", 0, 1e300),
    "legs": (2, 100, np.int64(8)),
    "layers": (5, (5,), [1, 2, 3]),
    "weights": ((0, 1), [0.5, np.float64(0.25)]),
    "rgb": ((0, 255, 7), [np.uint8(4), 5, 6]),
    "gait": ("wave",),
    "blind": (True,),
    "label": ("an ant", "", None),
    "parent": ({},),
}
REFUSED = {
    "step": (0, 2.001, -1, math.nan, math.inf, 10**400, "1", True, None, np.array([0.5]), 1j),
    "turn": (3.2, "left", False),
    "rate": (-1, "medium", math.inf, None),
    "legs": (1, 101, 2.0, True, 10**400, "6", None),
    "layers": ((), (0,), (1, "2"), (True,), 0, 2.5, "5", 10**30),
    "weights": ((), 0.5, (0.5, 1.5), (math.nan,), (10**400,)),
    "rgb": ((1, 2), (1, 2, 3, 4), (1, 2, 256), (1, 2, -1), (1, 2, 2.5), 3, "red", (True, 1, 1)),
    "gait": ("gallop", "", None, 3, np.array(["wave", "wave"])),
    "blind": (0, 1, "yes", None),
    "label": ("two\nlines", "\0", 3, b"ant"),
    "parent": ([], 3),
}


def pairs(values: dict) -> dict:
    """The arguments of pytest.mark.parametrize for each field with each of its values."""
    return {
        "argnames": ("name", "value"),
        "argvalues": [(name, value) for name, each in values.items() for value in each],
        "ids": lambda value: repr(value)[:20],
    }


@pytest.mark.parametrize(**pairs(ACCEPTED))
def test_a_valid_value_is_kept(name, value):
    kept = getattr(Body(**{name: value}), name)
    assert kept == (tuple(value) if isinstance(value, list) else value)
    for each in kept if isinstance(kept, tuple) else [kept]:
        assert type(each) in (float, int, str, bool, dict, type(None))  # plain, so that JSON can hold it


@pytest.mark.parametrize(**pairs(REFUSED))
def test_an_invalid_value_is_refused_with_its_name_and_the_value(name, value):
    with pytest.raises(SettingError) as refusal:
        Body(**{name: value})
    message = str(refusal.value)
    assert message.startswith(f"Body: {name} is ")
    assert "; give " in message
    assert "\n" not in message


@pytest.mark.parametrize(
    ("name", "value", "parts"),
    [
        ("step", 2.5, ("2.5", "a number", "over 0", "to 2", "(m)")),
        ("turn", -7.0, ("-7 rad", "-401.07 degrees", "None")),
        ("rate", "medium", ("'medium'", "from 0", "slow, fast")),
        ("legs", 1, ("a whole number", "from 2", "to 100", "(legs)")),
        ("rgb", (1, 2), ("3 whole numbers", "from 0 to 255", "(1, 2, 3)")),
        ("layers", (), ("at least one whole number", "(3, 4)")),
        ("gait", "gallop", ("tripod, wave",)),
        ("parent", 3, ("a dict or None",)),
    ],
)
def test_an_error_reports_the_value_the_range_and_the_unit(name, value, parts):
    with pytest.raises(SettingError) as refusal:
        Body(**{name: value})
    for part in parts:
        assert part in str(refusal.value)


@given(st.floats() | st.integers() | st.none() | st.text(max_size=3) | st.booleans())
def test_any_value_is_kept_within_the_range_or_refused(value):
    try:
        step = Body(step=value).step
    except SettingError:
        assert not (isinstance(value, int | float) and not isinstance(value, bool) and 0 < value <= 2)
    else:
        assert step == value
        assert 0 < step <= 2


def test_settings_are_frozen_and_a_changed_copy_is_checked():
    body = Body()
    with pytest.raises(attrs.exceptions.FrozenInstanceError):
        body.step = 1.0  # type: ignore[misc]
    assert attrs.evolve(body, step=1).step == 1.0
    with pytest.raises(SettingError, match="step is 3"):
        attrs.evolve(body, step=3)


def test_a_field_without_a_default_is_required():
    @settings
    class Needs:
        size: int = whole()

    assert Needs(size=3).size == 3
    with pytest.raises(TypeError, match="size"):
        Needs()


def test_an_error_keeps_the_class_and_the_field_wherever_it_is_sent():
    with pytest.raises(FieldError) as refusal:
        Body(turn=-7.0)
    sent = pickle.loads(pickle.dumps(refusal.value))
    assert (sent.owner, sent.field, str(sent)) == ("Body", "turn", str(refusal.value))
    assert sent.in_degrees == "is -401.07; give a number from -180 to 180 (degrees) or None"


def test_a_class_is_called_by_its_name_where_it_has_one():
    @settings
    class Model:
        name: ClassVar[str] = "mushroom-body"
        cells: int = whole(3)

    with pytest.raises(SettingError, match=r"^mushroom-body: cells is 0"):
        Model(cells=0)


def test_a_converted_field_makes_its_default_too_and_sees_the_fields_before_it():
    @settings
    class Walk:
        legs: int = whole(6)
        gait: str = converted(
            default="tripod", converter=lambda value, walk: f"{value} on {walk.legs}", takes_self=True
        )
        steps: int = converted(default="3", converter=int)

    assert (Walk().gait, Walk().steps) == ("tripod on 6", 3)
    assert Walk(legs=8, gait="wave", steps="4") == attrs.evolve(Walk(legs=8, gait="wave"), gait="wave", steps=4)


def test_describe_gives_default_unit_and_range_or_choices():
    about = describe(Body)
    assert list(about) == [each.name for each in attrs.fields(Body)]
    assert about["step"] == {"default": 0.05, "unit": "m", "low": 0, "high": 2}
    assert about["legs"] == {"default": 6, "unit": "legs", "low": 2, "high": 100}
    assert about["gait"] == {"default": "tripod", "choices": ("tripod", "wave")}
