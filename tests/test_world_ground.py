"""Laws of what covers the ground of generated worlds, of its end, and of trees with branches."""

from functools import cache

import numpy as np
import pytest
from scipy.spatial import KDTree

from tussock.render.eye import Eye
from tussock.render.renderer import open_renderer
from tussock.world.generate import plant_layout
from tussock.world.ground_cover import LITTER_Z, SPECKLE_Z, speckles
from tussock.world.params import WORLDS, WorldParams
from tussock.world.routes import clearance, generate_route
from tussock.world.scene import World
from tussock.world.terrain import STEP_HEIGHT
from tussock.world.trees import branching_tree

COVERED = ("hay-meadow", "woodland")
COVER = "speckle=0.2 moss_share=0.3 litter_density=50"
BARE = "tiny tussock_density=0 grass_density=0 trees=0"


@cache
def generated(text: str, seed: int = 3) -> World:
    return World.generate(text, seed)


def below_the_horizon(world: World, height: float) -> np.ndarray:
    """What eyes at a height (m) see from positions on a route, down to 30 degrees below the horizon: view, row, column, rgba."""
    poses = generate_route(world, 1, length=4.0).poses[::50]
    eye = Eye(width=360, height=60, top=0.0, bottom=-np.pi / 6, z=height)
    with open_renderer(world, eye, "cpu") as renderer:
        return renderer.render(poses)


@pytest.mark.parametrize("preset", [*COVERED, "tiny hedge_height=1.5"])
@pytest.mark.parametrize("height", [0.01, 0.1, 0.5])
def test_the_end_of_the_ground_is_not_seen(preset, height):
    assert (below_the_horizon(generated(preset), height)[..., 3] > 0).all()


def test_the_end_of_a_ground_without_a_hedge_is_seen():
    assert (below_the_horizon(generated("tiny"), 0.5)[..., 3] == 0).any()


@pytest.mark.parametrize(("preset", "low", "high"), [*((name, 0.0, 0.5) for name in COVERED), ("meadow", 0.6, 1.0)])
def test_the_covered_ground_is_not_of_one_colour(preset, low, high):
    for view in below_the_horizon(generated(preset), 0.01):
        count = np.unique(view.reshape(-1, 4), axis=0, return_counts=True)[1]
        assert low <= count.max() / count.sum() <= high


def test_speckles_cover_the_ground_once():
    params = WorldParams(field_width=3.0, field_depth=2.0, ground_margin=7.0, speckle=0.2, speckle_size=0.2)
    triangles, rgb, _ = speckles(params, np.random.default_rng(1))
    a, b, c = np.moveaxis(triangles[..., :2].astype(float), 1, 0)
    area = ((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]) / 2
    assert np.abs(area).sum() == pytest.approx(17 * 16, rel=1e-5)
    assert (np.ptp(triangles[..., :2], axis=(0, 1)) == (17, 16)).all()
    assert triangles[..., 2].min() >= np.float32(SPECKLE_Z[0])
    assert triangles[..., 2].max() <= SPECKLE_Z[1] < STEP_HEIGHT
    inside = params.field.contains(*np.moveaxis(triangles[..., :2].mean(axis=1), -1, 0))
    assert inside.sum() == pytest.approx(2 * 6 / 0.2**2, rel=0.2)  # two triangles for each corner
    assert len(np.unique(rgb, axis=0)) > 100


def test_moss_covers_its_share_of_the_ground():
    params = WorldParams(field_width=3.0, field_depth=2.0, moss_share=0.3, ground_rgb=(200, 0, 0), moss_rgb=(0, 200, 0))
    rgb = speckles(params, np.random.default_rng(1))[1]
    assert (rgb[:, 1] > 0).mean() == pytest.approx(0.3, abs=0.01)


def test_a_ground_of_one_colour_has_no_speckles():
    assert len(speckles(WorldParams(), np.random.default_rng(1)).rgb) == 0


def test_the_cover_of_the_ground_is_no_obstacle():
    world = generated(f"{BARE} {COVER}")
    assert len(world.triangles) > 1000
    assert world.triangles[..., 2].max() <= LITTER_Z[1] < STEP_HEIGHT
    assert np.isinf(clearance(world, np.array([[1.0, 1.0], [2.0, 1.5]]))).all()


@pytest.mark.parametrize("stems", [0.0, 1.0])
@pytest.mark.parametrize("green", [0.0, 1.0])
def test_litter_has_the_colours_of_its_parts(stems, green):
    parts = {"herb_rgb": (0, 250, 0), "leaf_rgb": (250, 0, 0), "dry_rgb": (0, 0, 250)}
    colours = " ".join(f"{name}={r},{g},{b}" for name, (r, g, b) in parts.items())
    rgb = generated(f"{BARE} litter_density=50 litter_stems={stems} litter_green={green} {colours}").rgb
    assert len(rgb) == 450  # one triangle for each of 50 per m2
    seen = {name for name, part in parts.items() if (rgb[:, np.argmax(part)] > 0).any()}
    assert seen == ({"dry_rgb"} if stems else {"herb_rgb"} if green else {"leaf_rgb", "dry_rgb"})


@pytest.mark.parametrize("size", ["", "field_width=20 field_depth=2 ground_margin=3"])
def test_a_hedge_closes_the_horizon(size):
    world = generated(f"{BARE} hedge_height=1 {size}")
    eye = Eye(width=720, height=1, top=0.01, bottom=0.0)
    x0, y0, x1, y1 = world.field
    poses = np.array([(x0, y0, 0.0), (x1, y0, 1.0), ((x0 + x1) / 2, y1, 2.0)])
    with open_renderer(world, eye, "cpu") as renderer:
        assert (renderer.render(poses)[..., 3] > 0).all()
    assert not world.field.contains(*np.moveaxis(world.triangles[..., :2], -1, 0)).any()


@pytest.mark.parametrize("forks", [1, 2, 3, 4])
@pytest.mark.parametrize("tone", [0.0, 1.0])
def test_the_leaves_of_a_tree_belong_to_its_branches(forks, tone):
    params = WorldParams(tree_forks=forks, tree_leaves=400, tree_height=4.0)
    triangles, rgb, _ = branching_tree(params, 4.0, tone, np.random.default_rng(forks))
    assert len(triangles) == len(rgb) < 3000
    wood, leaves = triangles[:-400], triangles[-400:]
    share = np.linspace(0, 1, 9)[:, None, None]
    along_wood = np.concatenate([wood[:, i] + share * (wood[:, j] - wood[:, i]) for i, j in ((0, 1), (1, 2), (2, 0))])
    distance = KDTree(along_wood.reshape(-1, 3)).query(leaves.mean(axis=1))[0]
    assert np.quantile(distance, 0.95) < 0.07 * 4.0
    assert 0.75 * 4.0 < triangles[..., 2].max() < 1.35 * 4.0
    assert triangles[..., 2].min() >= 0


def test_what_is_added_leaves_all_else_as_it_is():
    plain = generated("tussock-field")
    more = generated(f"tussock-field {COVER} herb_density=2 culm_density=2 tree_density=0.05 hedge_height=2")
    n = len(plain.triangles)
    np.testing.assert_array_equal(more.triangles[:n], plain.triangles)
    np.testing.assert_array_equal(more.rgb[:n], plain.rgb)
    assert len(more.triangles) > n + 1000


def test_the_cover_of_the_ground_leaves_routes_as_they_are():
    plain, covered = (generate_route(generated(text), 1) for text in ("tiny", f"tiny {COVER} hedge_height=1.5"))
    np.testing.assert_array_equal(plain.poses, covered.poses)


def test_trees_grow_in_a_wood():
    params = WORLDS.find("woodland")()
    layout = plant_layout(params, 3)[0]
    area = params.field.widened(params.border)
    assert len(layout["inner_tree"]) == round(params.tree_density * np.prod(area.size))
    assert area.contains(*layout["inner_tree"][:, :2].T).all()
