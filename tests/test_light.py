"""Sun, shadows, sky and polarisation: against another ephemeris, Embree, the standards' own ratios, and laws of symmetry."""

import dataclasses
import math

import attrs
import numpy as np
import pytest
import torch
from scenes import hills, mesh_world, post, random_world, textured_world, world_of

from tussock.navigation.experiment import Experiment
from tussock.navigation.senses import Readings
from tussock.navigation.sky_compass import DorsalRim
from tussock.render import Eye, open_renderer
from tussock.render.changed_views import changed_world
from tussock.render.lighting import LIFT, TEXEL, light_on_triangles, lit
from tussock.render.occlusion import covered_within
from tussock.render.scanline import ScanlineRenderer
from tussock.render.shadows import in_the_sun, in_the_sun_on_a_level
from tussock.world.change import Change
from tussock.world.errors import SettingError
from tussock.world.files import read_world, write_world
from tussock.world.geometry import Bounds, wrap_angle
from tussock.world.light import Light, daylight, light_spec, polarisation, sky_luminance
from tussock.world.obstacles import clearance
from tussock.world.scene import World
from tussock.world.textures import Texture

# Azimuth (clockwise from north) and apparent elevation (degrees) by the Solar Position Algorithm of NREL (Reda and Andreas 2004), as
# pvlib 0.16.1 computes them at 1010 hPa and 15 degrees Celsius.
POSITIONS = [
    ("2003-10-17T12:30:30-07:00", 39.742476, -105.1786, 194.3402, 39.8919),  # the example of its paper
    ("2026-06-21T12:00", 51.48, 0.0, 179.1134, 61.9634),
    ("2026-12-21T09:30", 51.48, 0.0, 146.0743, 8.4474),
    ("2026-03-20T06:30", 0.0, 36.8, 90.1843, 42.4402),
    ("2026-09-23T02:00", -33.87, 151.21, 354.4803, 56.0476),
    ("2026-07-04T20:00", 37.77, -122.42, 167.4898, 74.7439),
    ("2026-11-02T10:00", 34.0, 9.5, 159.5248, 38.7721),
    ("2026-02-10T04:00", 28.6, 77.2, 127.5086, 27.9609),
    ("2026-05-01T16:45", -22.9, -43.2, 320.8634, 42.6109),
    ("2026-08-15T00:30", 69.65, 18.96, 24.5727, -4.3888),  # twilight
]
EVERYWHERE = np.random.default_rng(0).normal(size=(500, 3))
EVERYWHERE /= np.linalg.norm(EVERYWHERE, axis=1, keepdims=True)
LOW = Light(azimuth=0.7, elevation=math.radians(25))


@pytest.mark.parametrize(("time", "latitude", "longitude", "azimuth", "elevation"), POSITIONS)
def test_the_sun_is_where_another_ephemeris_has_it(time, latitude, longitude, azimuth, elevation):
    light = daylight(math.radians(latitude), math.radians(longitude), time)
    assert abs(wrap_angle(light.azimuth - math.radians(90 - azimuth))) * math.cos(light.elevation) < math.radians(0.1)
    assert abs(light.elevation - math.radians(elevation)) < math.radians(0.1)
    spec = f"daylight latitude_deg={latitude} longitude_deg={longitude} time={time}"
    assert light_spec(spec).make() == light


def test_night_and_what_is_no_time_are_refused():
    with pytest.raises(SettingError, match="night"):
        daylight(math.radians(64.1), math.radians(-21.9), "2026-01-15T21:00")
    with pytest.raises(SettingError, match="2026-06-21T10:30"):
        daylight(0.9, 0.0, "noon")
    with pytest.raises(SettingError, match="night"):
        Light().later(12)
    with pytest.raises(SettingError, match="did you mean 'sun'"):
        light_spec("snu")
    with pytest.raises(SettingError, match="elevation"):
        light_spec("sun elevation_deg=100")


def test_hours_later_the_sun_is_where_the_ephemeris_has_it():
    place = (math.radians(51.48), 0.0)
    morning, noon = daylight(*place, "2026-06-21T08:00"), daylight(*place, "2026-06-21T12:00")
    later = morning.later(4.0)
    assert math.acos(float(later.sun @ noon.sun)) < math.radians(0.1)
    assert morning.later(4.0).later(-4.0).sun == pytest.approx(morning.sun)
    assert later.latitude == morning.latitude


# Light


def test_what_faces_the_sun_is_brightest_and_clouds_even_out():
    light = Light(elevation=math.radians(40))
    bright = light.on(np.vstack([EVERYWHERE, light.sun]))
    assert bright.argmax() == len(EVERYWHERE) or bright[-1] > bright.max() - 0.01
    assert ((bright > 0) & (bright <= 1)).all()
    assert (light.on(EVERYWHERE, 0.0) <= bright[:-1]).all()
    under_clouds = Light(elevation=math.radians(40), clouds=1.0)
    assert under_clouds.direct == 0
    assert np.array_equal(under_clouds.on(EVERYWHERE, 1.0), under_clouds.on(EVERYWHERE, 0.0))
    assert under_clouds.on(np.array([[0.0, 0.0, 1.0]])) == pytest.approx(1.0)
    elevations = np.radians([-5, 0, 5, 15, 30, 60, 90])
    direct = [Light(elevation=e).direct for e in elevations]
    assert direct == sorted(direct)
    assert direct[-1] == pytest.approx(0.7, abs=0.001)


def test_rays_to_the_sun_agree_with_embree():
    from trimesh import Trimesh
    from trimesh.ray.ray_pyembree import RayMeshIntersector

    world, rng = random_world(3, 600), np.random.default_rng(1)
    points = rng.uniform([-3, -3, 0.05], [3, 3, 0.8], (20_000, 3))
    triangles = world.surfaces()[0]
    mesh = Trimesh(triangles.reshape(-1, 3), np.arange(3 * len(triangles)).reshape(-1, 3), process=False)
    for light in (LOW, Light(azimuth=0.0, elevation=0.5), Light(elevation=math.pi / 2)):
        free = in_the_sun(world, points, light.sun)
        hit = RayMeshIntersector(mesh, scale_to_box=False).intersects_any(points, np.tile(light.sun, (len(points), 1)))
        assert (free == ~hit).mean() > 0.9995
        assert 0.05 < free.mean() < 0.99


@pytest.mark.parametrize("azimuth", [0.0, 0.7, -2.5])
@pytest.mark.parametrize("elevation", [0.05, 0.5, 1.4, math.pi / 2])
def test_shadows_on_a_level_are_those_of_rays(azimuth, elevation):
    world, sun = random_world(5, 400), Light(azimuth=azimuth, elevation=elevation).sun
    part, rows, columns = Bounds(-3.0, -2.0, 2.0, 3.0), 70, 90
    x = -3.0 + (np.arange(columns) + 0.5) * 5 / columns
    y = 3.0 - (np.arange(rows) + 0.5) * 5 / rows
    points = np.stack([*np.meshgrid(x, y), np.full((rows, columns), 0.05)], axis=-1)
    free = in_the_sun(world, points.reshape(-1, 3), sun).reshape(rows, columns)
    assert (free == in_the_sun_on_a_level(world, part, rows, columns, 0.05, sun)).mean() > 0.9995
    assert 0.01 < free.mean() < 0.99


def test_the_shadow_of_a_pole_has_the_right_direction_and_length():
    height, light = 0.5, Light(azimuth=math.radians(70), elevation=math.radians(40))
    pole = world_of(post(0, 0, 0, height=height, width=0.02), np.full((10, 3), 100))
    texture = lit(pole, light).ground.parts[0].texture.rgba[..., 0].astype(int)
    rows, columns = np.nonzero(texture < (texture.min() + texture.max()) / 2)
    left, low, right, high = -3.0, -3.0, 3.0, 3.0
    x = left + (columns + 0.5) * (right - left) / texture.shape[1]
    y = high - (rows + 0.5) * (high - low) / texture.shape[0]
    away = np.hypot(x, y)
    tip = away.argmax()
    assert away[tip] == pytest.approx((height - LIFT) / math.tan(light.elevation), abs=0.01 + 2 * TEXEL)
    far = away > 0.1
    assert np.degrees(np.abs(wrap_angle(np.arctan2(y[far], x[far]) - light.azimuth - math.pi))).max() < 8
    mean = np.arctan2(y[far].mean(), x[far].mean())
    assert abs(wrap_angle(mean - light.azimuth - math.pi)) < math.radians(0.5)


def test_a_solid_shades_its_own_back_and_a_leaf_does_not():
    light = Light(azimuth=0.0, elevation=math.radians(30))
    box = world_of(post(0, 0, 0, height=0.5, width=0.2), np.full((10, 3), 200), ground=False)
    brightness = light_on_triangles(box, light)
    middle = box.triangles.mean(axis=1)
    towards, away = brightness[middle[:, 0] > 0.09], brightness[middle[:, 0] < -0.09]
    assert away.max() < 0.2 < 0.7 < towards.min()
    turned = dataclasses.replace(box, triangles=box.triangles[:, ::-1])
    assert np.allclose(light_on_triangles(turned, light), brightness)  # whichever way a mesh is wound
    leaf = world_of(np.array([[(0, 0, 1), (0, 1, 1), (0, 0, 2)]]), [[9, 9, 9]], ground=False)
    from_behind = Light(azimuth=math.pi, elevation=math.radians(30))
    assert light_on_triangles(leaf, light) == pytest.approx(light_on_triangles(leaf, from_behind))


# Sky


def test_the_overcast_sky_is_three_times_as_bright_overhead_and_the_clear_one_brightest_at_the_sun():
    up, level = np.array([[0.0, 0.0, 1.0]]), np.array([[1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
    overcast = Light(clouds=1.0)
    assert sky_luminance(overcast, up) == pytest.approx(1.0)
    assert sky_luminance(overcast, level) == pytest.approx(1 / 3, abs=0.01)  # CIE S 003: 1 to 3
    assert sky_luminance(LOW, up) == pytest.approx(1.0)
    above = EVERYWHERE[EVERYWHERE[:, 2] > 0]
    assert (sky_luminance(LOW, LOW.sun[None]) > sky_luminance(LOW, above)).all()


def test_sky_and_polarisation_are_mirrored_at_the_plane_of_the_sun():
    across = np.array([-math.sin(LOW.azimuth), math.cos(LOW.azimuth), 0.0])
    mirrored = EVERYWHERE - 2 * (EVERYWHERE @ across)[:, None] * across
    assert np.allclose(sky_luminance(LOW, EVERYWHERE), sky_luminance(LOW, mirrored))
    (degree, vectors), (other_degree, others) = polarisation(LOW, EVERYWHERE), polarisation(LOW, mirrored)
    assert np.allclose(degree, other_degree)
    back = others - 2 * (others @ across)[:, None] * across
    assert np.allclose(np.abs((vectors * back).sum(axis=1)), 1)


def test_the_angle_of_polarisation_equals_the_formula_of_spherical_trigonometry():
    """In the triangle zenith, sun, point: the light swings at right angles to the side from the point to the sun."""
    up = EVERYWHERE[(EVERYWHERE[:, 2] > 0.05) & (EVERYWHERE[:, 2] < 0.999)]
    degree, vectors = polarisation(LOW, up)
    elevation, azimuth = np.arcsin(up[:, 2]), np.arctan2(up[:, 1], up[:, 0])
    difference = LOW.azimuth - azimuth
    # the angle at the point between the ways to the zenith and to the sun
    at_point = np.arctan2(
        np.sin(difference) * math.cos(LOW.elevation),
        math.sin(LOW.elevation) * np.cos(elevation) - math.cos(LOW.elevation) * np.sin(elevation) * np.cos(difference),
    )
    upward = np.column_stack(
        [-np.sin(elevation) * np.cos(azimuth), -np.sin(elevation) * np.sin(azimuth), np.cos(elevation)]
    )
    left = np.column_stack(
        [-np.sin(azimuth), np.cos(azimuth), 0 * azimuth]
    )  # at right angles to it, towards larger azimuths
    swings = np.cos(at_point + math.pi / 2)[:, None] * upward + np.sin(at_point + math.pi / 2)[:, None] * left
    assert np.allclose(np.abs((vectors * swings).sum(axis=1)), 1)
    gamma = np.arccos(up @ LOW.sun)
    assert np.allclose(degree, 0.8 * np.sin(gamma) ** 2 / (1 + np.cos(gamma) ** 2))
    assert np.allclose(polarisation(Light(clouds=1.0), up)[0], 0)


# Lit worlds


def pictures(world: World) -> list[bytes]:
    """What is on the ground of a lit world."""
    return [part.texture.rgba.tobytes() for part in world.ground.parts]


def test_a_light_changes_colours_and_no_shape():
    world = World.generate("tiny", 3)
    bright = lit(world, LOW)
    assert np.array_equal(bright.triangles, world.triangles)
    assert np.array_equal(bright.plants.of, world.plants.of)
    poses = [(1.0, 1.0, 0.5), (2.0, 1.2, -2.0)]
    eye = Eye(width=90, height=24, samples=2)
    with open_renderer(world, eye, "cpu") as plain, open_renderer(bright, eye, "cpu") as sunny:
        before, after = plain.render(poses), sunny.render(poses)
    assert np.array_equal(before[..., 3], after[..., 3])  # the skyline
    assert (before[..., :3] != after[..., :3]).mean() > 0.5
    again = lit(World.generate("tiny", 3), LOW)
    assert again.rgb.tobytes() == bright.rgb.tobytes()
    assert pictures(again) == pictures(bright)
    with pytest.raises(SettingError, match="lit by a sun already"):
        lit(bright, LOW)


@pytest.mark.parametrize(
    "settings", [{}, {"ground": "mesh"}, {"world": "tiny hill_height=0.5"}, {"world": "arena"}, {"altitude": 0.4}]
)
def test_a_lit_world_is_the_world_in_all_but_its_looks(settings):
    """Ground, obstacles, what stands near, and routes."""
    settings = {"world": "tiny", "seed": 3, "route_length": 0.8} | settings
    dark, bright = (Experiment(**settings, light=light) for light in (None, LOW))
    (world, route), (lit_world, same) = dark.open_world_and_route(), bright.open_world_and_route()
    assert np.array_equal(route.xy, same.xy)
    xy = route.at(np.linspace(0, 0.7, 8))[:, :2] + [0.05, -0.1]
    assert np.array_equal(world.ground_height(xy), lit_world.ground_height(xy), equal_nan=True)
    assert np.array_equal(clearance(world, xy), clearance(lit_world, xy))
    poses, eye = np.column_stack([xy, np.zeros(len(xy))]), Eye(top=math.radians(89), bottom=math.radians(-89))
    assert np.allclose(covered_within(world, eye, poses, 0.05), covered_within(lit_world, eye, poses, 0.05))
    look = Eye(width=60, height=20, samples=1)
    with ScanlineRenderer(world, look) as one, ScanlineRenderer(lit_world, look) as other:
        (away, which), (as_far, same_one) = one.hits(poses), other.hits(poses)
    assert np.array_equal(away, as_far)
    assert np.array_equal(np.minimum(which, len(world.triangles)), np.minimum(same_one, len(world.triangles)))


def test_what_is_set_on_a_lit_world_holds_when_it_changes():
    world = dataclasses.replace(lit(World.generate("tiny", 3), LOW), sky_rgb=(1, 2, 3))
    assert changed_world(world, Change.parse("removed amount=0.5")).sky_rgb == (1, 2, 3)
    flying = Experiment(world=lit(World.generate("tiny", 3), LOW), altitude=0.5, cull_back_faces=True).open_world()
    changed = changed_world(flying, Change.parse("removed amount=1"))
    assert changed.ground_height(np.array([[1.0, 1.0]])) == pytest.approx(0.49)
    assert (flying.double_sided, changed.double_sided) == (False, False)
    assert flying.light == LOW
    with pytest.raises(SettingError, match="under the ground"):
        Experiment(world=lit(World.generate("tiny", 3), LOW), altitude=-0.5).open_world()


def test_a_sun_at_the_horizon_lights_nothing():
    world = World.generate("tiny", 3)
    for elevation in (1e-310, 1e-5, 0.0):
        assert lit(world, Light(elevation=elevation)).light.direct == 0
    with pytest.raises(SettingError, match="light is of type"):
        light_spec(3)
    with pytest.raises(SettingError, match=r"lit\(world"):
        world.changed("sun hours=4")


@pytest.mark.parametrize("light", [LOW, Light(clouds=1.0), Light(elevation=math.radians(-3))])
def test_turning_rolls_a_view_of_a_lit_world_and_its_sky(light):
    eye = Eye(width=72, height=20, samples=1)
    with open_renderer(lit(World.generate("tiny", 1), light), eye, "cpu") as renderer:
        first, turned = renderer.render([(1.5, 1.5, 0.2), (1.5, 1.5, 0.2 + 2 * math.pi / 72 * 5)]).astype(int)
    differs = np.abs(np.roll(first, 5, axis=1) - turned).max(axis=2)
    assert (differs > 1).mean() < 0.002  # rays at edges may round to either side


def test_world_and_sun_may_turn_together():
    world, turn = random_world(2, 60), math.pi / 2
    matrix = np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1]], dtype=np.float32)
    turned = dataclasses.replace(world, triangles=world.triangles @ matrix.T)
    there = Light(azimuth=LOW.azimuth + turn, elevation=LOW.elevation)
    eye = Eye(width=60, height=20, samples=2)
    with open_renderer(lit(world, LOW), eye, "cpu") as one, open_renderer(lit(turned, there), eye, "cpu") as other:
        view, same = one.render([(0.5, 0.2, 0.3)]), other.render([(-0.2, 0.5, 0.3 + turn)])
    assert (np.abs(view.astype(int) - same).max(axis=-1) > 2).mean() < 0.02


@pytest.mark.parametrize("light", [LOW, Light(clouds=1.0)])
def test_the_renderers_agree_in_a_lit_world(backend, light):
    world = lit(World.generate("tussock-field", 1), light)
    poses = np.array([(5, 5, 0.0), (2.5, 7.5, -1.0), (8, 3, 2.0)])
    poses = np.column_stack([poses, np.full(3, 0.05), [0.0, 0.2, -0.3], [0.0, -0.1, 0.2]])
    with open_renderer(world, backend=backend) as ours, open_renderer(world, backend="cpu") as cpu:
        views, exact = ours.render(poses).astype(int), cpu.render(poses).astype(int)
    assert (np.abs(views - exact).max(axis=-1) > 8).mean() < 0.02
    assert np.abs(views.mean(axis=(0, 1, 2)) - exact.mean(axis=(0, 1, 2))).max() < 0.5


@pytest.mark.parametrize("suffix", ["glb", "ply"])
def test_lit_worlds_read_back_equal(tmp_path, suffix):
    world = lit(World.generate("tiny", 2), LOW)
    write_world(world, tmp_path / f"lit.{suffix}")
    back = read_world(tmp_path / f"lit.{suffix}")
    assert pictures(back) == pictures(world)
    assert back.light == LOW
    assert np.array_equal(back.triangles, world.triangles)
    eye = Eye(width=60, height=20)
    with open_renderer(world, eye, "cpu") as one, open_renderer(back, eye, "cpu") as other:
        assert np.array_equal(one.render([(1, 1, 0)]), other.render([(1, 1, 0)]))


def test_textured_meshes_and_ground_of_others_are_lit():
    texture = Texture(rgba=np.full((2, 2, 4), 255, np.uint8))
    world = textured_world([texture], n=30)
    bright = lit(world, LOW)
    assert bright.texturing.colours[:, 0, :3].max(axis=1).min() < 250
    assert len(bright.texturing.index) == len(bright.triangles)
    valley = mesh_world(hills())
    assert lit(valley, LOW).ground is None
    under = mesh_world(hills(), np.array([[(0, 0, 2), (6, 0, 2), (6, 6, 2)], [(0, 0, 2), (6, 6, 2), (0, 6, 2)]]))
    n = len(hills())
    high = Light(azimuth=0.3, elevation=1.4)
    assert lit(under, high).rgb[n // 2].max() < 0.7 * lit(valley, high).rgb[n // 2].max()  # a roof throws a shadow
    assert len(np.unique(lit(valley, LOW).rgb[:, 0])) > 20  # slopes differ in the light; all had one colour


def test_a_walk_learns_and_arrives_in_the_light():
    flags = {"world": "tiny", "seed": 3, "route_length": 1.5, "eye": Eye(width=90, height=20), "route_seed": 1}
    trajectory = Experiment(**flags, light="sun azimuth_deg=120 elevation_deg=35").run()
    assert trajectory.summary()["arrived"]


# The compass in the sky


@pytest.mark.parametrize("elevation", [2, 25, 50, 70, 85])
def test_a_level_dorsal_rim_reads_its_heading(elevation):
    light, rim = Light(azimuth=0.7, elevation=math.radians(elevation)), DorsalRim(unit_noise=0.0)
    for heading in np.linspace(-3, 3, 9).tolist():
        read = rim.heading(light, heading, (0.0, 0.0), np.random.default_rng(0), None)
        assert abs(wrap_angle(read - heading)) < math.radians(3)


def test_without_the_sun_a_walk_begins_with_either_half_and_keeps_it():
    rim, errors = DorsalRim(unit_noise=0.0, sees_sun=False), []
    for seed in range(40):
        readings = Readings(rim, np.random.default_rng(seed), LOW)
        headings = np.linspace(0.2, 2.2, 9)
        read, _ = readings.read(headings, np.full(9, 0.1))
        error = np.abs(wrap_angle(read - headings))
        assert np.ptp(error) < 0.1
        errors.append(error[0])
    opposite = np.array(errors) > 1
    assert 8 < opposite.sum() < 32
    assert np.allclose(np.array(errors)[opposite], math.pi, atol=0.1)


def test_noise_tilt_and_clouds_make_a_compass_worse():
    def spread(light, tilt=(0.0, 0.0), **settings):
        random, rim = np.random.default_rng(1), DorsalRim(**settings)
        return np.std([float(wrap_angle(rim.heading(light, 1.0, tilt, random, 1.0) - 1.0)) for _ in range(200)])

    def offset(tilt):
        rim = DorsalRim(unit_noise=0.0)
        return abs(float(wrap_angle(rim.heading(LOW, 1.0, tilt, np.random.default_rng(0), 1.0) - 1.0)))

    cloudy = Light(azimuth=LOW.azimuth, elevation=LOW.elevation, clouds=0.9)
    assert spread(LOW, unit_noise=0.01) < spread(LOW, unit_noise=0.05) < spread(cloudy, unit_noise=0.05)
    assert offset((0.0, 0.0)) < 0.02 < offset((math.radians(20), math.radians(10)))


def test_a_walk_with_a_sky_compass_needs_a_sky():
    flags = {"world": "tiny", "seed": 3, "route_length": 1.5, "eye": Eye(width=90, height=20), "route_seed": 1}
    flags |= {"senses": "dorsal-rim", "navigator": "path-integration"}
    with pytest.raises(SettingError, match="--light"):
        Experiment(**flags).run()
    assert Experiment(**flags, light="sun azimuth_deg=120 elevation_deg=35").run().summary()["arrived"]


# Changes


def test_a_changed_world_is_lit_after_it_has_changed():
    plain = World.generate("tiny", 3)
    morning = lit(plain, Light(azimuth=math.radians(-20), elevation=math.radians(35)))
    change = Change.parse("removed amount=0.5 | sun amount=0.5 hours=4 | clouds amount=0.25")
    later = changed_world(morning, change, seed=2)
    expected = lit(
        plain.changed("removed amount=0.5", seed=2), Light(**attrs.asdict(morning.light.later(2.0)) | {"clouds": 0.25})
    )
    assert later.light == expected.light
    assert np.array_equal(later.rgb, expected.rgb)
    assert pictures(later) == pictures(expected)
    assert changed_world(morning, Change.parse("sun amount=0 | clouds amount=0")) is morning
    assert changed_world(plain, Change.parse("removed amount=0")) is plain


def test_a_light_is_changed_only_where_it_is_known(tmp_path):
    plain = World.generate("tiny", 3)
    with pytest.raises(SettingError, match="--light"):
        changed_world(plain, Change.parse("sun"))
    with pytest.raises(SettingError, match="change it first"):
        lit(plain, LOW).changed("removed amount=0.5")
    write_world(lit(plain, LOW), tmp_path / "lit.glb")
    with pytest.raises(SettingError, match="lit by a sun already"):
        changed_world(read_world(tmp_path / "lit.glb"), Change.parse("clouds amount=0.5"))


def test_a_walk_learns_in_the_morning_and_walks_at_noon():
    flags = {"world": "tiny", "seed": 3, "route_length": 1.5, "eye": Eye(width=90, height=20), "route_seed": 1}
    flags |= {"light": "sun azimuth_deg=-20 elevation_deg=30", "encoding": "grey"}
    usual = Experiment(**flags)
    later = usual.replace(test_change="sun hours=4")
    with usual.opened() as one, later.opened() as other:
        assert torch.equal(one.views, other.views)
        assert other.renderer.world.light.elevation > one.renderer.world.light.elevation + 0.3
        assert np.array_equal(one.route.xy, other.route.xy)


def test_parameters_of_a_light_are_named_as_they_are_given():
    with pytest.raises(SettingError, match="its parameters are azimuth_deg, elevation_deg, clouds, latitude_deg"):
        light_spec("sun azimut_deg=3")
