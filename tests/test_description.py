"""Descriptions of worlds, against geometry that is known."""

import numpy as np
import pytest
from commands import printed, tussock
from scenes import full_poses, post, random_world, world_of

from tussock.navigation.measures.description import (
    MEASURES,
    _power,
    _weighted,
    describe,
    sampled_poses,
)
from tussock.navigation.measures.figures import description_figure
from tussock.render.eye import Eye
from tussock.render.scanline import ScanlineRenderer
from tussock.world.errors import SettingError
from tussock.world.full_pose import eye_axes
from tussock.world.scene import World


def ring(radius: float, height: float, n: int = 90) -> World:
    """A wall around the middle of the field."""
    turn = np.linspace(0, 2 * np.pi, n + 1)
    low = np.column_stack([radius * np.cos(turn), radius * np.sin(turn), np.zeros(n + 1)])
    high = low + [0, 0, height]
    walls = np.concatenate(
        [np.stack([low[:-1], low[1:], high[1:]], axis=1), np.stack([low[:-1], high[1:], high[:-1]], axis=1)]
    )
    return world_of(walls, np.full((len(walls), 3), 80))


def test_hits_are_where_rays_meet_triangles():
    world, eye = random_world(3, 300), Eye(width=120, height=40, samples=1, z=0.05)
    poses = full_poses(world.field, 3)
    corners = world.surfaces()[0].astype(float)
    with ScanlineRenderer(world, eye) as renderer:
        away, which = renderer.hits(poses)
        alpha = renderer.render(poses)[..., 3]
        with pytest.raises(SettingError, match="samples=1"):
            ScanlineRenderer(world, Eye(width=90, height=20)).hits(poses)
    assert np.array_equal(which >= 0, alpha > 0)
    assert np.array_equal(np.isinf(away), which < 0)
    for k, pose in enumerate(poses):
        rows, columns = np.nonzero(which[k] >= 0)
        azimuth = np.pi - (columns + 0.5) * 2 * np.pi / eye.width
        flat = np.cos(eye.elevations()[rows])
        own = np.stack([flat * np.cos(azimuth), flat * np.sin(azimuth), np.sin(eye.elevations()[rows])], axis=1)
        point = pose[[0, 1, 3]] + away[k, rows, columns][:, None] * (own @ eye_axes(pose[None])[0])
        a, b, c = corners[which[k, rows, columns]].transpose(1, 0, 2)
        normal = np.cross(b - a, c - a)
        off = ((point - a) * normal).sum(axis=1) / np.linalg.norm(normal, axis=1)
        assert np.abs(off).max() < 1e-4  # distances are rounded to float32


def test_a_wall_has_the_skyline_and_the_distance_that_it_has():
    poses = np.array([[0.0, 0.0, 0.3], [0.0, 0.0, 2.0], [0.05, 0.0, 0.0]])
    found = describe(ring(1.5, 0.6), poses, z=0.05)
    elevation = np.degrees(np.arctan2(0.55, 1.5))
    assert found.values["skyline_deg"][:2] == pytest.approx([elevation] * 2, abs=1)
    assert found.values["skyline_roughness_deg"][0] < 0.5
    assert found.values["distance_m"][0] == pytest.approx(1.55, abs=0.05)
    share = np.sin(np.radians(elevation)) / np.sin(np.radians(60))
    assert found.values["covered"][0] == pytest.approx(share, abs=0.02)


def test_headings_do_not_matter_but_for_the_side_of_the_view_beside():
    world = random_world(4, 400)
    poses = sampled_poses(world, 6, seed=1)
    turned = poses + [0, 0, 2 * np.pi / 360 * 90]
    one, other = describe(world, poses, z=0.05), describe(world, turned, z=0.05)
    for name in ("skyline_deg", "contrast", "distance_m", "covered", "catchment_m"):
        assert one.values[name] == pytest.approx(other.values[name], rel=0.02)


def test_a_place_is_aliased_where_the_view_beside_it_is_that_of_another():
    """Two posts in an empty field that is the same after half a turn."""
    posts = np.concatenate([post(-1.5, 0.0, 0.0), post(1.5, 0.0, 0.0)])
    world = world_of(posts, np.full((len(posts), 3), 30))
    beside_is_the_first = [1.3, 0.0, -np.pi / 2]  # whose left is at 1.4
    found = describe(world, np.array([[-1.4, 0.0, 0.0], beside_is_the_first, [0.0, 1.0, 0.0]]), z=0.05)
    assert found.values["aliased"][1:].tolist() == [1, 0]


def test_power_is_the_variance():
    rows = np.random.default_rng(1).normal(size=(3, 360))
    assert _power(rows).sum() == pytest.approx(rows.var(axis=1).mean())
    wave = 3 * np.cos(2 * np.pi * 7 * np.arange(360) / 360)
    assert _power(wave[None])[6] == pytest.approx(4.5)


def test_quantiles_with_equal_weights_are_those_of_numpy():
    values = np.random.default_rng(2).random(101)
    assert _weighted(values, np.ones(101), (0.25, 0.5)) == pytest.approx(np.quantile(values, [0.25, 0.5]), abs=0.01)
    assert np.isnan(_weighted(values[:0], values[:0], (0.5,))).all()


def test_an_empty_world_has_no_distances():
    empty = world_of(np.empty((0, 3, 3)), np.empty((0, 3)), ground=False)
    found = describe(empty, np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 1.0]]), z=0.05)
    table = found.table()
    assert table["distance_m"]["mean"] is None
    assert table["skyline_deg"]["mean"] == 0
    assert table["catchment_m"]["mean"] == 0
    assert np.isfinite(found.slopes()["contrast"])
    description_figure(found)


def test_too_little_room_is_said():
    with pytest.raises(SettingError, match="fewer places"):
        sampled_poses(world_of(post(0.0, 0.0, 0.0, height=0.03, width=20), np.full((10, 3), 9)), 20)


def test_the_command_gives_table_figure_and_json(tmp_path, capfd):
    found = printed(capfd, "describe", "tiny", "--seed", "2", "--places", "5", "--out", str(tmp_path / "d.png"))
    assert set(found["measures"]) == set(MEASURES)
    assert found["n_places"] == 5
    assert (tmp_path / "d.png").stat().st_size > 10_000
    again = printed(capfd, "describe", "tiny", "--seed", "2", "--places", "5", "--out", str(tmp_path / "d.png"))
    assert again == found
    for flags, words in (
        (["--places", "1"], "3 to"),
        (["--eye-height-m", "-1"], "over 0"),
        (["--out", "d.txt"], ".png"),
    ):
        code, _, error = tussock(capfd, "describe", "tiny", *flags)
        assert code == 2
        assert words in error
