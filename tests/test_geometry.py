"""Laws of poses and routes."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tussock.world.errors import InputError
from tussock.world.geometry import Bounds, Pose, Route, column_azimuths, columns_of_turn, turn_of_columns, wrap_angle

number = st.floats(-50, 50)
angle = st.floats(-10, 10)


@given(angle)
def test_wrapping_keeps_the_direction_and_the_range(a):
    wrapped = wrap_angle(a)
    assert -np.pi <= wrapped < np.pi
    assert np.allclose([np.cos(wrapped), np.sin(wrapped)], [np.cos(a), np.sin(a)], atol=1e-9)


@given(number, number, angle, number, number)
def test_a_move_is_undone_by_its_opposite(x, y, heading, forward, left):
    there = Pose(x, y, heading).moved(forward, left)
    assert np.allclose(there.moved(-forward, -left)[:2], (x, y), atol=1e-9)
    assert np.isclose(np.hypot(there.x - x, there.y - y), np.hypot(forward, left), atol=1e-9)


def test_forward_and_left_are_what_they_say():
    north = Pose(0, 0, np.pi / 2)
    assert np.allclose(north.moved(1)[:2], (0, 1))
    assert np.allclose(north.moved(0, 1)[:2], (-1, 0))
    assert north.turned(np.pi / 2).heading == -np.pi


def test_columns_run_clockwise_from_behind_with_ahead_in_the_middle():
    azimuths = column_azimuths(720)
    assert np.all(np.diff(azimuths) < 0)
    assert np.allclose(azimuths, -azimuths[::-1])
    assert np.isclose(azimuths[359], -azimuths[360])  # ahead lies between the two ..
    assert azimuths[359] > 0  # .. left first
    assert np.isclose(turn_of_columns(180, 720), np.pi / 2)


@given(angle, st.floats(-1000, 1000), st.integers(4, 1000))
def test_columns_and_turns_are_each_other_s_inverse(a, columns, width):
    back = columns_of_turn(turn_of_columns(columns, width), width)
    assert np.isclose(wrap_angle((back - columns) * 2 * np.pi / width), 0, atol=1e-9)
    assert -width / 2 <= back <= width / 2
    assert np.isclose(wrap_angle(turn_of_columns(columns_of_turn(a, width), width) - a), 0, atol=1e-9)
    assert np.isclose(columns_of_turn(np.degrees(a), width, full_turn=360), columns_of_turn(a, width), atol=1e-9)


def test_a_turn_to_the_left_is_columns_to_the_right():
    assert columns_of_turn(np.pi / 2, 720) == 180
    assert columns_of_turn(np.array([-90.0, 62.5]), 72, full_turn=360).tolist() == [-18, 12.5]


millimetres = st.integers(
    -50_000, 50_000
)  # points closer than a nanometre are one point, which a route does not go through


@given(st.lists(st.tuples(millimetres, millimetres), min_size=2, max_size=20, unique=True), st.floats(0.01, 3))
def test_resampling_is_even_and_stays_on_the_route(points, spacing):
    route = Route.through(np.array(points) / 1000)
    if spacing > route.length:
        with pytest.raises(InputError, match="spacing"):
            route.resampled(spacing)
        return
    if spacing > route.length / 2:
        return
    resampled = route.resampled(spacing)
    assert np.allclose(route.nearest(resampled.xy)[0], 0, atol=1e-9)
    assert np.hypot(*np.diff(resampled.xy, axis=0).T).max() <= spacing + 1e-9


def test_nearest_equals_a_search_over_many_points_of_the_route():
    rng = np.random.default_rng(0)
    route = Route.through(rng.normal(size=(8, 2)))
    fine = route.at(np.linspace(0, route.length, 200_001))
    places = rng.normal(size=(50, 2))
    distance, along = route.nearest(places)
    brute = np.array([np.hypot(*(fine[:, :2] - place).T).min() for place in places])
    assert np.all(distance <= brute + 1e-12)
    assert np.allclose(distance, brute, atol=route.length / 200_000)
    assert np.allclose(np.hypot(*(route.at(along)[:, :2] - places).T), distance, atol=1e-9)


def test_headings_are_interpolated_on_the_circle():
    route = Route(np.array([[0, 0, np.radians(170)], [1, 0, np.radians(-170)]]))
    assert np.isclose(abs(route.at(0.5)[0, 2]), np.pi)


@pytest.mark.parametrize(
    ("points", "message"),
    [
        ([[0, 0, 0]], "at least 2"),
        ([[0, 0, 0], [0, 0, 1]], "at least 2 distinct"),
        ([[0, 0, 0], [1, np.nan, 0]], "point 2 .* finite"),
    ],
)
def test_what_is_no_route_is_refused(points, message):
    with pytest.raises(InputError, match=message):
        Route(np.array(points, dtype=float))


def test_bounds_contain_their_border():
    assert Bounds(0, 0, 2, 1).contains(np.array([0, 2, 2.1]), np.array([0, 1, 0.5])).tolist() == [True, True, False]
