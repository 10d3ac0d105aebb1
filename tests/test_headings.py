"""Headings are diagnosed as the convention that they were written in, or as undetermined; noise alone is never another one."""

import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tussock.world.errors import SettingError
from tussock.world.geometry import wrap_angle
from tussock.world.heading_names import CONVENTION_NAMES, HEADINGS
from tussock.world.headings import CONVENTIONS, convert, diagnose, path_directions

# What a writer of each convention does with a heading (rad): the number that it writes, as degrees (rad). An oracle of its own.
WRITTEN = {
    "ccw": lambda heading: heading % (2 * np.pi),
    "bearing": lambda heading: (np.pi / 2 - heading) % (2 * np.pi),
    "radians": lambda heading: np.radians(wrap_angle(heading)),
    "radians-bearing": lambda heading: np.radians((np.pi / 2 - heading) % (2 * np.pi)),
    "clockwise": lambda heading: wrap_angle(-heading),
    "ccw-from-north": lambda heading: heading - np.pi / 2,
    "backwards": lambda heading: heading + np.pi,
    "bearing-backwards": lambda heading: np.radians((270 - np.degrees(heading)) % 360),
}


def path(rng: np.random.Generator, rows: int, turn: float, step: float = 0.01) -> tuple[np.ndarray, np.ndarray]:
    """A smooth path and its headings. turn: how much it bends (rad)."""
    phase = np.linspace(0, rng.uniform(1, 3) * np.pi, rows)
    heading = rng.uniform(-np.pi, np.pi) + turn * np.sin(phase) + turn / 2 * np.sin(2.3 * phase + rng.uniform(0, 6))
    moved = step * np.column_stack([np.cos(heading), np.sin(heading)])
    return np.cumsum(moved, axis=0) - moved / 2, heading


paths = st.builds(
    lambda seed, rows, turn: path(np.random.default_rng(seed), rows, turn),
    st.integers(0, 10**6),
    st.sampled_from([2, 3, 5, 20, 60, 300]),
    st.sampled_from([0.0, 0.1, 0.5, 1.5, 4.0]),
)


def test_every_convention_has_a_writer():
    assert set(WRITTEN) == set(CONVENTIONS) == set(HEADINGS) - {"auto", "path", "as-is"}
    assert tuple(CONVENTIONS) == CONVENTION_NAMES


@pytest.mark.parametrize("name", CONVENTIONS)
@pytest.mark.parametrize("read_as", ["ccw", "bearing", "radians"])
def test_what_was_written_in_a_convention_is_read_in_it(name, read_as):
    heading = np.linspace(-3.1, 3.1, 50)
    poses = np.column_stack([np.zeros((50, 2)), CONVENTIONS[read_as].heading(WRITTEN[name](heading))])
    found = convert(poses, name, read_as)
    assert np.abs(wrap_angle(found[:, 2] - heading)).max() < 1e-9
    assert convert(poses, "auto", read_as) is poses


def test_an_unknown_convention_is_refused():
    with pytest.raises(SettingError, match=r"'compass'; give one of auto, ccw, bearing"):
        convert(np.zeros((2, 3)), "compass")


@given(paths, st.sampled_from(list(CONVENTIONS)), st.sampled_from([0.0, 0.3, 1.0]), st.integers(0, 10**6))
@settings(max_examples=300)
def test_no_other_convention_than_the_right_one_is_named_for_sure(walk, name, noise, seed):
    xy, heading = walk
    xy = xy + np.random.default_rng(seed).uniform(-noise, noise, xy.shape) * 0.01  # of a step
    diagnosis = diagnose(np.column_stack([xy, WRITTEN[name](heading)]))
    assert diagnosis.kind != "convention" or diagnosis.convention == name
    if name == "ccw" and noise <= 0.3 and len(xy) > 5:
        assert diagnosis.kind == "follows", diagnosis


@given(paths, st.integers(0, 10**6), st.sampled_from(["random", "constant", "zero"]))
@settings(max_examples=300)
def test_headings_of_their_own_are_not_accused(walk, seed, kind):
    xy, rng = walk[0], np.random.default_rng(seed)
    heading = {"random": rng.uniform(-np.pi, np.pi, len(xy)), "constant": np.full(len(xy), rng.uniform(-3, 3))}
    diagnosis = diagnose(np.column_stack([xy, heading.get(kind, np.zeros(len(xy)))]))
    assert diagnosis.kind != "convention", diagnosis


@pytest.mark.parametrize("name", [name for name, each in CONVENTIONS.items() if each.mirrored or each.radians])
@pytest.mark.parametrize("noise", [0.0, 0.3, 1.5, 4.0])
def test_a_bending_route_in_another_convention_is_recognised(name, noise):
    """With jitter of four steps as well: only longer chords show it."""
    xy, heading = path(np.random.default_rng(0), 800, 1.0)
    xy += np.random.default_rng(1).uniform(-noise, noise, xy.shape) * 0.01
    diagnosis = diagnose(np.column_stack([xy, WRITTEN[name](heading)]))
    assert (diagnosis.kind, diagnosis.convention) == ("convention", name)
    assert f"as {CONVENTIONS[name].label} they fit" in str(diagnosis)
    assert f"--headings {name} reads them so" in diagnosis.flags


def test_loops_turns_back_and_pauses_follow_their_path():
    t = np.linspace(0, 2 * np.pi, 100)
    circle = np.column_stack([np.cos(t), np.sin(t), t + np.pi / 2])
    out = np.column_stack([np.arange(50), np.zeros((50, 2))])
    back = np.column_stack([np.arange(50)[::-1], np.zeros(50), np.full(50, np.pi)])
    pause = np.repeat(circle[40:41], 300, axis=0)
    pause[:, :2] += np.random.default_rng(0).normal(0, 1e-3, (300, 2))
    for poses in (
        circle,
        np.vstack([out, back]),
        np.vstack([circle[:40], pause, circle[40:]]),
        np.repeat(circle, 3, axis=0),
    ):
        assert diagnose(poses).kind == "follows"


def test_corners_of_a_coarse_path_need_not_agree_with_longer_chords():
    """Each row of a zigzag has the direction to the next row, or that from the one before."""
    xy = np.column_stack([np.arange(40), np.arange(40) % 2 * 2.0])
    direction = path_directions(xy)
    for heading in (direction, np.r_[direction[:1], direction[:-1]]):
        assert diagnose(np.column_stack([xy, heading])).kind == "follows"


@pytest.mark.parametrize(
    ("heading", "kind", "words"),
    [
        (lambda t: 0 * t, "zero", "headings are all 0, and"),
        (lambda t: 0 * t + 1.5, "constant", "headings do not follow the path: constant 86 degrees"),
        (lambda t: t + np.pi / 2 + 1, "turned", "a constant 5. degrees to the left of the path"),
        (lambda t: t - np.pi / 2, "turned", "point backwards along the path"),
        (lambda t: 1e4 * np.sin(1e4 * t), "unrelated", "no known convention fits"),
    ],
)
def test_headings_of_another_sense_are_described(heading, kind, words):
    t = np.linspace(0, 2 * np.pi, 100)
    diagnosis = diagnose(np.column_stack([np.cos(t), np.sin(t), heading(t)]))
    assert diagnosis.kind == kind
    assert re.search(words, str(diagnosis))


def test_a_straight_path_is_not_evidence_enough():
    """A constant heading of 70 degrees on a path that leads to 20: a bearing, or a camera that looks there."""
    x = np.linspace(0, 1, 50)
    poses = np.column_stack([x, np.tan(np.radians(20)) * x, np.full(50, np.radians(70))])
    diagnosis = diagnose(poses)
    assert (diagnosis.kind, diagnosis.convention) == ("constant", "bearing")
    poses = np.column_stack([x, x, np.full(50, np.radians(45))])  # bearings say the same
    assert str(diagnose(poses)) == ""


def test_a_database_is_asked_about_its_bearings():
    xy, heading = path(np.random.default_rng(3), 200, 1.0)
    assert diagnose(np.column_stack([xy, heading]), "bearing").kind == "follows"
    as_read = np.pi / 2 - WRITTEN["ccw"](heading)  # counter-clockwise angles, read as bearings
    diagnosis = diagnose(np.column_stack([xy, as_read]), "bearing")
    assert (diagnosis.kind, diagnosis.convention) == ("convention", "ccw")


def test_two_points_are_only_remarked_upon():
    assert diagnose(np.array([[0.0, 0, 0], [0, 1, 0]])).kind == "constant"


@pytest.mark.parametrize("rows", [0, 1, 2])
def test_paths_without_a_direction_say_nothing(rows):
    assert diagnose(np.zeros((rows, 3))).kind == "follows"
    assert diagnose(np.full((rows, 3), np.nan)).kind == "follows"
    assert path_directions(np.zeros((rows, 2))).tolist() == [0.0] * rows
