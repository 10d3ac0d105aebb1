"""Panoramas of the CPU renderer."""

import naive
import numpy as np
import pytest
import worlds

from tussock.navigation import Encoding
from tussock.render import Eye, compound_eye, lit, open_renderer
from tussock.render.images.writing import Grid, published_grid_area, write_database
from tussock.render.ommatidia import named_eye
from tussock.world import InputError, Light

SHAPES = [(720, 150, 1), (90, 25, 4), (90, 25, 1), (120, 25, 4)]


@pytest.mark.parametrize("size", SHAPES, ids=lambda size: "x".join(map(str, size)))
@pytest.mark.parametrize("batch", [32, 1])
def test_view(measure, size, batch):
    name, world = worlds.everyday()
    width, height, samples = size
    eye = Eye(width=width, height=height, samples=samples)
    poses = worlds.poses_in(world, 32)
    with open_renderer(world, eye, "cpu") as renderer:
        fine = Eye(width=width * samples, height=height * samples, samples=1)
        columns = slice(0, fine.width, fine.width // 6)
        measure(
            f"view {width} x {height}{f', {samples} x {samples} rays a pixel' if samples > 1 else ''}, {name},"
            f" {'in batches' if batch > 1 else 'one by one'}",
            lambda: [renderer.render(part) for part in np.array_split(poses, 32 // batch)],
            items=32,
            unit="ms a view",
            naive=lambda: naive.view(world, fine, poses[0], columns),
            naive_share=len(range(*columns.indices(fine.width))) / fine.width,
        )


@pytest.mark.parametrize("n", [200, 2_000, 20_000, 200_000, 2_000_000])
@pytest.mark.parametrize("size", [(720, 150), (90, 25)], ids=lambda size: "x".join(map(str, size)))
def test_growth_with_triangles(measure, size, n):
    world, (width, height) = worlds.blades(n), size
    with open_renderer(world, Eye(width=width, height=height, samples=1), "cpu") as renderer:
        poses = worlds.poses_in(world, 8)
        measure(
            f"view {width} x {height}, a meadow of {n:,} triangles",
            lambda: renderer.render(poses),
            items=8,
            unit="ms a view",
            rounds=7,
            curve=("triangles", f"{width} x {height}", n),
        )


@pytest.mark.parametrize("what", ["without textures", "with textures", "with textures with holes"])
def test_view_with_and_without_textures(measure, what):
    name, world = worlds.everyday()
    if what != "without textures":
        world = worlds.textured(world, holes="holes" in what)
    poses = worlds.poses_in(world, 32)
    with open_renderer(world, Eye(), "cpu") as renderer:
        measure(
            f"view 720 x 150, {name} {what}, in batches",
            lambda: renderer.render(poses),
            items=32,
            unit="ms a view",
        )


def test_view_of_a_tilted_eye(measure):
    name, world = worlds.everyday()
    poses = np.column_stack([worlds.poses_in(world, 32), np.full(32, 0.05), np.radians([[15, -10]] * 32)])
    with open_renderer(world, Eye(), "cpu") as renderer:
        measure(
            f"view 720 x 150, {name}, pitched and rolled, in batches",
            lambda: renderer.render(poses),
            items=32,
            unit="ms a view",
        )


def test_view_with_shadows(measure):
    name, world = worlds.everyday()
    poses, bright = worlds.poses_in(world, 32), lit(world, Light())
    with open_renderer(bright, Eye(), "cpu") as renderer:
        measure(
            f"view 720 x 150, {name}, with sun, shadows and sky, in batches",
            lambda: renderer.render(poses),
            items=32,
            unit="ms a view",
        )


def test_lighting(measure):
    name, world = worlds.everyday()
    measure(f"sun and shadows put on {name}, once", lambda: lit(world, Light()), rounds=3)


@pytest.mark.parametrize("name", ["sphere ommatidia=1000", "ant"])
def test_view_through_ommatidia(measure, name):
    where, world = worlds.everyday()
    poses, eye = worlds.poses_in(world, 32), compound_eye(name)
    encoded = Encoding.named("grey").for_eye(eye)
    with open_renderer(world, eye, "cpu") as renderer:
        measure(
            f"what {len(named_eye(name).azimuth):,} ommatidia see at all turns ({name.split()[0]}), {where}, in batches",
            lambda: encoded(renderer.render(poses)),
            items=32,
            unit="ms a view",
        )


def test_view_by_opengl(measure):
    name, world = worlds.everyday()
    try:
        renderer = open_renderer(world, Eye(), "egl")
    except InputError as error:
        pytest.skip(str(error))
    with renderer:
        poses = worlds.poses_in(world, 8)
        measure(f"view 720 x 150, {name}, egl", lambda: renderer.render(poses), items=8, unit="ms a view", rounds=3)


def test_the_published_grid_as_a_database(measure, tmp_path):
    name, world = worlds.everyday()
    grid = Grid.over(published_grid_area(world.field), 0.2)
    with open_renderer(world, Eye(), "cpu") as renderer:
        measure(
            f"{len(grid.poses()):,} views of 720 x 150, {name}, drawn and written as a PNG database",
            lambda: write_database(tmp_path, renderer, grid),
            unit="s",
            rounds=1,
            warm=0,
        )
