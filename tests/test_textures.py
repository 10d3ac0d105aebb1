"""Textures and corner colours: the CPU renderer against a ray caster in numpy, and against its own laws."""

import dataclasses
import itertools

import numpy as np
import pytest
from renderer_laws import batches_and_threads_do_not_matter, low_resolution_is_the_mean_over_each_pixels_solid_angle
from scenes import random_poses, random_texture, random_world, textured_world

from tussock.render.eye import Eye
from tussock.render.renderer import open_renderer
from tussock.render.scanline import ScanlineRenderer
from tussock.world.geometry import column_azimuths
from tussock.world.scene import World
from tussock.world.textures import ALPHAS, FILTERS, WRAPS, Texture, Texturing, to_display, to_linear

EYE = Eye(width=120, height=40, samples=1, z=0.05)


def wrapped(i: np.ndarray, n: int, wrap: str) -> np.ndarray:
    """Texels of places, by writing the picture down three times or more."""
    row = {"repeat": [*range(n)], "mirror": [*range(n), *range(n)[::-1]], "clamp": None}[wrap]
    return np.clip(i, 0, n - 1) if row is None else np.array(row)[np.mod(i, len(row))]


def texel(texture: Texture, u: float, v: float) -> np.ndarray:
    """Red, green, blue and alpha (0..255, not rounded) of a texture."""
    h, w = texture.rgba.shape[:2]
    if texture.filter == "nearest":
        return texture.rgba[
            wrapped(int(np.floor(v * h)), h, texture.wrap[1]), wrapped(int(np.floor(u * w)), w, texture.wrap[0])
        ]
    total = np.zeros(4)
    x, y = u * w - 0.5, v * h - 0.5
    for i, j in itertools.product((int(np.floor(x)), int(np.floor(x)) + 1), (int(np.floor(y)), int(np.floor(y)) + 1)):
        weight = (1 - abs(x - i)) * (1 - abs(y - j))
        total += weight * texture.rgba[wrapped(j, h, texture.wrap[1]), wrapped(i, w, texture.wrap[0])]
    return total


def seen(world: World, number: int, shares: np.ndarray) -> np.ndarray | None:
    """The colour of a triangle where its corners have some shares; None in a hole."""
    texturing = world.texturing
    if number >= len(texturing.index):
        return np.array(world.surfaces()[1][number], float)
    k = texturing.index[number]
    corner = np.full(4, 255.0) if texturing.colours is None else shares @ texturing.colours[number].astype(float)
    if k < 0:
        return np.array(world.rgb[number], float) if texturing.colours is None else np.round(corner[:3])
    rgba = texel(texturing.textures[k], *(shares @ texturing.uv[number].astype(float)))
    texture = texturing.textures[k]
    cutoff = {"opaque": 0, "mask": texture.cutoff, "blend": 0.5}[texture.alpha]
    if rgba[3] / 255 * corner[3] / 255 < cutoff - 1e-9:
        return None
    light = to_linear(np.round(rgba[:3]) / 255) * to_linear(np.round(corner[:3]) / 255)
    return np.round(255 * to_display(light))


def cast(world: World, eye: Eye, pose) -> np.ndarray:
    """A view (height, width, 4) by solving `ray = shares of the corners` for each ray and each triangle."""
    triangles = world.surfaces()[0].astype(float)
    azimuth, elevation = np.meshgrid(pose[2] + column_azimuths(eye.width), eye.elevations())
    rays = np.stack(
        [np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)], axis=-1
    )
    corners = (triangles - [pose[0], pose[1], eye.z]).transpose(0, 2, 1)  # columns are corners
    weights = np.einsum("nij,hwj->hwni", np.linalg.inv(corners), rays)
    hit = (weights >= 0).all(axis=-1)
    distance = np.where(hit, 1 / weights.sum(axis=-1), np.inf)
    view = np.empty((eye.height, eye.width, 4))
    for row, column in np.ndindex(eye.height, eye.width):
        view[row, column] = [*world.sky_rgb, 0]
        for number in np.argsort(distance[row, column], kind="stable"):
            if not np.isfinite(distance[row, column, number]):
                break
            share = weights[row, column, number]
            colour = seen(world, number, share / share.sum())
            if colour is not None:
                view[row, column] = [*colour, 255]
                break
    return view


@pytest.mark.parametrize(("kind", "alpha"), [*itertools.product(FILTERS, ALPHAS)])
@pytest.mark.parametrize("colours", [False, True])
def test_equals_a_ray_caster(kind, alpha, colours):
    """With every pair of wraps; a pixel is wrong where it is over one level off."""
    pairs = itertools.product(WRAPS, WRAPS)
    textures = [random_texture(i, wrap=pair, filter=kind, alpha=alpha, cutoff=0.1 * i) for i, pair in enumerate(pairs)]
    world = textured_world(textures, seed=len(alpha), colours=colours)
    with open_renderer(world, EYE, "cpu") as renderer:
        for pose in random_poses(2):
            wrong = np.abs(renderer.render([pose])[0] - cast(world, EYE, pose)).max(axis=-1) > 1
            assert wrong.mean() < 0.002


@pytest.mark.parametrize("alpha", ALPHAS)
def test_a_texture_of_one_colour_is_that_colour(alpha):
    plain = random_world(3, 200)
    for kind, wrap in itertools.product(FILTERS, WRAPS):
        textures = tuple(
            Texture(
                rgba=np.tile(np.array([*rgb, 255], np.uint8), (3, 5, 1)), filter=kind, wrap=(wrap, wrap), alpha=alpha
            )
            for rgb in plain.rgb
        )
        uv = np.random.default_rng(0).normal(0, 5, (200, 3, 2)).astype(np.float32)
        texturing = Texturing(textures=textures, index=np.arange(200, dtype=np.int32), uv=uv)
        for eye in (EYE, Eye(width=60, height=20, samples=4, z=0.05)):
            with (
                open_renderer(plain, eye, "cpu") as first,
                open_renderer(dataclasses.replace(plain, texturing=texturing), eye, "cpu") as second,
            ):
                assert np.array_equal(first.render(random_poses(4)), second.render(random_poses(4)))


def test_corners_of_one_colour_are_that_colour():
    plain = random_world(3, 200)
    colours = np.repeat(np.column_stack([plain.rgb, np.full(200, 255, np.uint8)])[:, None], 3, axis=1)
    texturing = Texturing(
        textures=(), index=np.full(200, -1, np.int32), uv=np.zeros((200, 3, 2), np.float32), colours=colours
    )
    coloured = dataclasses.replace(plain, texturing=texturing)
    with open_renderer(plain, EYE, "cpu") as renderer:
        expected = renderer.render(random_poses(4))
    with open_renderer(coloured, EYE, "cpu") as renderer:
        assert np.array_equal(renderer.render(random_poses(4)), expected)
    white = Texture(rgba=np.full((2, 2, 4), 255, np.uint8))  # and times white they are what they are
    texturing = dataclasses.replace(texturing, textures=(white,), index=np.zeros(200, np.int32))
    with open_renderer(dataclasses.replace(plain, texturing=texturing), EYE, "cpu") as renderer:
        assert np.array_equal(renderer.render(random_poses(4)), expected)


@pytest.fixture(scope="module")
def world():
    textures = [random_texture(i, filter=FILTERS[i % 2], alpha=alpha) for i, alpha in enumerate(ALPHAS * 2)]
    return textured_world(textures, n=120, colours=True)


def test_turning_left_rolls_the_view_right(world):
    with open_renderer(world, EYE, "cpu") as renderer:
        for pose in random_poses(5):
            view = renderer.render([pose])[0]
            for columns in (1, 17, 60, 119):
                turned = renderer.render([pose + [0, 0, columns * 2 * np.pi / 120]])[0]
                assert (turned != np.roll(view, columns, axis=1)).any(axis=-1).mean() < 0.004


def test_threads_and_batches_do_not_matter(world):
    with ScanlineRenderer(world, EYE, threads=1) as renderer:
        batches_and_threads_do_not_matter(renderer)


def test_rays_of_a_pixel_are_averaged(world):
    low_resolution_is_the_mean_over_each_pixels_solid_angle(world)
