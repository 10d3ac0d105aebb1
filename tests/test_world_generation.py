"""Laws of generated worlds and of the routes through them."""

import dataclasses
import hashlib
import json
import re
import subprocess
import sys
from functools import cache

import numpy as np
import pytest
from scipy.spatial import KDTree
from scipy.stats import chi2

from tussock.world.errors import InputError
from tussock.world.generate import generate_world, plant_positions
from tussock.world.geometry import Bounds, wrap_angle
from tussock.world.params import PRESETS, WorldParams
from tussock.world.routes import clearance, generate_route
from tussock.world.scene import Ground, World

KINDS = {"tussock", "grass", "bush", "leaf", "stone", "tree"}


@cache
def grown(preset: str, seed: int) -> World:
    return generate_world(PRESETS[preset], seed)


def digest(world: World) -> str:
    return hashlib.sha256(world.triangles.tobytes() + world.rgb.tobytes()).hexdigest()


def bare(triangles) -> World:
    """A 2 m x 2 m world of these triangles."""
    triangles = np.array(triangles, dtype=np.float32).reshape(-1, 3, 3)
    field = Bounds(0.0, 0.0, 2.0, 2.0)
    rgb = np.zeros((len(triangles), 3), np.uint8)
    return World(triangles=triangles, rgb=rgb, ground=Ground((9, 9, 9), field), sky_rgb=(200, 200, 200), field=field)


# Worlds


@pytest.mark.parametrize("preset", PRESETS)
def test_the_same_seed_gives_the_same_bytes(preset):
    assert digest(grown(preset, 3)) == digest(generate_world(PRESETS[preset], 3))


def test_other_seeds_give_other_worlds():
    assert len({digest(grown("tiny", seed)) for seed in range(10)}) == 10


def test_another_process_grows_the_same_world_and_route():
    code = (
        "from tussock.world.generate import *; from tussock.world.params import *; from tussock.world.routes import *; import hashlib\n"
        "w = generate_world(PRESETS['tiny'], 5)\n"
        "data = w.triangles.tobytes() + w.rgb.tobytes() + generate_route(w, 2).poses.tobytes()\n"
        "print(hashlib.sha256(data).hexdigest())"
    )
    there = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.strip()
    world = grown("tiny", 5)
    here = world.triangles.tobytes() + world.rgb.tobytes() + generate_route(world, 2).poses.tobytes()
    assert there == hashlib.sha256(here).hexdigest()


@pytest.mark.parametrize("preset", PRESETS)
def test_a_world_is_sound(preset):
    world = grown(preset, 3)
    assert world.triangles.dtype == np.float32
    assert world.rgb.dtype == np.uint8
    assert np.isfinite(world.triangles).all()
    a, b, c = np.moveaxis(world.triangles.astype(float), 1, 0)
    assert np.linalg.norm(np.cross(b - a, c - a), axis=1).min() > 1e-8
    assert world.ground is not None
    assert world.ground.bounds.x_min < world.field.x_min < world.field.x_max < world.ground.bounds.x_max
    inside = world.ground.bounds.contains(world.triangles[..., 0], world.triangles[..., 1])
    assert inside.all(), "nothing stands beyond the ground"
    assert np.abs(np.subtract(world.ground.rgb, world.sky_rgb)).max() > 60


def test_tiny_is_tiny_whatever_the_seed():
    assert max(len(generate_world(PRESETS["tiny"], seed).triangles) for seed in range(40)) < 200


def test_the_default_world_is_as_large_as_planned():
    assert 15_000 <= len(grown("tussock-field", 3).triangles) <= 27_000


def test_changing_one_kind_leaves_the_others_where_they_are():
    few = PRESETS["tussock-field"]
    more = WorldParams.from_dict(few.to_dict() | {"bush_density": 0.2, "trees": 9})
    here, there = plant_positions(few, 1), plant_positions(more, 1)
    assert set(here) == KINDS
    for kind in KINDS - {"bush", "tree"}:
        np.testing.assert_array_equal(here[kind], there[kind])
    assert len(there["bush"]) > len(here["bush"])


@pytest.mark.parametrize("preset", ["tussock-field", "meadow", "scrub"])
def test_vegetation_is_clustered_more_than_chance(preset):
    """Quadrat counts vary more, and neighbours are nearer, than chance would have it once in a thousand worlds."""
    seeds = (1, 2, 3)
    layouts = [plant_positions(PRESETS[preset], seed) for seed in seeds]
    for kind in ("tussock", "grass"):
        places = [layout[kind] for layout in layouts]
        counts = [np.histogram2d(*xy.T, bins=10, range=[[0, 10], [0, 10]])[0] for xy in places]
        dispersion = sum(99 * n.var(ddof=1) / n.mean() for n in counts)
        assert dispersion > chi2.ppf(0.999, 99 * len(seeds))
    for xy in places:  # of the grass; tussocks keep apart
        density = len(xy) / np.prod(np.ptp(xy, axis=0))
        nearest = KDTree(xy).query(xy, k=2)[0][:, 1].mean()
        error = 0.26136 / np.sqrt(len(xy) * density)  # Clark and Evans 1954
        assert nearest < 0.5 / np.sqrt(density) - 3.3 * error


def test_most_of_the_ground_is_open():
    places = np.random.default_rng(0).uniform(0.0, 10.0, (1500, 2))
    assert 0.1 < (clearance(grown("tussock-field", 3), places) < 0.04).mean() < 0.3


def test_the_skyline_differs_around_the_field():
    for seed in range(3):
        trees = plant_positions(PRESETS["tussock-field"], seed)["tree"]
        assert (((trees < 0) | (trees > 10)).any(axis=1)).all()
        counts = np.histogram(np.arctan2(*(trees - 5).T), bins=12, range=(-np.pi, np.pi))[0]
        assert (counts == 0).any(), "there are gaps"
        assert (counts > 0).sum() >= 5, "but it goes around"


def test_origin_makes_the_world_again():
    world = grown("meadow", 3)
    origin = json.loads(json.dumps(world.origin))
    assert origin == world.origin
    assert (origin["preset"], origin["seed"]) == ("meadow", 3)
    again = WorldParams.from_dict(origin["params"])
    assert again == PRESETS["meadow"]
    small = grown("tiny", 3).origin
    assert digest(generate_world(WorldParams.from_dict(small["params"]), small["seed"])) == digest(grown("tiny", 3))


def test_an_empty_world_can_be_grown():
    none = {name: 0.0 for name in PRESETS["tiny"].to_dict() if name.endswith("_density")}
    world = generate_world(WorldParams.from_dict(none | {"trees": 0}), 0)
    assert len(world.triangles) == 0
    assert np.isinf(clearance(world, np.array([[1.0, 1.0]]))).all()
    assert generate_route(world, 0).length == pytest.approx(8, rel=0.1)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("field_width", 0.0),
        ("tussock_density", -1.0),
        ("grass_height", float("nan")),
        ("trees", -1),
        ("dry_share", 1.2),
        ("sky_rgb", [300, 0, 0]),
        ("colour", 3),
    ],
)
def test_bad_parameters_are_named(name, value):
    with pytest.raises(InputError, match=name):
        WorldParams.from_dict({name: value})


def test_values_of_a_wrong_type_are_named_too():
    """In a process of its own: here the type checker would speak first."""
    code = (
        "from tussock.world.params import WorldParams\n"
        "for name, value in {'bush_height': 'tall', 'trees': 2.5, 'ground_rgb': [1, 2], 'haze': None}.items():\n"
        "    try: WorldParams.from_dict({name: value})\n"
        "    except ValueError as error: assert str(error).startswith(f'{name} is '), error\n"
        "    else: raise SystemExit(name)\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


@pytest.mark.parametrize("seed", [-1, True])
def test_a_bad_seed_is_refused(seed):
    with pytest.raises(InputError, match="seed"):
        generate_world(PRESETS["tiny"], seed)


# Clearance


def test_clearance_is_the_distance_to_what_stands_in_the_way():
    blade = [[1.0, 0.9, 0.0], [1.0, 1.1, 0.0], [1.0, 1.0, 0.3]]
    leaning = [[0.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 0.5, 1.0]]  # body height is reached 6 cm from its foot
    lying = [[0.0, 0.0, 0.001], [2.0, 0.0, 0.007], [1.0, 2.0, 0.002]]
    overhead = [[0.0, 0.0, 0.07], [2.0, 0.0, 0.2], [1.0, 2.0, 0.1]]
    sunk = [[0.0, 0.0, -0.1], [2.0, 0.0, -0.1], [1.0, 2.0, 0.1]]  # its upper half is above the ground, y from 1 m on
    places = np.array([[1.5, 1.0], [1.0, 1.5], [0.5, 0.5], [0.02, 0.5]])
    np.testing.assert_allclose(clearance(bare([blade]), places[:2]), [0.5, 0.4], atol=1e-6)
    np.testing.assert_allclose(clearance(bare([leaning]), places[2:]), [0.44, 0.0], atol=1e-6)
    np.testing.assert_allclose(clearance(bare([sunk]), np.array([[1.0, 0.8], [1.0, 1.3]])), [0.2, 0.0], atol=1e-6)
    assert np.isinf(clearance(bare([lying, overhead]), places)).all()


# Routes


@pytest.mark.parametrize(
    ("preset", "seed"),
    [*(("tussock-field", s) for s in range(2)), ("meadow", 1), ("scrub", 1), ("tiny", 1), ("tiny", 2)],
)
def test_a_route_can_be_walked(preset, seed):
    world = grown(preset, 3)
    route = generate_route(world, seed)
    wanted = 8.0 if preset != "tiny" else 0.8 * np.hypot(3, 3)
    assert route.length == pytest.approx(wanted, rel=0.1)
    assert world.field.contains(*route.xy.T).all()
    assert clearance(world, route.resampled(0.005).xy).min() > 0.02
    steps = np.diff(route.arc)
    assert 0.005 < steps.min() <= steps.max() < 0.015
    turns = np.abs(wrap_angle(route.poses[2:, 2] - route.poses[:-2, 2]))
    assert turns.max() < np.radians(45)
    np.testing.assert_array_equal(generate_route(world, seed).poses, route.poses)


def test_routes_differ_and_have_corners():
    world = grown("tiny", 1)
    routes = [generate_route(world, seed) for seed in range(6)]
    assert len({route.poses.tobytes() for route in routes}) == 6
    for route in routes:
        assert np.ptp(np.unwrap(route.poses[:, 2])) > np.radians(35)


def test_a_route_is_as_long_as_asked():
    assert generate_route(grown("tussock-field", 3), 0, length=3.0).length == pytest.approx(3.0, rel=0.02)


def test_a_world_without_room_is_refused():
    floor = [[[0, 0, 0.02], [2, 0, 0.02], [2, 2, 0.02]], [[0, 0, 0.02], [2, 2, 0.02], [0, 2, 0.02]]]
    with pytest.raises(InputError, match="clear of plants"):
        generate_route(bare(floor), 0)


@pytest.mark.parametrize("length", [0.0, -1.0, float("nan")])
def test_a_bad_length_is_refused(length):
    with pytest.raises(InputError, match="length"):
        generate_route(grown("tiny", 1), 0, length=length)


def test_a_world_is_spelled_with_its_parameters():
    spelled = World.generate("tiny field_width=2.5 tussock_rgb=10,200,30 clearings=1", 4)
    params = dataclasses.replace(PRESETS["tiny"], field_width=2.5, tussock_rgb=(10, 200, 30), clearings=1)
    assert digest(spelled) == digest(generate_world(params, 4))
    assert World.generate("tiny", 4).origin["preset"] == "tiny"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "unknown preset ''; known: tussock-field"),
        ("tiny width=3", "world 'tiny width=3': tiny has no parameter 'width'; its parameters are field_width"),
        ("tiny field_width=900", "field_width is 900"),
        ("tiny seed=3", "give it as --seed"),
    ],
)
def test_a_world_that_is_misspelled_is_refused(text, message):
    with pytest.raises(InputError, match=re.escape(message)):
        World.generate(text, 0)
