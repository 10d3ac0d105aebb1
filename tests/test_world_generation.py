"""Laws of generated worlds and of the routes through them."""

import hashlib
import json
import os
import subprocess
import sys
from functools import cache

import cv2
import numpy as np
import pytest
from quick_cases import quick
from scipy.spatial import KDTree
from scipy.stats import chi2

from tussock import world as world_package
from tussock.world import params
from tussock.world.errors import InputError, SettingError
from tussock.world.files import open_world
from tussock.world.generate import _thinned, plant_layout
from tussock.world.geometry import Bounds, wrap_angle
from tussock.world.obstacles import footprints
from tussock.world.params import WORLDS, WorldParams, check_preset, is_generated
from tussock.world.paths import Paths
from tussock.world.routes import clearance, generate_route
from tussock.world.scene import Ground, World
from tussock.world.settings import describe

KINDS = {"tussock", "grass", "bush", "leaf", "stone", "tree", "herb", "culm", "litter", "inner_tree", "pebble"}
PRESETS = {name: WORLDS.find(name)() for name in params.PRESETS}
SEED = 5  # of most worlds here, so that each is generated once


@cache
def generated(preset: str, seed: int) -> World:
    return World.generate(preset, seed)


def digest(world: World) -> str:
    return hashlib.sha256(world.triangles.tobytes() + world.rgb.tobytes()).hexdigest()


def bare(triangles) -> World:
    """A 2 m x 2 m world of these triangles."""
    triangles = np.array(triangles, dtype=np.float32).reshape(-1, 3, 3)
    field = Bounds(0.0, 0.0, 2.0, 2.0)
    rgb = np.zeros((len(triangles), 3), np.uint8)
    return World(triangles=triangles, rgb=rgb, ground=Ground((9, 9, 9), field), sky_rgb=(200, 200, 200), field=field)


# Worlds


@pytest.mark.parametrize("preset", quick(PRESETS, "tussock-field", "meadow", "scrub", "tiny"))
def test_the_same_seed_gives_the_same_bytes(preset):
    assert digest(generated(preset, SEED)) == digest(World.generate(PRESETS[preset], SEED))


def test_other_seeds_give_other_worlds():
    assert len({digest(generated("tiny", seed)) for seed in range(10)}) == 10


def test_another_process_generates_the_same_world_and_route():
    code = (
        "from tussock.world import World, generate_route; import hashlib\n"
        "w = World.generate('tiny', 5)\n"
        "data = w.triangles.tobytes() + w.rgb.tobytes() + generate_route(w, 2).poses.tobytes()\n"
        "print(hashlib.sha256(data).hexdigest())"
    )
    there = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.strip()
    world = generated("tiny", 5)
    here = world.triangles.tobytes() + world.rgb.tobytes() + generate_route(world, 2).poses.tobytes()
    assert there == hashlib.sha256(here).hexdigest()


def rounded(*arrays) -> str:
    """Digest of arrays, to a tenth of a millimetre."""
    tenths = [np.round(array.astype(np.float64) * 1e4).astype(np.int64).tobytes() for array in arrays]
    return hashlib.sha256(b"".join(tenths)).hexdigest()[:12]


@pytest.mark.parametrize(
    ("text", "seed", "known", "route_seed", "length", "goal", "known_route"),
    [
        ("tussock-field", 5, "e59fd37d7cdc", 1, 8.0, None, "20eeee2ecff9"),
        ("meadow", 5, "c1512b59599e", 1, 8.0, None, "871cdc715564"),
        ("scrub", 5, "700445762445", 1, 8.0, None, "1edbab5cb472"),
        ("tiny", 5, "76b543786054", 1, 8.0, None, "acd623f325ac"),
        ("hay-meadow", 5, "bc4ffce89c18", 1, 8.0, None, "4eff9ad08bed"),
        ("woodland", 5, "cd1ad26ca428", 1, 8.0, None, "04281bba0a6a"),
        ("desert", 5, "655f3baba286", 1, 8.0, None, "5fe7fb714614"),
        ("arena", 5, "7a987d3884a1", 1, 2.0, None, "010f399971d8"),
        (
            "tiny hill_height=0.5 mound_density=0.4 rut_depth=0.06 pebble_density=5",
            5,
            "16aeada23897",
            1,
            3.0,
            None,
            "e8343d81d4ef",
        ),
        ("meadow flower_share=1 grass_height=0.14 field_depth=4", 2, "f93518b80c0f", 3, 4.0, None, "26d410f2c95c"),
        ("tussock-field field_width=18 field_depth=14", 1, "dc47bb3c69c3", 2, 12.0, None, "b05323666b9d"),
        ("scrub", 6, "38a27787c532", 1, 3.0, (3.25, 4.25), "94d931989501"),
        (
            "tiny tussock_density=0 grass_density=0 trees=0 field_width=4 field_depth=4",
            0,
            "e3b0c44298fc",
            0,
            4.0,
            (2.0, 2.0),
            "907bcf9e0812",
        ),
    ],
)
def test_a_seed_keeps_giving_the_same_world_and_route(text, seed, known, route_seed, length, goal, known_route):
    """A change of these digests raises GENERATOR, and makes all results before it incomparable."""
    world = generated(text, seed)
    assert rounded(world.triangles, world.rgb) == known
    assert rounded(generate_route(world, route_seed, length, goal).xy) == known_route


@pytest.mark.parametrize("apart", [0.0, 0.05, 0.3, 2.0])
def test_plants_keep_apart_from_all_that_were_placed_before(apart):
    rng = np.random.default_rng(0)
    for xy in (rng.uniform(-1, 9, (300, 2)), np.round(rng.uniform(-1, 6, (300, 2)), 1)):
        for count in (0, 20, 300):
            kept: list[np.ndarray] = []
            for point in xy:
                if len(kept) < count and all(np.hypot(*(point - other)) > apart or apart == 0 for other in kept):
                    kept.append(point)
            np.testing.assert_array_equal(_thinned(xy, count, apart), np.reshape(kept, (-1, 2)))


@pytest.mark.parametrize("preset", PRESETS)
def test_a_world_is_valid(preset):
    world = generated(preset, SEED)
    assert world.triangles.dtype == np.float32
    assert world.rgb.dtype == np.uint8
    assert np.isfinite(world.triangles).all()
    a, b, c = np.moveaxis(world.triangles.astype(float), 1, 0)
    assert np.linalg.norm(np.cross(b - a, c - a), axis=1).min() > 1e-8
    assert world.ground is not None
    assert world.ground.bounds.x_min < world.field.x_min < world.field.x_max < world.ground.bounds.x_max
    inside = world.ground.bounds.contains(world.triangles[..., 0], world.triangles[..., 1])
    assert inside.all(), "no plant is beyond the ground"
    assert np.abs(np.subtract(world.ground.rgb, world.sky_rgb)).max() > 60


def test_tiny_is_tiny_with_any_seed():
    assert max(len(World.generate("tiny", seed).triangles) for seed in range(40)) < 200


def test_the_default_world_is_as_large_as_planned():
    assert 15_000 <= len(generated("tussock-field", SEED).triangles) <= 27_000


def test_changing_one_kind_leaves_the_others_where_they_are():
    few = PRESETS["tussock-field"]
    more = WorldParams(**(few.to_dict() | {"bush_density": 0.2, "trees": 9}))
    here, there = (plant_layout(each, 1)[0] for each in (few, more))
    assert set(here) == KINDS
    for kind in KINDS - {"bush", "tree"}:
        np.testing.assert_array_equal(here[kind], there[kind])
    assert len(there["bush"]) > len(here["bush"])


@pytest.mark.parametrize("preset", ["tussock-field", "meadow", "scrub"])
def test_vegetation_is_clustered_more_than_chance(preset):
    """Counts in squares vary more, and neighbours are nearer, than in one of a thousand worlds with random positions."""
    seeds = (1, 2, 3)
    layouts = [plant_layout(PRESETS[preset], seed)[0] for seed in seeds]
    for kind in ("tussock", "grass"):
        positions = [layout[kind][:, :2] for layout in layouts]
        counts = [np.histogram2d(*xy.T, bins=10, range=[[0, 10], [0, 10]])[0] for xy in positions]
        dispersion = sum(99 * n.var(ddof=1) / n.mean() for n in counts)
        assert dispersion > chi2.ppf(0.999, 99 * len(seeds))
    for xy in positions:  # of the grass; tussocks keep apart
        density = len(xy) / np.prod(np.ptp(xy, axis=0))
        nearest = KDTree(xy).query(xy, k=2)[0][:, 1].mean()
        error = 0.26136 / np.sqrt(len(xy) * density)  # Clark and Evans 1954
        assert nearest < 0.5 / np.sqrt(density) - 3.3 * error


def test_most_of_the_ground_is_open():
    positions = np.random.default_rng(0).uniform(0.0, 10.0, (1500, 2))
    assert 0.1 < (clearance(generated("tussock-field", SEED), positions) < 0.04).mean() < 0.3


def test_the_skyline_differs_around_the_field():
    for seed in range(3):
        trees = plant_layout(PRESETS["tussock-field"], seed)[0]["tree"][:, :2]
        assert (((trees < 0) | (trees > 10)).any(axis=1)).all()
        counts = np.histogram(np.arctan2(*(trees - 5).T), bins=12, range=(-np.pi, np.pi))[0]
        assert (counts == 0).any(), "there are gaps"
        assert (counts > 0).sum() >= 5, "but there are trees on most sides"


def test_origin_makes_the_world_again():
    world = generated("meadow", SEED)
    origin = json.loads(json.dumps(world.origin))
    assert origin == world.origin
    assert (origin["preset"], origin["seed"]) == ("meadow", SEED)
    again = WorldParams(**origin["params"])
    assert again == PRESETS["meadow"]
    small = generated("tiny", 3).origin
    assert digest(World.generate(WorldParams(**small["params"]), small["seed"])) == digest(generated("tiny", 3))


def test_an_empty_world_can_be_generated():
    none = {name: 0.0 for name in PRESETS["tiny"].to_dict() if name.endswith("_density")}
    world = World.generate(WorldParams(**(none | {"trees": 0})), 0)
    assert len(world.triangles) == 0
    assert np.isinf(clearance(world, np.array([[1.0, 1.0]]))).all()
    assert generate_route(world, 0).length == pytest.approx(8, rel=0.1)


INVALID = {
    "field_width": (0.0, 101, None, "wide"),
    "tussock_density": (-1.0, [1]),
    "grass_height": (float("nan"), float("inf")),
    "trees": (-1, 2.5, True),
    "dry_share": (1.2,),
    "sky_rgb": ([300, 0, 0], [1, 2], "blue", 3),
    "haze": (None,),
    "speckle": (-0.1, 1.5),
    "tree_forks": (5, 1.5),
    "litter_density": (501,),
    "hill_height": (-0.1, float("nan")),
    "rut_width": (0.0,),
    "far_hill_distance": (5.0,),
}


@pytest.mark.parametrize(("name", "value"), [(name, value) for name, values in INVALID.items() for value in values])
def test_an_invalid_parameter_is_refused_by_name(name, value):
    with pytest.raises(SettingError, match=name):
        WorldParams(**{name: value})


def test_an_invalid_value_is_reported_with_its_range_and_unit():
    with pytest.raises(SettingError, match=r"field_width is 900.0; .*from 1 to 100 \(m\)"):
        World.generate("tiny field_width=900")


def test_every_parameter_has_a_range_a_unit_unless_it_is_a_colour_and_a_line_in_the_docs():
    for name, about in describe(WorldParams).items():
        assert about["low"] < about["high"] < float("inf")
        assert about["unit"] or name.endswith("_rgb")
        assert f"        {name}: " in (WorldParams.__doc__ or "")
    json.dumps(describe(WorldParams))


@pytest.mark.parametrize("seed", [-1, True])
def test_a_bad_seed_is_refused(seed):
    with pytest.raises(SettingError, match="seed"):
        World.generate("tiny", seed)


# Names of presets


def test_parameters_may_follow_a_preset():
    world = World.generate("tiny field_width=2.5 tussock_rgb=10,200,30 clearings=1", 4)
    params = PRESETS["tiny"].to_dict() | {"field_width": 2.5, "tussock_rgb": (10, 200, 30), "clearings": 1}
    assert digest(world) == digest(World.generate(WorldParams(**params), 4))
    assert world.origin["preset"] is None
    assert World.generate("tiny field_width=3", 4).origin["preset"] == "tiny"


@pytest.mark.parametrize(
    ("text", "parts"),
    [
        ("", ("unknown world ''", "tussock-field")),
        ("tiny width=3", ("'tiny width=3'", "tiny has no parameter 'width'", "field_width")),
        ("tiny field_width=900", ("field_width is 900", "100")),
        ("tiny world.glb", ("'tiny world.glb'", "'world.glb'", "name=value")),
        ("tiny seed=3", ("'tiny seed=3'", "seed=")),
    ],
)
def test_an_invalid_preset_is_refused_with_and_without_generating_it(text, parts):
    for refuse in (World.generate, check_preset):
        with pytest.raises(SettingError) as refusal:
            refuse(text)
        assert all(part in str(refusal.value) for part in parts), refusal.value


OUTSIDE = """
import numpy as np
from functools import partial
from tussock.world import Bounds, World, WorldParams

DUNES = partial(WorldParams, field_width=2.0, field_depth=2.0, trees=3, tree_leaves=8, ground_rgb=(230, 200, 150))

def rocks(stones: float = 1.0) -> WorldParams:
    return WorldParams(field_width=2.0, field_depth=2.0, stone_density=stones, trees=0)

def slab(height: float = 1.0, *, seed: int) -> World:
    corners = np.array([[[0, 0, height], [1, 0, height], [1, 1, height + seed]]], np.float32)
    return World(triangles=corners, rgb=np.zeros((1, 3), np.uint8), ground=None, sky_rgb=(9, 9, 9), field=Bounds(0, 0, 1, 1))

def number(seed):
    return 3
"""
USE = """
import json, sys
from tussock.world import InputError, open_world
from tussock.world.params import check_preset
for text in sys.argv[1:]:
    try:
        check_preset(text)
        world = open_world(text, 4)
        print(json.dumps([len(world.triangles), float(world.triangles.max()), list(world.field), world.origin]))
    except InputError as error:
        print(json.dumps(str(error)))
"""


def test_presets_from_outside_work_by_location_and_by_entry_point(tmp_path):
    """In a process of its own, in the folder of the module, with a package that is installed elsewhere."""
    here, installed = tmp_path / "here", tmp_path / "installed"
    info = installed / "my_worlds-1.0.dist-info"
    for folder in (here, info):
        folder.mkdir(parents=True)
    (here / "my_presets.py").write_text(OUTSIDE)
    (installed / "my_worlds.py").write_text(OUTSIDE)
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: my-worlds\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text("[tussock.worlds]\nslab = my_worlds:slab\ndunes = my_worlds:DUNES\n")
    texts = [
        "my_presets:DUNES",
        "dunes trees=0 haze=0",
        "my_presets:rocks stones=0",
        "slab",
        "my_presets:slab height=2.5",
    ]
    wrong = ["dunes trees=-1", "my_presets:rocks trees=3", "my_presets:number", "my_presets:nothing", "my_presets:USE"]
    run = subprocess.run(
        [sys.executable, "-c", USE, *texts, *wrong],
        cwd=here,
        env=os.environ | {"PYTHONPATH": os.pathsep.join([str(installed), os.environ.get("PYTHONPATH", "")])},
        capture_output=True,
        text=True,
        check=True,
    )
    dunes, bare, rocks, slab, high_slab, *refused = map(json.loads, run.stdout.splitlines())
    assert dunes[2] == bare[2] == [0, 0, 2, 2]
    assert dunes[3]["params"]["ground_rgb"] == bare[3]["params"]["ground_rgb"] == [230, 200, 150]
    assert (dunes[3]["seed"], dunes[3]["params"]["trees"], bare[3]["params"]["trees"]) == (4, 3, 0)
    assert rocks[3]["params"]["stone_density"] == 0
    assert (slab[:2], high_slab[:2]) == ([1, 5.0], [1, 6.5])
    parts = (
        "trees is -1",
        "no parameter 'trees'; its parameters are stones",
        "of type int",
        "'my_presets:nothing'",
        "'my_presets:USE'",
    )
    for message, part in zip(refused, parts, strict=True):
        assert part in message


def test_a_registered_preset_is_generated_by_name(monkeypatch):
    monkeypatch.setattr(WORLDS, "_registered", {})
    assert not is_generated("plain")
    WORLDS.register("plain", lambda trees=0: WorldParams(field_width=1.0, field_depth=1.0, trees=trees))
    assert is_generated("plain trees=2")
    assert open_world("plain trees=2", 1).origin["params"]["trees"] == 2
    with pytest.raises(InputError, match="plain"):
        open_world("unknown")  # the message lists it


def test_the_public_names_are_listed_and_each_loads():
    names = {"World", "Pose", "Route", "Bounds", "Ground", "WorldParams", "open_world", "read_world", "write_world"}
    names.add("Light")
    names |= {
        "read_route",
        "write_route",
        "generate_route",
        "MeshReading",
        "column_azimuths",
        "turn_of_columns",
        "no_progress",
    }
    names |= {"FullPose", "InputError", "SettingError", "FileError", "DiskFullError", "MissingDependencyError"}
    assert set(dir(world_package)) == set(world_package.__all__) == names
    for name in names:
        assert getattr(world_package, name).__name__ == name


# Clearance


def test_clearance_is_the_distance_to_the_nearest_obstacle():
    blade = [[1.0, 0.9, 0.0], [1.0, 1.1, 0.0], [1.0, 1.0, 0.3]]
    leaning = [[0.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 0.5, 1.0]]  # body height is reached 6 cm from its foot
    lying = [[0.0, 0.0, 0.001], [2.0, 0.0, 0.007], [1.0, 2.0, 0.002]]
    overhead = [[0.0, 0.0, 0.07], [2.0, 0.0, 0.2], [1.0, 2.0, 0.1]]
    sunk = [[0.0, 0.0, -0.1], [2.0, 0.0, -0.1], [1.0, 2.0, 0.1]]  # its upper half is above the ground, y from 1 m on
    positions = np.array([[1.5, 1.0], [1.0, 1.5], [0.5, 0.5], [0.02, 0.5]])
    np.testing.assert_allclose(clearance(bare([blade]), positions[:2]), [0.5, 0.4], atol=1e-6)
    np.testing.assert_allclose(clearance(bare([leaning]), positions[2:]), [0.44, 0.0], atol=1e-6)
    np.testing.assert_allclose(clearance(bare([sunk]), np.array([[1.0, 0.8], [1.0, 1.3]])), [0.2, 0.0], atol=1e-6)
    assert np.isinf(clearance(bare([lying, overhead]), positions)).all()


@pytest.mark.parametrize("seed", range(12))
def test_clearance_is_that_of_looking_at_every_obstacle(seed):
    """Triangles of all sizes, some upright, at positions in them, among them and far from all."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 150))
    size = 10.0 ** rng.uniform(-2, 0.5, (n, 1, 1))
    triangles = rng.uniform([[[0, 0, -0.01]]], [[[2, 2, 0.1]]], (n, 1, 3)) + size * rng.normal(size=(n, 3, 3))
    triangles[: n // 4, 2, :2] = triangles[: n // 4, 0, :2]
    world = bare(triangles)
    spread = [rng.uniform(-1, 3, (600, 2)), rng.uniform(-300, 300, (20, 2)), world.triangles[:, 0, :2].astype(float)]
    positions = np.concatenate(spread)
    shapes = footprints(world).astype(np.float32)
    each = [
        [max(0.0, -cv2.pointPolygonTest(shape, position, measureDist=True)) for shape in shapes]
        for position in positions.tolist()
    ]
    expected = np.min(each, axis=1, initial=np.inf)
    np.testing.assert_allclose(clearance(world, positions), expected, atol=2e-5)


# Routes


@pytest.mark.parametrize(
    "preset", ["scrub field_width=6 field_depth=6", "tiny", "tiny tussock_density=0 grass_density=0 trees=0"]
)
def test_the_cheapest_path_is_that_of_a_search_in_the_whole_field(preset):
    """Also where many paths cost the same, as in an empty field."""
    world = generated(preset, 3)
    paths = Paths.of(world, world.field.widened(-0.1))
    whole = (0, paths.shape[0], 0, paths.shape[1])
    rng = np.random.default_rng(0)
    shorter = 0
    for start, stop in rng.choice(paths.nodes, (25, 2)).tolist():
        cost, path, is_unique = paths._search(whole, start, stop)
        assert paths._cheapest(start, stop) == path
        straight = float(np.hypot(*np.diff(paths.xy(np.array([start, stop])), axis=0)[0]))
        shorter += paths._window(paths.xy(np.array([start, stop])), 1.2 * straight) != whole
        assert is_unique or world.origin["params"]["trees"] == 0
        assert cost >= straight * (1 - 1e-12)
    assert shorter > 10  # a window is less than the field


@pytest.mark.parametrize(
    ("preset", "seed"),
    [
        *(("tussock-field", s) for s in range(2)),
        ("meadow", 1),
        ("scrub", 1),
        ("tiny", 1),
        ("tiny", 2),
        ("hay-meadow", 1),
        ("woodland", 1),
    ],
)
def test_a_route_is_smooth_and_clear_of_obstacles(preset, seed):
    world = generated(preset, SEED)
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
    world = generated("tiny", 1)
    routes = [generate_route(world, seed) for seed in range(6)]
    assert len({route.poses.tobytes() for route in routes}) == 6
    for route in routes:
        assert np.ptp(np.unwrap(route.poses[:, 2])) > np.radians(35)


def test_a_route_has_the_requested_length():
    assert generate_route(generated("tussock-field", SEED), 0, length=3.0).length == pytest.approx(3.0, rel=0.02)


def test_a_world_without_room_is_refused():
    floor = [[[0, 0, 0.02], [2, 0, 0.02], [2, 2, 0.02]], [[0, 0, 0.02], [2, 2, 0.02], [0, 2, 0.02]]]
    with pytest.raises(InputError, match="clear of plants"):
        generate_route(bare(floor), 0)


def test_a_short_route_is_found_among_dense_plants():
    """Where all corners of some draws are nearest to one node."""
    world = World.generate("tiny tussock_density=20", 0)
    for seed in range(6):
        assert generate_route(world, seed, 0.1).length == pytest.approx(0.1, rel=0.1)


@pytest.mark.parametrize("length", [0.0, -1.0, float("nan")])
def test_a_bad_length_is_refused(length):
    with pytest.raises(InputError, match="length"):
        generate_route(generated("tiny", 1), 0, length=length)


def test_a_route_that_is_shorter_than_was_asked_for_says_so(caplog):
    world = World.generate("tiny", 1)
    assert generate_route(world, 1, length=100.0).length == pytest.approx(3.39, abs=0.05)
    assert "a route of 100 m does not fit into the field" in caplog.text
    caplog.clear()
    generate_route(world, 1)
    assert caplog.text == ""
