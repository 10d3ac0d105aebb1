"""Which triangles are which plant, and what colour they have in even light: in generated worlds, and through files."""

import dataclasses
import logging

import numpy as np
import pytest

from tussock.world.errors import SettingError
from tussock.world.files import read_world, write_world
from tussock.world.generate import plant_layout
from tussock.world.params import WORLDS
from tussock.world.plant_groups import PlantGroups
from tussock.world.scene import World

SMALL = (
    "hay-meadow field_width=2 field_depth=2 ground_margin=2 stone_density=1 grass_density=20 litter_density=20 trees=3"
)


@pytest.fixture(scope="module")
def world():
    return World.generate(SMALL, 5)


def test_each_plant_of_the_layout_is_one_group(world):
    layout, _ = plant_layout(WORLDS.spec(SMALL).make(seed=5), 5)
    count = {kind: len(rows) for kind, rows in layout.items() if len(rows)}
    count["tree"] = count.get("tree", 0) + count.pop("inner_tree", 0)
    found = np.bincount(world.plants.kind, minlength=len(world.plants.kinds))
    assert {name: int(n) for name, n in zip(world.plants.kinds, found, strict=True)} == {
        k: n for k, n in count.items() if n
    }


@pytest.mark.parametrize("kind", ["grass", "culm", "litter", "herb", "tussock", "tree", "stone"])
def test_the_triangles_of_a_plant_are_around_its_foot(world, kind):
    plants = world.plants
    of = plants.of[np.isin(plants.of, np.flatnonzero(plants.kind == plants.kinds.index(kind)))]
    triangles = world.triangles[np.isin(plants.of, of)]
    height = np.zeros(len(plants))
    np.maximum.at(height, of, triangles[..., 2].max(axis=1))
    away = np.linalg.norm(triangles[..., :2].mean(axis=1) - plants.foot[of, :2], axis=1)
    assert (away <= 0.05 + 1.5 * height[of]).all()
    assert len(np.unique(of)) == (plants.kind == plants.kinds.index(kind)).sum()  # none is without triangles


def test_ground_and_hedge_are_no_plants(world):
    loose = world.triangles[world.plants.of < 0]
    assert len(loose)
    assert loose[..., 2].max() > 1.0
    assert (loose[..., 2].max(axis=1) < 0.005).any()  # speckles


@pytest.mark.parametrize("preset", WORLDS.builtin)
def test_colours_are_reflectance_times_a_light_of_moderate_strength(preset):
    world = World.generate(preset, 1)
    assert world.reflectance is not None
    bright = world.reflectance.min(axis=1) > 40
    light = (world.rgb[bright] + 0.5) / (world.reflectance[bright] + 0.5)
    assert np.quantile(light, 0.001) > 0.5
    assert np.quantile(light, 0.999) < 1.7


@pytest.mark.parametrize("suffix", ["glb", "ply"])
def test_files_keep_plants_and_reflectance(world, suffix, tmp_path):
    write_world(world, tmp_path / f"world.{suffix}")
    back = read_world(tmp_path / f"world.{suffix}")
    assert np.array_equal(back.reflectance, world.reflectance)
    assert back.plants.kinds == world.plants.kinds
    for name in ("of", "kind", "foot"):
        assert np.array_equal(getattr(back.plants, name), getattr(world.plants, name))
    if suffix == "ply":
        header = (tmp_path / "world.ply").read_bytes().partition(b"end_header")[0]
        assert max(map(len, header.splitlines())) < 1000


def test_a_file_whose_mesh_was_edited_says_that_its_plants_are_unknown(world, tmp_path, caplog):
    write_world(world, tmp_path / "world.ply")
    data = (tmp_path / "world.ply").read_bytes()
    header, end, body = data.partition(b"end_header\n")
    n = len(world.triangles)
    vertices = 3 * n * (len(body) - 13 * n) // (3 * n)  # bytes
    fewer = header.replace(f"element face {n}".encode(), f"element face {n - 1}".encode()) + end
    (tmp_path / "edited.ply").write_bytes(fewer + body[: vertices + 13 * (n - 1)])
    with caplog.at_level(logging.WARNING):
        edited = read_world(tmp_path / "edited.ply")
    assert edited.plants is None
    assert edited.reflectance is None
    assert len(edited.triangles) == n - 1
    assert "which plant" in caplog.text


def test_groups_that_do_not_fit_are_refused(world):
    groups = world.plants
    with pytest.raises(SettingError, match="triangles"):
        dataclasses.replace(world, plants=dataclasses.replace(groups, of=groups.of[:-1]))
    with pytest.raises(SettingError, match="belong to plants"):
        PlantGroups(
            of=np.array([2], np.int32), kinds=("a",), kind=np.zeros(1, np.uint8), foot=np.zeros((1, 3), np.float32)
        )
