"""Laws of the arena: a wall all around, cues on it that its parameters decide, and a field that is inside."""

import numpy as np
import pytest

from tussock.render.eye import Eye
from tussock.render.renderer import open_renderer
from tussock.world.arena import CUE_RGB, FIELD, arena
from tussock.world.errors import SettingError
from tussock.world.params import check_preset
from tussock.world.routes import clearance, generate_route
from tussock.world.scene import World

EYE = Eye(width=720, height=90, top=np.radians(60), bottom=-np.radians(30), z=0.02)


def seen(world: World, x: float = 0.0, y: float = 0.0) -> np.ndarray:
    with open_renderer(world, EYE, "cpu") as renderer:
        return renderer.render([(x, y, 0.0)])[0]


def runs(row: np.ndarray) -> int:
    """Separate dark parts of a row around the circle."""
    return int((row & ~np.roll(row, 1)).sum())


def test_an_arena_is_that_of_its_seed():
    one, again, other = (World.generate("arena bars=5", seed) for seed in (4, 4, 5))
    assert one.triangles.tobytes() == again.triangles.tobytes()
    assert one.rgb.tobytes() == again.rgb.tobytes()
    assert one.triangles.tobytes() != other.triangles.tobytes()
    assert one.origin["bars"] == 5


@pytest.mark.parametrize("diameter", [0.6, 3.0, 20.0])
def test_the_wall_surrounds_the_field_without_a_gap(diameter):
    world = arena(1, diameter=diameter, wall_height=diameter / 5)
    (x0, y0, x1, y1) = world.field
    for x, y in ((x0, y0), (x1, y1), (0.0, y1), (0.0, 0.0)):
        view = seen(world, x, y)
        assert (view[59:, :, 3] > 0).all(), "wall or floor at the horizon and below"
        assert (view[0, :, 3] == 0).any(), "the sky above"
    corners = np.array([(x0, y0), (x1, y0), (x1, y1)])
    assert (clearance(world, corners) > 0.01 * diameter).all()
    assert np.hypot(x1, y1) < diameter / 2
    assert x1 == pytest.approx(FIELD * diameter / 2)


def test_the_wall_is_as_high_as_asked_for():
    view = seen(arena(1, diameter=4.0, wall_height=1.0, bars=0, shapes=0))
    top = (view[..., 3] > 0).argmax(axis=0)
    assert 60 - top == pytest.approx(np.degrees(np.arctan2(0.98, 2.0)), abs=1.1)


@pytest.mark.parametrize("bars", [0, 1, 7, 12])
def test_bars_are_as_many_as_asked_for(bars):
    for irregular in (0.0, 1.0):
        view = seen(arena(3, bars=bars, shapes=0, irregular=irregular))
        assert runs((view[57] == (*CUE_RGB[0], 255)).all(axis=-1)) == bars  # a row low on the wall


def test_regular_bars_are_stripes_of_one_width():
    dark = (seen(arena(3, bars=10, shapes=0, irregular=0.0))[57] == (*CUE_RGB[0], 255)).all(axis=-1)
    assert dark.mean() == pytest.approx(0.5, abs=0.02)
    edges = np.flatnonzero(dark != np.roll(dark, 1))
    assert np.abs(np.diff(edges) - 36).max() <= 1


def test_cues_do_not_cover_each_other_and_stay_on_the_wall():
    for seed in range(5):
        world = arena(seed, bars=8, shapes=6)
        is_cue = (world.rgb[:, None] == np.array(CUE_RGB)).all(axis=-1).any(axis=1)
        z = world.triangles[is_cue, :, 2]
        assert 0 <= z.min() < z.max() <= 0.7 + 1e-6
        away = np.hypot(*np.moveaxis(world.triangles[is_cue, :, :2].astype(float), -1, 0))
        assert (away < 1.5 * np.cos(np.pi / 240)).all()
        dark = (seen(world)[..., None, :3] == np.array(CUE_RGB)).all(axis=-1).any(axis=-1)
        assert runs(dark.any(axis=0)) == 14


def test_routes_are_inside_of_the_wall():
    world = World.generate("arena", 1)
    route = generate_route(world, 1)
    assert route.length > 2
    assert np.hypot(*route.xy.T).max() < 1.5


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"bars": -1}, "the arena's bars is -1; give a whole number from 0 to 100"),
        ({"diameter": 0.1}, "the arena's diameter is 0.1; give a number from 0.5 to 50"),
        ({"irregular": 2}, "the arena's irregular is 2; give a number from 0 to 1"),
        ({"wall_height": float("nan")}, "the arena's wall_height is nan"),
        ({"shapes": True}, "the arena's shapes is True"),
    ],
)
def test_impossible_arenas_are_refused(given, message):
    with pytest.raises(SettingError, match=message):
        arena(0, **given)


def test_an_unknown_parameter_is_refused():
    with pytest.raises(SettingError, match="has no parameter 'stripes'"):
        check_preset("arena stripes=3")
