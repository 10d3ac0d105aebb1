"""Worlds that change between learning and walking: laws of each change, and what learns in one world and walks in the other."""

import dataclasses
import io
import json
import logging
import math

import numpy as np
import pandas as pd
import pytest
import trimesh
from commands import tussock
from scenes import hills, random_texture

from tussock.navigation.changed_world import changed_views
from tussock.navigation.cli.main import main
from tussock.navigation.experiment import Experiment
from tussock.navigation.experiment_keys import training_key, views_key
from tussock.navigation.experiment_settings import experiment_of, settings_of
from tussock.navigation.models.files import save_model
from tussock.navigation.sweeps.spec import Sweep
from tussock.navigation.sweeps.sweep import run_sweep, side_by_side
from tussock.navigation.training import training_source
from tussock.render.changed_views import ChangedViews
from tussock.render.eye import Eye
from tussock.render.images import write_database
from tussock.render.mounted_eye import mounted
from tussock.render.renderer import open_renderer
from tussock.world.change import CHANGES, Change
from tussock.world.errors import SettingError
from tussock.world.eye_change import EyeMount
from tussock.world.files import read_world, write_world
from tussock.world.full_pose import eye_axes
from tussock.world.geometry import Bounds, Route
from tussock.world.mowing import LOWEST, TALL
from tussock.world.plant_parts import sunlit
from tussock.world.routes import generate_route
from tussock.world.scene import World
from tussock.world.terrain import Terrain
from tussock.world.textures import Texturing
from tussock.world.world_plants import plants_of

SMALL = (
    "hay-meadow field_width=2 field_depth=2 ground_margin=2 stone_density=1 grass_density=20 litter_density=20 trees=3"
)
OF_PLANTS = ("removed", "moved", "added", "grown", "mown", "wind")
OF_WORLDS = (*OF_PLANTS, "object")
EYE = Eye(width=60, height=12)
QUICK = {"world": "tiny", "size": "60x12", "route_length_m": 1.0, "spacing_m": 0.1, "seed": 3, "max_steps": 12}


def posts_on_hills(colours: bool = False) -> World:
    """A user's mesh: hills with upright blades on them, all textured, of which nothing says what they are."""
    rng = np.random.default_rng(4)
    ground = hills().astype(np.float32)
    xy = rng.uniform(1, 5, (40, 2))
    z = 0.3 * np.sin(1.3 * xy[:, 0]) * np.cos(1.1 * xy[:, 1])
    low, high, width = z - 0.02, z + rng.uniform(0.05, 0.4, 40), 0.01
    left, right = (np.column_stack([xy + [side * width, 0], low]) for side in (-1, 1))
    middle_left, middle_right = (np.column_stack([xy + [side * width, 0], (low + high) / 2]) for side in (-1, 1))
    tip = np.column_stack([xy, high])
    blades = [(left, right, middle_right), (left, middle_right, middle_left), (middle_left, middle_right, tip)]
    triangles = np.concatenate(
        [ground, np.stack([np.stack(each, axis=1) for each in blades], axis=1).reshape(-1, 3, 3)]
    )
    n = len(triangles)
    texturing = Texturing(
        textures=(random_texture(1),),
        index=rng.integers(-1, 1, n).astype(np.int32),
        uv=rng.uniform(0, 1, (n, 3, 2)).astype(np.float32),
        colours=rng.integers(0, 256, (n, 3, 4), dtype=np.uint8) if colours else None,
    )
    return World(
        triangles=triangles.astype(np.float32),
        rgb=rng.integers(0, 256, (n, 3)).astype(np.uint8),
        ground=None,
        sky_rgb=(120, 160, 250),
        field=Bounds(0.0, 0.0, 6.0, 6.0),
        texturing=texturing,
    )


WORLDS = {
    "tiny": lambda: World.generate("tiny", 3),
    "meadow": lambda: World.generate(SMALL, 5),
    "hills": lambda: World.generate(f"{SMALL} hill_height=0.6 hill_size=2", 5),
    "mesh": posts_on_hills,
    "mesh with ground": lambda: posts_on_hills(colours=True).on_mesh(),
}


@pytest.fixture(scope="module", params=list(WORLDS))
def world(request) -> World:
    return WORLDS[request.param]()


@pytest.fixture(scope="module")
def tiny() -> World:
    return World.generate("tiny", 3)


@pytest.fixture(scope="module")
def meadow() -> World:
    return World.generate(SMALL, 5)


def bytes_of(world: World) -> list[bytes]:
    """All arrays of a world."""
    arrays = [world.triangles, world.rgb]
    if world.plants is not None:
        arrays += [world.plants.of, world.plants.kind, world.plants.foot]
    if world.reflectance is not None:
        arrays.append(world.reflectance)
    if isinstance(world.terrain, Terrain):
        arrays += [world.terrain.triangles, world.terrain.is_ground]
    texturing = [] if world.texturing is None else [world.texturing.to_bytes()]
    return [array.tobytes() for array in arrays] + texturing


def areas(triangles: np.ndarray) -> np.ndarray:
    a, b = (triangles[:, k].astype(float) - triangles[:, 0] for k in (1, 2))
    return np.linalg.norm(np.cross(a, b), axis=1) / 2


def sides(triangles: np.ndarray) -> np.ndarray:
    return np.linalg.norm(triangles.astype(float) - np.roll(triangles.astype(float), 1, axis=1), axis=2)


def kinds_of(world: World) -> np.ndarray:
    """The kind of each triangle; empty where it is in no plant."""
    plants = plants_of(world)
    names = np.array([*plants.kinds, ""])
    return names[np.where(plants.of >= 0, plants.kind[plants.of].astype(int), -1)]


# Every change, in every world


@pytest.mark.parametrize("name", OF_WORLDS)
def test_a_change_keeps_what_a_world_is(name, world):
    changed = world.changed(f"{name} amount=0.5", seed=2)
    assert bytes_of(changed) != bytes_of(world)
    assert bytes_of(changed) == bytes_of(world.changed(f"{name} amount=0.5", seed=2))
    assert (changed.ground, changed.sky_rgb, changed.field) == (world.ground, world.sky_rgb, world.field)
    assert (changed.texturing is None) == (world.texturing is None)
    assert (changed.reflectance is None) == (world.reflectance is None)
    assert changed.origin["changes"] == [{"change": f"{name} amount=0.5", "seed": 2}]
    with open_renderer(changed, EYE) as renderer:  # every renderer's arrays are made
        assert renderer.render([(1.0, 1.0, 0.0)]).any()


@pytest.mark.parametrize("name", OF_WORLDS)
def test_nothing_changes_at_an_amount_of_0(name, world):
    assert world.changed(f"{name} amount=0", seed=2) is world


@pytest.mark.parametrize("name", ["removed", "moved", "added", "wind", "object"])
def test_another_seed_gives_another_world(name, world):
    first, second = (world.changed(f"{name} amount=0.5", seed=seed) for seed in (1, 2))
    assert bytes_of(first) != bytes_of(second)


@pytest.mark.parametrize("name", OF_WORLDS)
def test_what_is_in_no_plant_stays_as_it_is(name, world):
    """The ground, its speckles and hedges, and the ground of a mesh."""
    changed = world.changed(f"{name} amount=0.7", seed=2)
    fixed = plants_of(world).of < 0
    assert fixed.any() or world.ground is not None
    before, after = (
        np.unique(each.triangles[which].reshape(-1, 9), axis=0)
        for each, which in ((world, fixed), (changed, plants_of(changed).of < 0))
    )
    added = len(after) - len(before)
    assert added == 0 if name != "object" else added > 0
    both = np.concatenate([before, after])
    assert len(np.unique(both, axis=0)) == len(after)


@pytest.mark.parametrize("name", OF_WORLDS)
def test_agents_stand_on_the_same_ground(name, world):
    changed = world.changed(f"{name} amount=0.7", seed=2)
    xy = np.random.default_rng(0).uniform(0.5, 1.5, (200, 2))
    assert (type(changed.terrain), changed.ground) == (type(world.terrain), world.ground)
    np.testing.assert_array_equal(changed.ground_height(xy), world.ground_height(xy))


@pytest.mark.parametrize("name", OF_WORLDS)
def test_a_changed_world_is_written_and_read_back_and_changed_again(name, world, tmp_path):
    if world.texturing is not None:
        world = dataclasses.replace(world, texturing=None)
    changed = world.changed(f"{name} amount=0.5", seed=2)
    write_world(changed, tmp_path / "changed.ply")
    back = read_world(tmp_path / "changed.ply")
    assert back.origin == changed.origin
    keeps_ground = isinstance(changed.terrain, Terrain) and changed.terrain.part is not None  # as a generated one
    flat = changed if keeps_ground else dataclasses.replace(changed, terrain=None)
    assert bytes_of(back) == bytes_of(flat)
    assert getattr(back.terrain, "part", None) == getattr(flat.terrain, "part", None)
    assert bytes_of(back.changed("mown amount=0.9")) == bytes_of(flat.changed("mown amount=0.9"))


def test_changes_are_joined_in_their_order_and_each_draws_for_itself(world):
    both = world.changed("removed amount=0.3 | grown amount=0.5", seed=4)
    assert bytes_of(both) == bytes_of(world.changed("removed amount=0.3", 4).changed("grown amount=0.5", 4))
    other = world.changed("grown amount=0.5 | removed amount=0.3", seed=4)  # the same plants are gone
    np.testing.assert_allclose(other.triangles, both.triangles, atol=1e-5)


# Each change


@pytest.mark.parametrize("name", ["removed", "moved"])
def test_a_larger_amount_has_all_of_a_smaller_one(name, meadow):
    of = plants_of(meadow).of
    changed = []
    for amount in (0.2, 0.4):
        later = meadow.changed(f"{name} amount={amount}", seed=3)
        there = {row.tobytes() for row in later.triangles}
        changed.append({int(k) for k in np.unique(of[of >= 0]) if meadow.triangles[of == k][0].tobytes() not in there})
    small, large = changed
    assert small < large
    assert len(small) == pytest.approx(0.2 * len(meadow.plants), abs=3)
    assert len(large) == pytest.approx(0.4 * len(meadow.plants), abs=3)


def test_what_is_removed_and_what_is_kept_is_all(world):
    plants = plants_of(world)
    kept = {row.tobytes() for row in world.changed("removed amount=0.4", 1).triangles}
    gone = [row.tobytes() not in kept for row in world.triangles]
    assert not set(plants.of[gone]) & set(plants.of[np.logical_not(gone)])  # whole plants only
    left = world.changed("removed amount=1").plants
    assert len(left) == 0
    assert (left.of < 0).all()
    assert len(left.of) == (plants.of < 0).sum()


def test_only_plants_of_the_kinds_that_are_named_are_removed(meadow):
    later = meadow.changed("removed amount=1 kinds=grass,herb")
    assert set(kinds_of(meadow)) - set(kinds_of(later)) == {"grass", "herb"}
    with pytest.raises(SettingError, match="no plants of the kind 'oak'; it has"):
        meadow.changed("removed amount=1 kinds=oak")


def test_a_plant_that_is_moved_keeps_its_shape_and_stands_within_the_distance(world):
    plants, later = plants_of(world), world.changed("moved amount=1 distance=0.3", 1)
    np.testing.assert_allclose(sides(later.triangles), sides(world.triangles), atol=2e-6)
    offset = (later.triangles.astype(float) - world.triangles).mean(axis=1)
    inside = plants.of >= 0
    far = np.hypot(*offset[inside, :2].T)
    assert far.max() <= 0.3 + 1e-6
    assert np.median(far) > 0.1
    first = np.zeros((len(plants), 3))
    first[plants.of[inside]] = offset[inside]
    np.testing.assert_allclose(offset[inside], first[plants.of[inside]], atol=2e-6)  # each as a whole
    np.testing.assert_allclose(later.plants.foot - plants.foot, first, atol=2e-6)


def test_a_plant_that_is_moved_on_hills_stands_as_high_over_the_ground_as_before():
    world = posts_on_hills().on_mesh()
    plants, later = plants_of(world), world.changed("moved amount=1 distance=1", 1)
    over = [each.foot[:, 2] - world.ground_height(each.foot[:, :2].astype(float)) for each in (plants, later.plants)]
    np.testing.assert_allclose(*over, atol=1e-5)
    loose = dataclasses.replace(world, terrain=None).changed("moved amount=1 distance=1", 1)  # nothing stands on it
    np.testing.assert_array_equal(loose.triangles, later.triangles)


def test_plants_that_are_added_are_copies_in_the_field(meadow):
    later, n = meadow.changed("added amount=0.5", 1), len(meadow.triangles)
    inside = meadow.field.contains(*meadow.plants.foot[:, :2].T)
    assert bytes_of(meadow)[0] == later.triangles[:n].tobytes()
    assert len(later.plants) == len(meadow.plants) + round(0.5 * inside.sum())
    new = later.plants.foot[len(meadow.plants) :]
    assert meadow.field.contains(*new[:, :2].T).all()
    originals = {tuple(row.round(3)) for row in sides(meadow.triangles)}
    assert np.mean([tuple(row.round(3)) in originals for row in sides(later.triangles[n:])]) > 0.95  # but for rounding
    edge = (later.triangles[:, 1] - later.triangles[:, 0]).round(4)
    unturned = {row.tobytes() for row in edge[:n]}
    assert np.mean([row.tobytes() in unturned for row in edge[n:]]) < 0.2
    assert (later.plants.of[n:] >= len(meadow.plants)).all()


def test_plants_that_have_grown_are_twice_as_high_and_half_wider_about_their_feet(world):
    plants, later = plants_of(world), world.changed("grown amount=1")
    growing = ~np.isin(kinds_of(world), ["", "stone", "litter", "leaf"])
    foot = plants.foot[plants.of[growing], None]
    before, after = world.triangles[growing] - foot, later.triangles[growing] - foot
    np.testing.assert_allclose(after, before * [1.5, 1.5, 2.0], atol=2e-6)
    np.testing.assert_array_equal(later.triangles[~growing], world.triangles[~growing])


@pytest.mark.parametrize("amount", [0.3, 0.7, 1.0])
def test_nothing_of_what_is_mown_is_above_the_height_and_all_below_it_is_as_before(amount, world):
    height = TALL * (LOWEST / TALL) ** amount
    plants, later = plants_of(world), world.changed(f"mown amount={amount}")
    for k in range(len(plants)):
        before, after = world.triangles[plants.of == k], later.triangles[later.plants.of == k]
        rise = before[..., 2] - plants.foot[k, 2]
        if rise.max() > TALL or plants.kinds[plants.kind[k]] == "stone":
            np.testing.assert_array_equal(after, before)
            continue
        over = after[..., 2].astype(float) - plants.foot[k, 2]
        assert over.max(initial=0) <= height + 1e-6
        below = np.array([area_below(each, plants.foot[k, 2] + height) for each in before.astype(float)])
        assert areas(after).sum() == pytest.approx(below.sum(), rel=1e-3, abs=1e-9)


def area_below(triangle: np.ndarray, plane: float) -> float:
    """Area of a triangle below a level plane, by the similarity of triangles."""
    whole = areas(triangle[None])[0]
    a, b, c = sorted(triangle[:, 2])
    if plane >= c or plane <= a:
        return whole if plane >= c else 0.0
    if plane <= b:
        return whole * (plane - a) ** 2 / ((b - a) * (c - a))
    return whole * (1 - (c - plane) ** 2 / ((c - b) * (c - a)))


def test_what_is_mown_keeps_its_front_side_and_its_texture_in_place():
    world = posts_on_hills(colours=True)
    later = world.changed("mown amount=0.7")
    assert world.texturing is not None
    assert later.texturing is not None
    normals = [np.cross(t[:, 1] - t[:, 0], t[:, 2] - t[:, 0]) for t in (world.triangles, later.triangles)]
    old = plants_of(world).of
    for row in np.flatnonzero(later.plants.of >= 0):
        foot = later.plants.foot[later.plants.of[row]]
        plant = np.flatnonzero((plants_of(world).foot == foot).all(axis=1))
        inside = [k for k in np.flatnonzero(np.isin(old, plant)) if contains(world.triangles[k], later.triangles[row])]
        assert any(
            normals[0][k] @ normals[1][row] > 0
            and np.allclose(texture_at(world, k, later.triangles[row]), later.texturing.uv[row], atol=1e-3)
            for k in inside
        )


def contains(triangle: np.ndarray, other: np.ndarray) -> bool:
    """Whether the corners of another triangle are in a triangle."""
    weights = np.array([barycentric(triangle, point) for point in other])
    return bool((weights > -1e-3).all() and np.abs(weights @ triangle - other).max() < 1e-4)


def barycentric(triangle: np.ndarray, point: np.ndarray) -> np.ndarray:
    edges = (triangle[1:] - triangle[0]).astype(float).T
    b, c = np.linalg.lstsq(edges, (point - triangle[0]).astype(float), rcond=None)[0]
    return np.array([1 - b - c, b, c])


def texture_at(world: World, row: int, corners: np.ndarray) -> np.ndarray:
    assert world.texturing is not None
    return np.array([barycentric(world.triangles[row], point) for point in corners]) @ world.texturing.uv[row]


@pytest.mark.parametrize("amount", [0.4, 1.0])
def test_wind_keeps_the_length_of_blades_and_puts_nothing_below_the_ground(amount, world):
    plants, later = plants_of(world), world.changed(f"wind amount={amount} direction_deg=70", 2)
    assert (later.triangles[..., 2].min() >= world.triangles[..., 2].min()) | (world.ground is None)
    floor = np.where(plants.of >= 0, plants.foot[plants.of, 2], np.inf)[:, None]
    lowest = np.minimum(world.triangles[..., 2], floor)
    assert (later.triangles[..., 2] >= lowest - 1e-6).all()
    blades = np.isin(kinds_of(world), ["grass", "tussock", "culm", "piece"])
    before, after = sides(world.triangles)[blades].max(axis=1), sides(later.triangles)[blades].max(axis=1)
    ratio = (after / before)[before > 0.05]
    assert len(ratio) > 10
    assert abs(np.median(ratio) - 1) < 0.02
    assert np.percentile(ratio, [3, 97]) == pytest.approx(1, abs=0.08)


def test_wind_bends_the_top_most_and_slender_kinds_most_towards_where_it_blows(meadow):
    later = meadow.changed("wind amount=0.6 direction_deg=90", 2)
    kinds, shift = kinds_of(meadow), (later.triangles.astype(float) - meadow.triangles).mean(axis=1)
    share = shift[:, 1] / np.maximum(meadow.triangles[..., 2].mean(axis=1), 1e-3)
    median = {kind: np.median(share[kinds == kind]) for kind in set(kinds)}
    assert median["grass"] > 1.5 * median["herb"] > 0
    assert median["herb"] > 1.5 * median["tree"] > 0
    assert all(median[kind] == 0 for kind in ("stone", "litter", ""))
    assert abs(shift[kinds == "grass", 0]).max() < 1e-6  # not to the side
    grass = kinds == "grass"
    high = meadow.triangles[grass][..., 2].mean(axis=1)
    low_, top = (np.median(shift[grass][each, 1]) for each in (high < np.median(high), high > np.median(high)))
    assert top > 1.5 * low_ > 0


def test_wind_from_everywhere_is_the_same_in_a_world_that_is_turned():
    """A quarter of a turn of world and wind turns the changed world."""
    world = posts_on_hills()
    quarter = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    turned = dataclasses.replace(
        world, triangles=(world.triangles @ quarter.T).astype(np.float32), field=Bounds(-6.0, 0.0, 0.0, 6.0)
    )
    first, second = world.changed("wind amount=0.8", 1), turned.changed("wind amount=0.8 direction_deg=90", 1)
    np.testing.assert_allclose(second.triangles, first.triangles @ quarter.T, atol=1e-5)


@pytest.mark.parametrize("shape", ["cylinder", "box"])
def test_a_new_object_is_as_high_as_its_amount_and_stands_next_to_the_route(shape, world):
    route = Route.through(np.array([[1.0, 1.0], [1.0, 2.0], [1.5, 3.0]]))
    n, later = len(world.triangles), world.changed(f"object amount=0.6 shape={shape}", 5, route)
    made = trimesh.Trimesh(*trimesh.triangles.to_kwargs(later.triangles[n:].astype(float)).values())
    assert made.is_watertight
    assert made.volume > 0  # its faces look outwards
    low, high = made.bounds
    middle = (low + high) / 2
    ground = np.nan_to_num(later.ground_height(middle[None, :2]))[0]
    if world.terrain is not None or world.ground is not None:
        assert high[2] - ground == pytest.approx(0.6, abs=1e-3)
    at = route.at(route.length / 2)[0]
    assert 0.29 < np.hypot(*(middle[:2] - at[:2])) < 0.51
    assert route.nearest(made.vertices[:, :2])[0].min() > 0.1


def test_without_a_route_a_new_object_stands_in_the_field(tiny):
    later = tiny.changed("object amount=1", 5)
    x, y = later.triangles[len(tiny.triangles) :, :, :2].mean(axis=(0, 1))
    assert tiny.field.contains(x, y)


# Worlds whose plants are not known


def test_pieces_count_as_plants_where_these_are_not_known_and_the_log_says_so_once(caplog):
    world = posts_on_hills()
    with caplog.at_level(logging.WARNING):
        for amount in (0.5, 1.0):
            world.changed(f"removed amount={amount}")
    assert len([record for record in caplog.records if "40 separate pieces" in record.message]) == 1
    plants = plants_of(world)
    assert len(plants) == 40
    assert (plants.of < 0).sum() == len(hills())


def test_a_mesh_in_one_piece_is_refused():
    world = dataclasses.replace(posts_on_hills(), texturing=None)
    ground = len(hills())
    bare = dataclasses.replace(world, triangles=world.triangles[:ground], rgb=world.rgb[:ground])
    with pytest.raises(SettingError, match="in one piece with its ground"):
        bare.changed("wind amount=0.5")
    assert len(bare.changed("object amount=0.5").triangles) > ground  # which needs no plants


# Specs


def test_a_text_is_read_and_written():
    text = "removed amount=0.2 kinds=(tussock,grass) | wind amount=0.5 direction_deg=90.0 | eye-turned amount=1.0 axis=pitch"
    change = Change.parse(text)
    assert str(change) == text
    assert Change.parse(str(change)) == change
    assert {part.name for part in change.parts} == {"removed", "wind", "eye-turned"}


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("remved amount=0.2", "did you mean 'removed'"),
        ("removed amount=1.2", "amount is 1.2; give a number from 0 to 1"),
        ("removed amount=-0.1", "amount is -0.1; give a number from 0 to 1"),
        ("wind amount=nan", "amount is nan"),
        ("removed", "amount"),
        ("removed amount=0.2 share=3", "its parameters are amount, kinds"),
        ("removed amount=0.2 |", "a part is empty"),
        ("object amount=1 shape=cone", "cylinder, box"),
        ("json:loads amount=1", "no parameter 'amount'|is not a change|cannot be made"),
    ],
)
def test_what_is_not_a_change_is_refused(text, words):
    with pytest.raises(SettingError, match=words):
        experiment_of(QUICK | {"test_change": text})


class Painted:
    """A change of a user's own."""

    def __init__(self, amount: float):
        self.amount = amount

    def __call__(self, world, rng, route):
        return dataclasses.replace(world, rgb=(world.rgb * (1 - self.amount)).astype(np.uint8))


def test_a_change_of_ones_own_is_found_by_its_location_or_a_registered_name(tiny):
    where = f"{__name__}:Painted"
    assert not tiny.changed(f"{where} amount=1").rgb.any()
    CHANGES.register("painted", Painted)
    assert not tiny.changed("painted amount=1").rgb.any()
    assert tiny.changed("painted amount=0") is tiny
    with pytest.raises(SettingError, match="from 0 to 1"):
        tiny.changed("painted amount=3")
    assert where in Change.parse("painted amount=1").text_in_files()


class Evening:
    """A change without an amount."""

    def __init__(self, hours: float = 4.0):
        self.hours = hours

    def __call__(self, world, rng, route):
        return dataclasses.replace(world, sky_rgb=(10, 10, 40))


def test_a_change_needs_no_amount(tiny):
    later = tiny.changed(f"{__name__}:Evening hours=6 | mown amount=0")
    assert later.sky_rgb == (10, 10, 40)
    assert str(Change.parse(f"{__name__}:Evening hours=6")) == f"{__name__}:Evening hours=6.0"


# The eye


@pytest.mark.parametrize("mount", [EyeMount(turn=0.3), EyeMount(turn=0.1, pitch=0.2, roll=-0.1, raised=0.02)])
def test_a_mounted_eye_keeps_its_directions_in_the_frame_of_the_body(mount):
    poses = np.random.default_rng(0).uniform(-0.6, 0.6, (9, 6))
    new = mounted(poses, mount)
    np.testing.assert_allclose(new[:, 3] - poses[:, 3], mount.raised)
    own = eye_axes(np.array([[0, 0, mount.turn, 0, mount.pitch, mount.roll]]))[0]
    np.testing.assert_allclose(eye_axes(new), own @ eye_axes(poses), atol=1e-12)


def test_an_eye_that_is_mounted_otherwise_sees_what_an_eye_there_sees(tiny):
    run = experiment_of(QUICK | {"test_change": "eye-raised amount=0.5 | eye-turned amount=0.6"})
    pose = np.array([[1.0, 1.2, 0.4]])
    with run.open_renderer(tiny) as renderer, changed_views(run, renderer, generate_route(tiny, 3, 1.0)) as views:
        seen = views.render(pose)
        assert views.world is tiny
        assert training_source(views) is renderer
    with open_renderer(tiny, run.eye) as plain:
        there = np.array([[1.0, 1.2, 0.4 + math.radians(6), 0.015, 0.0, 0.0]])
        np.testing.assert_array_equal(seen, plain.render(there))


def test_what_covers_an_eye_that_is_mounted_higher_is_measured_there(tiny):
    """An eye 1 cm higher looks over a plate that is 5 mm over the eye as it was."""
    plate = np.array([[(0.98, 0.98, 0.015), (1.02, 0.98, 0.015), (1.0, 1.03, 0.015)]], dtype=np.float32)
    world = dataclasses.replace(tiny, triangles=plate, rgb=np.zeros((1, 3), np.uint8), reflectance=None, plants=None)
    covered = []
    for change in (None, "eye-raised amount=1"):
        route = Route.through(np.array([[1.0, 1.0], [2.0, 1.0]]))
        run = experiment_of(QUICK | {"test_change": change, "model": "random"}).replace(world=world, route=route)
        with run.opened() as trained:
            step, _ = next(run.steps(trained))
            covered += trained.diagnostics._covered([step])
    assert covered[0] > 0.3
    assert covered[1] < 0.1


# Walks


def steps_in(run: Experiment) -> tuple[list, object]:
    with run.opened() as trained:
        return [step for step, _ in run.steps(trained)], trained


def test_what_learns_in_one_world_walks_in_the_other():
    plain, changed = (experiment_of(QUICK | extra) for extra in ({}, {"test_change": "removed amount=0.8"}))
    assert (views_key(plain), training_key(plain)) == (views_key(changed), training_key(changed))
    (first, before), (second, after) = steps_in(plain), steps_in(changed)
    np.testing.assert_array_equal(before.views, after.views)  # what was learned
    assert first[0].pose == second[0].pose
    assert (first[0].view != second[0].view).any()
    world, route = changed.open_world_and_route()
    later = world.changed("removed amount=0.8", seed=3, route=route)
    with changed.open_renderer(later) as renderer:
        np.testing.assert_array_equal(renderer.render([second[0].pose])[0], second[0].view)


def test_a_trained_model_walks_in_the_changed_world_as_the_model_that_has_just_learned(tmp_path):
    """The learned views that explain poor steps are those of the world before, also where they are drawn again."""
    change = {"test_change": "removed amount=0.9", "model": "infomax", "max_steps": 30}
    run = experiment_of(QUICK | change)
    with run.opened() as trained:
        save_model(trained.model, tmp_path / "trained.safetensors")
    again = run.replace(model=tmp_path / "trained.safetensors")
    first, second = (pd.read_csv(io.StringIO(each.run().to_csv())) for each in (run, again))
    assert first["recognised_view_m"].notna().any()
    pd.testing.assert_frame_equal(first, second)


def test_an_amount_of_0_changes_no_byte_of_a_walk():
    trajectories = [
        experiment_of(QUICK | {"test_change": change}).run().to_csv()
        for change in (None, "removed amount=0", "wind amount=0 gusts=0.5", "eye-turned amount=0")
    ]
    assert len(set(trajectories)) == 1


def test_the_change_has_the_seed_of_the_run_unless_it_has_its_own():
    change = {"test_change": "removed amount=0.5"}
    own, given, other = (
        steps_in(experiment_of(QUICK | change | extra))[0][0].view
        for extra in ({}, {"change_seed": 3}, {"change_seed": 4})
    )
    np.testing.assert_array_equal(own, given)
    assert (own != other).any()


def test_gusts_differ_from_step_to_step_and_are_the_same_for_the_same_seed(tiny):
    run = experiment_of(QUICK | {"test_change": "wind amount=0.8 gusts=1"})
    assert run.test_change.states == 8
    assert run.run().to_csv() == run.run().to_csv()
    with run.open_renderer(tiny) as renderer, changed_views(run, renderer, generate_route(tiny, 3, 1.0)) as views:
        assert isinstance(views, ChangedViews)
        seen = {views.at_step(step).render([(1.0, 1.2, 0.4)]).tobytes() for step in range(30)}
    assert len(seen) > 4
    assert Change.parse("wind amount=0.8").states == 1


def test_a_new_object_stops_those_that_walk_into_it():
    """Obstacles are those of the changed world."""
    run = Experiment(
        world=World.generate("tiny", 3),
        route=Route.through(np.array([[1.0, 1.0], [2.0, 1.0]])),
        eye=EYE,
        navigator="scan",
    ).replace(body__collisions="stop", stopping__max_steps=12, test_change=f"{__name__}:Walled amount=1")
    steps, _ = steps_in(run)
    assert any(step.touched for step in steps)
    assert max(step.pose.x for step in steps) < 1.3


class Walled:
    """A wall across the route."""

    def __init__(self, amount: float):
        self.amount = amount

    def __call__(self, world, rng, route):
        wall = np.array([[(1.3, 0, 0), (1.3, 2, 0), (1.3, 2, 1)], [(1.3, 0, 0), (1.3, 2, 1), (1.3, 0, 1)]])
        made = sunlit(wall, np.array([200, 0, 0]))
        from tussock.world.world_plants import appended

        return appended(world, made.triangles, made.rgb, made.reflectance)


# The command line, and sweeps


def test_a_run_records_the_changed_world(tmp_path, capfd):
    flags = [f"--{name.replace('_', '-')}={value}" for name, value in QUICK.items()]
    main(
        [
            "run",
            *flags,
            "--test-change",
            "removed amount=1 | object amount=0.5",
            "--out",
            str(tmp_path / "run"),
            "--json",
        ]
    )
    settings = json.loads((tmp_path / "run" / "summary.json").read_text())["settings"]
    assert settings["test_change"] == "removed amount=1.0 | object amount=0.5"
    from tussock.navigation.recording.recorded_walk import read_walk

    recorded = read_walk(tmp_path / "run" / "recording.rrd")
    assert len(recorded.triangles) == 60 + 2  # of the cylinder and the ground
    assert (
        settings_of(experiment_of(QUICK | {"test_change": settings["test_change"]}))["test_change"]
        == settings["test_change"]
    )


@pytest.mark.parametrize(
    ("flags", "words"),
    [
        (["--test-change", "remved amount=1"], "did you mean 'removed'"),
        (["--test-change", "removed amount=2"], "from 0 to 1"),
    ],
)
def test_flags_that_cannot_be_are_one_line(flags, words, tmp_path, capfd):
    code, _, errors = tussock(capfd, "run", *flags, "--out", str(tmp_path / "run"))
    assert code == 2
    assert words in errors
    assert len(errors.strip().splitlines()) == 1


def test_images_of_a_route_do_not_change(tiny, tmp_path, capfd):
    with open_renderer(tiny, EYE) as renderer:
        write_database(tmp_path / "views", renderer, [(1.0 + 0.1 * k, 1.0, 0.0) for k in range(4)])
    flags = ["--route-database", str(tmp_path / "views"), "--out", str(tmp_path / "run")]
    code, _, errors = tussock(capfd, "run", *flags, "--test-change", "removed amount=1")
    assert code == 2
    assert "--test-change 'removed amount=1.0': images show the world as it was" in errors


def test_headings_are_tested_in_the_changed_world(capfd):
    flags = ["--world", "tiny", "--size", "60x12", "--route-length-m", "1", "--seed", "3", "--json"]
    results = []
    for extra in ([], ["--test-change", "removed amount=0.9"], ["--test-change", "removed amount=0"]):
        main(["evaluate", *flags, *extra])
        results.append(json.loads(capfd.readouterr().out)["mean_error_deg"])
    assert results[0] == results[2] != results[1]
    with pytest.raises(SystemExit):
        main(["evaluate", *flags, "--test-change", "wind amount=0.5 gusts=0.5"])
    assert "gusts" in capfd.readouterr().err


def test_a_change_is_an_axis_of_a_sweep_and_learned_once(tmp_path, cluster):
    base = experiment_of(QUICK)
    changes = [None, "removed amount=0.5", "wind amount=0.5 gusts=0.5"]
    sweep = Sweep.over("changes", base, {"test_change": changes, "seed": [3, 4]})
    runs = {str(k): run for k, run in enumerate(sweep.experiments)}
    assert len(side_by_side(runs, 1)) == 6  # agents walk side by side in one world only
    run_sweep(sweep, tmp_path, workers=cluster)
    table = pd.read_parquet(tmp_path / "runs.parquet")
    assert table["test_change"].nunique(dropna=False) == 3
    alone = [run.run().summary()["mean_deviation_m"] for run in sweep.experiments]
    assert sorted(table["mean_deviation_m"]) == pytest.approx(sorted(alone))
    assert len({round(value, 9) for value in alone}) > 2
