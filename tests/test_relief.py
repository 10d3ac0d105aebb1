"""Laws of generated worlds whose ground is not flat: its heights, what stands on it, files, routes and walks."""

import hashlib
from functools import cache

import numpy as np
import pytest
from navigators import Ahead
from test_scanline import embree, share_different

from tussock.navigation.experiment import Experiment
from tussock.navigation.stopping import StoppingRules, StopReason
from tussock.navigation.surroundings import Surroundings
from tussock.navigation.walk import Walk
from tussock.render.eye import Eye
from tussock.render.posture import Posture
from tussock.render.renderer import open_renderer
from tussock.world.errors import FileError, InputError, SettingError
from tussock.world.files import read_world, write_world
from tussock.world.full_pose import slopes_under
from tussock.world.generate import generate_relief
from tussock.world.geometry import Pose, Route
from tussock.world.meshes.ply_header import comments_of, read_header
from tussock.world.obstacles import clearance, footprints
from tussock.world.params import WORLDS, WorldParams
from tussock.world.relief import Relief
from tussock.world.routes import check_route, generate_route
from tussock.world.scene import World
from tussock.world.terrain import STEP_HEIGHT, Terrain

HILLS = "hill_height=0.4 hill_size=3"
ALL = f"{HILLS} mound_density=0.4 rut_depth=0.06 rut_width=0.4"
STEEP = "mound_density=1.2 mound_height=0.3 mound_width=0.4"
RELIEFS = {
    "hills": {"hill_height": 1.0, "hill_size": 3.0},
    "mounds": {"mound_density": 0.5, "mound_height": 0.15},
    "ruts": {"rut_depth": 0.1},
    "all": {"hill_height": 0.5, "mound_density": 0.5, "rut_depth": 0.05},
}


@cache
def generated(text: str, seed: int = 3) -> World:
    return World.generate(text, seed)


def part_of(world: World) -> slice:
    """The triangles of the ground."""
    assert isinstance(world.terrain, Terrain)
    assert world.terrain.part is not None
    return slice(*world.terrain.part)


def somewhere(world: World, n: int, seed: int = 0) -> np.ndarray:
    """Positions in the field that can be stood on."""
    xy = np.random.default_rng(seed).uniform(world.field[:2], world.field[2:], (2 * n, 2))
    return xy[world.stands(xy)][:n]


# The height field


@pytest.mark.parametrize("name", RELIEFS)
def test_the_relief_is_that_of_its_seed_and_smooth(name):
    params = WorldParams(field_width=6.0, field_depth=5.0, **RELIEFS[name])
    one, again, other = (Relief.of(params, np.random.default_rng(seed)) for seed in (1, 1, 2))
    xy = np.random.default_rng(0).uniform((-3, -3), (9, 8), (4000, 2))
    np.testing.assert_array_equal(one.height(xy), again.height(xy))
    assert np.abs(one.height(xy) - other.height(xy)).max() > 0.02
    step = np.random.default_rng(1).normal(size=xy.shape)
    step *= 1e-3 / np.hypot(*step.T)[:, None]
    rise, next_rise = (one.height(xy + k * step) - one.height(xy + (k - 1) * step) for k in (1, 2))
    assert np.abs(rise).max() < 2e-3  # no cliff: a slope of less than 64 degrees
    assert np.quantile(np.abs(next_rise - rise), 0.999) < 1e-4  # no edge, but where two mounds meet


def test_the_relief_has_the_sizes_that_are_asked_for():
    xy = np.stack(np.meshgrid(*[np.linspace(0, 10, 400)] * 2), axis=-1).reshape(-1, 2)
    for seed in range(3):
        rng = np.random.default_rng(seed)
        hills = Relief.of(WorldParams(hill_height=0.8), rng).height(xy)
        assert 0.5 < np.ptp(hills) <= 0.8
        ruts = Relief.of(WorldParams(rut_depth=0.07), rng).height(xy)
        assert ruts.min() == pytest.approx(-0.07, rel=0.02)
        assert 0.01 < (ruts < -0.035).mean() < 0.3
        mounds = Relief.of(WorldParams(mound_density=0.5, mound_height=0.1), rng).height(xy)
        assert mounds.min() == 0
        assert 0.1 < mounds.max() < 0.2
    flat = Relief.of(WorldParams(), np.random.default_rng(0))
    assert not flat.height(xy).any()


def test_changing_one_kind_of_relief_leaves_the_others_where_they_are():
    xy = np.random.default_rng(0).uniform(0, 10, (500, 2))
    few = Relief.of(WorldParams(hill_height=1.0, mound_density=0.3), np.random.default_rng(3))
    more = Relief.of(WorldParams(hill_height=2.0, mound_density=0.3, rut_depth=0.1), np.random.default_rng(3))
    np.testing.assert_array_equal(few.mounds(xy), more.mounds(xy))
    np.testing.assert_allclose(2 * few.hills(xy), more.hills(xy))


# The world


@pytest.mark.parametrize("text", [f"tiny {ALL}", f"tiny {HILLS} speckle=0.2 moss_share=0.4"])
def test_the_same_seed_gives_the_same_bytes(text):
    one, again = generated(text), World.generate(text, 3)
    for name in ("triangles", "rgb"):
        assert getattr(one, name).tobytes() == getattr(again, name).tobytes()
    assert one.terrain.is_ground.tobytes() == again.terrain.is_ground.tobytes()
    assert one.triangles.tobytes() != World.generate(text, 4).triangles.tobytes()


@pytest.mark.parametrize(
    ("preset", "seed", "known"),
    [
        ("tussock-field", 5, "b9ba584065f4"),
        ("meadow", 1, "6bd2e97cbbe1"),
        ("scrub", 0, "0c7ecb70ea39"),
        ("tiny", 7, "fb442f56d78c"),
        ("orchard", 5, "feda953a0646"),
        (
            "tiny speckle=0.2 litter_density=50 hedge_height=1.5 herb_density=3 culm_density=3 tree_density=0.1",
            1,
            "104bc2a6319c",
        ),
    ],
)
def test_flat_worlds_are_to_the_byte_what_they_were_before_there_was_relief(preset, seed, known):
    world = generated(preset, seed)
    assert world.terrain is None
    assert hashlib.sha256(world.triangles.tobytes() + world.rgb.tobytes()).hexdigest()[:12] == known


def test_a_terrain_consists_of_the_triangles_of_the_ground_and_covers_it_once():
    world = generated(f"tiny {ALL} grass_density=40")
    ground = world.triangles[part_of(world)].astype(float)
    assert world.ground is None
    assert not world.terrain.is_ground[: part_of(world).start].any()
    sides = ground[:, 1:, :2] - ground[:, :1, :2]
    area = (sides[:, 0, 0] * sides[:, 1, 1] - sides[:, 0, 1] * sides[:, 1, 0]) / 2
    assert area.min() >= 0, "they face up"
    assert area.sum() == pytest.approx(15 * 15, rel=1e-5)
    edges = np.hypot(*np.moveaxis(ground[:, [1, 2, 0], :2] - ground[..., :2], -1, 0)).max(axis=1)
    inside = world.field.contains(*ground[..., :2].mean(axis=1).T)
    assert edges[inside].max() < 0.35
    around = ~world.field.widened(3).contains(*ground[..., :2].mean(axis=1).T)
    assert np.median(edges[around]) > 3 * np.median(edges[inside])


@pytest.mark.parametrize("text", [f"tiny {ALL}", f"tiny {HILLS} speckle=0.2"])
def test_heights_are_where_rays_from_above_meet_the_ground_that_is_drawn(text):
    import trimesh

    world = generated(text)
    xy = somewhere(world, 300)
    ground = world.triangles[part_of(world)]
    mesh = trimesh.Trimesh(ground.reshape(-1, 3), np.arange(3 * len(ground)).reshape(-1, 3), process=False)
    above = np.column_stack([xy, np.full(len(xy), 10.0)])
    hit, ray, _ = mesh.ray.intersects_location(above, np.tile([0.0, 0.0, -1.0], (len(xy), 1)), multiple_hits=False)
    highest = np.full(len(xy), np.nan)
    highest[ray] = hit[:, 2]
    np.testing.assert_allclose(world.ground_height(xy), highest, atol=2e-5)
    relief = generate_relief(WorldParams(**world.origin["params"]), 3)
    np.testing.assert_allclose(world.ground_height(xy), relief.relief.height(xy), atol=0.02)


def test_all_but_trees_has_the_height_over_the_ground_that_it_has_on_flat_ground():
    """Trees keep their shape: all of a tree is raised as much as its foot."""
    cover = "tiny litter_density=20 pebble_density=10 herb_density=3 culm_density=3 stone_density=1 leaf_density=2 bush_density=0.3"
    flat, raised = generated(f"{cover} trees=0"), generated(f"{cover} trees=0 {ALL}")
    n = len(flat.triangles)
    assert part_of(raised).start == n
    np.testing.assert_array_equal(raised.triangles[:n, :, :2], flat.triangles[..., :2])
    land = generate_relief(WorldParams(**raised.origin["params"]), 3)
    ground = land.height(flat.triangles[..., :2].reshape(-1, 2)).reshape(n, 3)
    np.testing.assert_allclose(raised.triangles[:n, :, 2] - ground, flat.triangles[..., 2], atol=1e-6)
    tree, on_hill = (generated(f"tiny tussock_density=0 grass_density=0 trees=1 {each}") for each in ("", ALL))
    lift = (on_hill.triangles[: len(tree.triangles)] - tree.triangles).reshape(-1, 3)
    foot = tree.triangles.reshape(-1, 3)[tree.triangles[..., 2].argmin()].astype(float)
    assert np.ptp(lift, axis=0) == pytest.approx(0, abs=1e-5)
    assert lift[0, 2] == pytest.approx(on_hill.ground_height(foot[None, :2])[0], abs=0.02)


def test_obstacles_are_those_of_the_flat_world():
    """But for a slope that is too steep, which counts as one."""
    flat, raised = (generated(f"tiny stone_density=1 pebble_density=5 {each}") for each in ("", HILLS))
    assert len(footprints(flat)) == len(footprints(raised)) > 20
    xy = somewhere(flat, 200)
    np.testing.assert_allclose(clearance(flat, xy), clearance(raised, xy), atol=2e-3)


def test_low_pebbles_are_walked_over_and_high_ones_are_obstacles():
    bare = "tiny tussock_density=0 grass_density=0 trees=0 pebble_density=30"
    low, high = generated(f"{bare} pebble_size=0.01"), generated(f"{bare} pebble_size=0.08")
    assert 0.001 < low.triangles[..., 2].max() < STEP_HEIGHT
    assert len(footprints(low)) == 0
    tall = high.triangles[..., 2].reshape(270, -1).max(axis=1) >= STEP_HEIGHT
    assert tall.mean() > 0.5
    middle = high.triangles[..., :2].reshape(270, -1, 2).mean(axis=1).astype(float)
    assert clearance(high, middle[tall]).max() < 0.02


def test_far_hills_are_all_around_and_the_ground_reaches_to_them():
    world = generated("tiny tussock_density=0 grass_density=0 trees=0 far_hill_height=20 far_hill_distance=100")
    eye = Eye(width=360, height=90, top=np.radians(30), bottom=-np.radians(15), z=0.02)
    with open_renderer(world, eye, "cpu") as renderer:
        view = renderer.render([(1.5, 1.5, 0.0)])[0]
    seen = view[..., 3] > 0
    assert seen[60:].all(), "no gap at the horizon or below"
    top = seen.argmax(axis=0)  # rows of half a degree
    assert (top < 59).all()
    assert len(np.unique(top)) > 5
    assert np.hypot(*np.moveaxis(world.triangles[..., :2] - 1.5, -1, 0)).min() > 100


# The eye and the body


@pytest.mark.parametrize("text", ["tussock-field hill_height=0.8 rut_depth=0.1", f"tiny {ALL}"])
def test_the_eye_stands_on_it_and_views_equal_embree(text):
    surroundings = Surroundings(world=text, seed=3, eye=Eye(width=360, height=75))
    world = surroundings.open_world()
    poses = np.column_stack([somewhere(world, 4), [0.0, 1.0, 2.0, -2.0]])
    with surroundings.open_renderer(world) as renderer:
        full = [renderer.render(poses), [embree(world, renderer.eye, pose) for pose in poses]]
    assert max(share_different(*pair) for pair in zip(*full, strict=True)) < 0.002
    assert all((view[..., 3] == 0).mean() > 0.2 for view in full[0]), "no eye is in a hill"


def test_bodies_pitch_and_roll_on_slopes():
    world = generated(f"tiny {HILLS}")
    poses = np.column_stack([somewhere(world, 50), np.random.default_rng(0).uniform(-3, 3, 50)])
    pitch, roll = slopes_under(world, poses, 0.02)
    assert min(np.abs(pitch).max(), np.abs(roll).max()) > np.radians(5)
    assert Posture(gaze="body").tilts(world)


def test_what_is_asked_for_of_the_ground():
    text = f"tiny {HILLS}"
    own = generated(text)
    for ground in ("flat", "mesh"):
        world = Surroundings(world=text, world_seed=3, ground=ground).open_world()
        np.testing.assert_array_equal(world.terrain.is_ground, own.terrain.is_ground)
        assert world.terrain.part == own.terrain.part
        world = Surroundings(world=text, world_seed=3, ground=ground, max_slope=np.radians(8)).open_world()
        assert world.terrain.is_ground.sum() < 0.9 * own.terrain.is_ground.sum()
    assert Surroundings(world=own).open_world() is own
    with pytest.raises(SettingError, match=r"z = 0.05 m is under the ground of the world, which is 0\.\d+ m high"):
        Surroundings(world=own, altitude=0.05).open_world()
    high = Surroundings(world=own, altitude=0.5).open_world()
    assert (high.ground_height(somewhere(own, 5)) == 0.49).all()
    xy = np.array([(0.5, 0.5), (2.5, 2.5)])
    for z, refused in ((own.ground_height(xy).max() + 0.1, False), (own.ground_height(xy).max() - 0.01, True)):
        heights = np.array([z, z])
        flying = Surroundings(world=own, ground="route", route=Route(Route.through(xy).poses, heights=heights))
        if refused:
            with pytest.raises(SettingError, match="under the ground of the world"):
                flying.open_world()
        else:
            flying.open_world()


def test_ground_that_is_too_steep_everywhere_is_refused_in_one_line():
    with pytest.raises(InputError, match=r"no surface to stand on.*lower hills, mounds or ruts"):
        generated(f"tiny {HILLS}").on_mesh(max_slope=1e-9)


def test_a_ground_with_too_many_points_is_refused():
    with pytest.raises(SettingError, match=r"mounds or ruts need, would have .* points in this field"):
        generated("tiny field_width=100 field_depth=100 rut_depth=0.05 rut_width=0.1")


# Files


@pytest.mark.parametrize("suffix", [".glb", ".ply"])
def test_a_file_holds_all_of_it(tmp_path, suffix):
    world = generated(f"tiny {ALL} speckle=0.1").on_mesh(np.radians(30))
    write_world(world, tmp_path / f"a{suffix}")
    again = read_world(tmp_path / f"a{suffix}")
    for name in ("triangles", "rgb"):
        np.testing.assert_array_equal(getattr(again, name), getattr(world, name))
    assert (again.ground, again.field, again.origin, again.sky_rgb) == (None, world.field, world.origin, world.sky_rgb)
    np.testing.assert_array_equal(again.terrain.is_ground, world.terrain.is_ground)
    assert (again.terrain.part, again.terrain.max_slope) == (world.terrain.part, world.terrain.max_slope)
    xy = somewhere(world, 50)
    np.testing.assert_array_equal(again.ground_height(xy), world.ground_height(xy))
    opened = Surroundings(world=str(tmp_path / f"a{suffix}"), max_slope=np.radians(30)).open_world()
    np.testing.assert_array_equal(opened.ground_height(xy), world.ground_height(xy))
    write_world(again, tmp_path / f"b{suffix}")
    assert (tmp_path / f"a{suffix}").read_bytes() == (tmp_path / f"b{suffix}").read_bytes()


def test_only_a_file_with_a_terrain_has_the_new_version(tmp_path):
    for name, text, version in (("flat", "tiny", b'"version":2'), ("hills", f"tiny {HILLS}", b'"version":3')):
        write_world(generated(text), tmp_path / f"{name}.ply")
        assert version in (tmp_path / f"{name}.ply").read_bytes()[:9000]


@pytest.mark.parametrize("wrong", [[999999, 1000000], [-1, 5], [9, 3], ["a", 3]])
def test_a_file_with_a_damaged_terrain_is_refused(tmp_path, wrong):
    path = tmp_path / "a.ply"
    write_world(generated(f"tiny {HILLS}"), path)
    data = path.read_bytes()
    content = read_header(data).comment("tussock")
    lines = comments_of("tussock", content).encode()
    assert lines in data
    content["terrain"]["triangles"][:2] = wrong
    path.write_bytes(data.replace(lines, comments_of("tussock", content).encode()))
    with pytest.raises(FileError, match=r"metadata cannot be used.*write the world again"):
        read_world(path)


# Routes and walks


def test_routes_keep_off_steep_mounds():
    """Straight between the same ends, some of them would cross one."""
    crossing = 0
    for seed in range(6):
        world = generated(f"tiny {STEEP} tussock_density=0 field_width=4 field_depth=4", seed)
        steep = ~world.terrain.is_ground[part_of(world)]
        assert steep.sum() > 50
        route = generate_route(world, seed, 2.5)
        assert world.stands(route.xy).all()
        rise = np.diff(world.ground_height(route.xy))
        assert not world.terrain.is_too_steep(np.hypot(*np.diff(route.xy, axis=0).T), rise).any()
        straight = Route.through(np.linspace(route.xy[0], route.xy[-1], 200))
        crossing += not world.stands(straight.xy).all()
    assert crossing > 0


def test_a_walk_on_hills_arrives():
    experiment = Experiment(
        world=f"tiny {HILLS} rut_depth=0.05", seed=3, route_length=1.5, model="perfect-memory", eye=Eye(width=120, height=25),
        posture=Posture(gaze="body"),
    )  # fmt: skip
    trajectory = experiment.run()
    assert trajectory.summary()["arrived"]
    heights = trajectory.column("z_m")
    assert np.ptp(heights) > 0.02
    np.testing.assert_allclose(heights, experiment.open_world().ground_height(trajectory.xy), atol=1e-12)


def test_a_walk_ends_before_a_steep_mound():
    world = generated(f"tiny {STEEP} tussock_density=0 grass_density=0 field_width=4 field_depth=4", 0)
    ground = world.triangles[part_of(world)].astype(float).reshape(-1, 3)
    x, y = ground[ground[:, 2].argmax(), :2]  # the top of the highest mound
    start = Pose(x - 0.6, y, 0.0) if x > 2 else Pose(x + 0.6, y, np.pi)
    route = Route.through(np.linspace(start[:2], (x, y), 50))
    with pytest.raises(InputError, match="cannot be walked"):
        check_route(world, route)
    eye = Eye(width=60, height=12)
    with open_renderer(world, eye, "cpu") as renderer:
        walk = Walk(
            renderer=renderer, encoding=Experiment(eye=eye).encoding, route=route, starts=[start],
            stopping=StoppingRules(max_deviation=9, max_steps=50),
        )  # fmt: skip
        steps = [step for (step,) in walk.steps(Ahead())]
    assert steps[-1].reason == StopReason.TOO_STEEP
    assert 0.05 < np.hypot(steps[-1].pose.x - x, steps[-1].pose.y - y) < 0.55


def test_the_desert_has_far_hills_and_room_for_routes():
    params = WORLDS.find("desert")()
    assert params.far_hill_height > 0
    assert generate_route(generated("desert"), 1).length == pytest.approx(8, rel=0.02)
