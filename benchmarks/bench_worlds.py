"""Generating worlds and finding routes in them, by the size of the field."""

import dataclasses
from functools import cache

import pytest

from tussock import World, generate_route

SIDES = (10, 20, 40, 80)  # m


def spec(side: int) -> str:
    return f"tussock-field field_width={side} field_depth={side}"


@cache
def world_of(side: int) -> World:
    return World.generate(spec(side), 1)


@pytest.mark.parametrize("side", SIDES)
def test_world(measure, side):
    rounds = 1 if side == max(SIDES) else 3
    measure(f"a world of {side} m x {side} m", lambda: World.generate(spec(side), 1), unit="s", rounds=rounds)


@pytest.mark.parametrize("side", SIDES)
@pytest.mark.parametrize("length", [8, 20])
def test_route(measure, side, length):
    if length > side:
        pytest.skip("the field is too small")

    def route():
        return generate_route(dataclasses.replace(world_of(side)), 1, length)  # a new world, of which nothing is kept

    measure(f"a route of {length} m in a world of {side} m x {side} m", route, unit="s", rounds=3)
