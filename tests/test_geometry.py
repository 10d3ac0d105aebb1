"""Laws of angles, poses and routes."""

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from tussock.world.errors import SettingError
from tussock.world.geometry import (
    Bounds,
    Pose,
    Route,
    column_azimuths,
    columns_of_turn,
    rounded,
    turn_of_columns,
    wrap_angle,
)

number = st.floats(-50, 50)
angle = st.floats(-10, 10)
steps = st.sampled_from([-np.inf, 0.0, np.inf])  # towards which the next float is taken
near_half_turns = st.builds(
    lambda k, to: float(np.nextafter(k * np.pi, to)) if to else k * np.pi, st.integers(-99, 99), steps
)


@example(float(np.nextafter(-np.pi, -10)))  # rounding takes it to a whole turn
@given(angle | near_half_turns)
def test_wrapping_keeps_the_direction_and_the_range(a):
    for wrapped in (wrap_angle(a), wrap_angle(np.array([a]))[0], wrap_angle(np.float64(a))):
        assert -np.pi <= wrapped < np.pi
        assert np.allclose([np.cos(wrapped), np.sin(wrapped)], [np.cos(a), np.sin(a)], atol=1e-9)


def test_wrapping_changes_no_bit_of_an_ordinary_angle():
    angles = np.random.default_rng(0).uniform(-20, 20, 10_000)
    assert np.array_equal(wrap_angle(angles), (angles + np.pi) % (2 * np.pi) - np.pi)


@given(number, number, angle | near_half_turns, angle | near_half_turns)
def test_the_heading_of_every_pose_is_in_the_range(x, y, heading, turn):
    pose = Pose(x, y, heading)
    for each in (pose, pose.turned(turn), pose.moved(1.0, 2.0)):
        assert -np.pi <= each.heading < np.pi
    assert np.allclose([np.cos(pose.heading), np.sin(pose.heading)], [np.cos(heading), np.sin(heading)], atol=1e-9)
    if -np.pi <= heading < np.pi:
        assert pose == (x, y, heading)


@given(number, number, angle | near_half_turns)
def test_a_pose_alone_is_rounded_as_one_of_many(x, y, heading):
    pose = Pose(x, y, heading)
    assert pose.rounded() == tuple(rounded(np.array([pose, (1.0, 2.0, 3.0)]))[0])


def test_a_pose_keeps_a_heading_that_is_not_finite_for_others_to_refuse():
    assert Pose(0, 0, np.inf).heading == np.inf
    assert np.isnan(Pose(0, 0, np.nan).heading)


@given(number, number, angle, number, number)
def test_a_move_and_its_opposite_cancel(x, y, heading, forward, left):
    there = Pose(x, y, heading).moved(forward, left)
    assert np.allclose(there.moved(-forward, -left)[:2], (x, y), atol=1e-9)
    assert np.isclose(np.hypot(there.x - x, there.y - y), np.hypot(forward, left), atol=1e-9)


def test_forward_and_left_are_as_documented():
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
def test_columns_and_turns_are_inverse_to_each_other(a, columns, width):
    back = columns_of_turn(turn_of_columns(columns, width), width)
    assert np.isclose(wrap_angle((back - columns) * 2 * np.pi / width), 0, atol=1e-9)
    assert -width / 2 <= back <= width / 2
    assert np.isclose(wrap_angle(turn_of_columns(columns_of_turn(a, width), width) - a), 0, atol=1e-9)
    assert np.isclose(columns_of_turn(np.degrees(a), width, full_turn=360), columns_of_turn(a, width), atol=1e-9)


def test_a_turn_to_the_left_is_columns_to_the_right():
    assert columns_of_turn(np.pi / 2, 720) == 180
    assert columns_of_turn(np.array([-90.0, 62.5]), 72, full_turn=360).tolist() == [-18, 12.5]


millimetres = st.integers(-50_000, 50_000)  # a route takes points closer than a nanometre as one


@given(st.lists(st.tuples(millimetres, millimetres), min_size=2, max_size=20, unique=True), st.floats(0.01, 3))
def test_resampling_is_even_and_stays_on_the_route(points, spacing):
    route = Route.through(np.array(points) / 1000)
    if spacing > route.length:
        with pytest.raises(SettingError, match="spacing"):
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
    positions = rng.normal(size=(50, 2))
    distance, along = route.nearest(positions)
    searched = np.array([np.hypot(*(fine[:, :2] - position).T).min() for position in positions])
    assert np.all(distance <= searched + 1e-12)
    assert np.allclose(distance, searched, atol=route.length / 200_000)
    assert np.allclose(np.hypot(*(route.at(along)[:, :2] - positions).T), distance, atol=1e-9)


def test_headings_are_interpolated_on_the_circle():
    route = Route(np.array([[0, 0, np.radians(170)], [1, 0, np.radians(-170)]]))
    assert np.isclose(abs(route.at(0.5)[0, 2]), np.pi)


@pytest.mark.parametrize(
    ("points", "message"),
    [
        ([[0, 0, 0]], "at least 2"),
        ([[0, 0, 0], [0, 0, 1]], "at least 2 distinct"),
        ([[0, 0, 0], [1, np.nan, 0]], "point 2 .* finite"),
        ([[0, 0, 0], [1, 1e8, 0]], r"point 2 .* up to 1e\+07"),
    ],
)
def test_an_invalid_route_is_refused(points, message):
    with pytest.raises(SettingError, match=message):
        Route(np.array(points, dtype=float))


def test_bounds_contain_their_border():
    assert Bounds(0, 0, 2, 1).contains(np.array([0, 2, 2.1]), np.array([0, 1, 0.5])).tolist() == [True, True, False]


def test_bounds_are_widened_on_every_side():
    wider = Bounds(0, 1, 2, 5).widened(0.5)
    assert wider == (-0.5, 0.5, 2.5, 5.5)
    assert wider.size.tolist() == [3, 5]
    assert wider.widened(-0.5) == Bounds(0, 1, 2, 5)
