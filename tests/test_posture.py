"""Bodies that stand on slopes, and eyes that pitch and roll with them."""

import numpy as np
import pytest
from scenes import hills, mesh_world, post, random_poses, random_world, surface

from tussock.navigation.experiment import Experiment
from tussock.navigation.experiment_settings import experiment_of, settings_of
from tussock.navigation.training import training_source
from tussock.render.carried import CarriedEye
from tussock.render.eye import Eye
from tussock.render.posture import Posture
from tussock.render.renderer import Renderer, open_renderer
from tussock.world.errors import SettingError
from tussock.world.full_pose import FullPose, eye_axes, slopes_under
from tussock.world.geometry import Route

SMALL = Eye(width=72, height=15)


@pytest.fixture(scope="module")
def hilly():
    return mesh_world(hills(), *(post(x, x / 2, 0.2) for x in np.arange(0.5, 6, 0.5))).on_mesh()


@pytest.mark.parametrize("heading", [0.0, 0.7, np.pi / 2, -2.5])
@pytest.mark.parametrize("length", [0.01, 0.3])
def test_a_body_on_a_slope_is_as_steep_as_the_slope(heading, length):
    """On a plane that rises by 0.3 to the east and 0.1 to the north, whatever the length of the body."""
    plane = mesh_world(surface(lambda x, y: 0.3 * x + 0.1 * y)).on_mesh()
    (pitch,), (roll,) = slopes_under(plane, np.array([[3.0, 3.0, heading]]), length)
    assert np.tan(pitch) == pytest.approx(0.3 * np.cos(heading) + 0.1 * np.sin(heading), abs=1e-5)
    assert np.tan(roll) == pytest.approx(-0.3 * np.sin(heading) + 0.1 * np.cos(heading), abs=1e-5)  # its left is higher


def test_a_body_at_the_edge_of_the_ground_takes_the_slope_of_the_other_end():
    plane = mesh_world(surface(lambda x, y: 0.3 * x)).on_mesh()
    for x in (0.0, 6.0):
        (pitch,), (roll,) = slopes_under(plane, np.array([[x, 3.0, 0.0]]), 0.1)
        assert np.tan(pitch) == pytest.approx(0.3, abs=1e-5)
        assert roll == pytest.approx(0, abs=1e-6)


def test_flat_ground_and_a_level_gaze_leave_every_view_as_it_was(hilly):
    for world, posture in ((random_world(), Posture(gaze="body")), (hilly, Posture())):
        assert not posture.tilts(world)
        with Experiment(world=world, eye=SMALL, posture=posture).open_renderer(world) as renderer:
            assert not isinstance(renderer, CarriedEye)


def test_the_axes_of_an_eye_are_a_right_handed_frame_whose_first_is_where_it_looks():
    rng = np.random.default_rng(0)
    poses = rng.uniform(-1.5, 1.5, (20, 6))
    axes = eye_axes(poses)
    assert np.allclose(axes @ axes.transpose(0, 2, 1), np.eye(3))
    assert np.allclose(np.linalg.det(axes), 1)
    assert np.allclose(axes[:, 0, 2], np.sin(poses[:, 4]))
    assert np.allclose(np.arctan2(axes[:, 0, 1], axes[:, 0, 0]), poses[:, 2])
    assert (axes[:, 1, 2] * np.sign(poses[:, 5]) >= 0).all()  # positive roll: the left side is up


def test_a_carried_eye_sees_what_the_full_poses_of_its_body_show(hilly):
    poses = random_poses(6) + [3.0, 3.0, 0.0]
    pitch, roll = slopes_under(hilly, poses, 0.05)
    height = hilly.ground_height(poses[:, :2]) + SMALL.z
    with open_renderer(hilly, SMALL, "cpu") as plain:
        carried = CarriedEye(plain, Posture(gaze="body", body_length=0.05))
        assert isinstance(carried, Renderer)
        expected = plain.render(np.column_stack([poses, height, pitch, roll]))
        assert np.array_equal(carried.render(poses), expected)
        assert not np.array_equal(plain.render(poses), expected)
        full = FullPose(3.0, 3.0, 0.1, 2.0, 0.2, 0.3)  # is as it is
        assert np.array_equal(carried.render([full]), plain.render([full]))


def test_the_noise_belongs_to_the_place_and_learned_views_have_their_own():
    world = random_world()
    poses = random_poses(400)
    with open_renderer(world, SMALL, "cpu") as plain:
        carried = CarriedEye(plain, Posture(pitch_noise=0.1, roll_noise=0.03), seed=4)
        tilt = carried.full_poses(poses)[:, 4:]
        assert np.allclose(tilt.mean(axis=0), 0, atol=0.02)
        assert np.allclose(tilt.std(axis=0), (0.1, 0.03), rtol=0.15)
        assert np.array_equal(np.concatenate([carried.full_poses(poses[k : k + 1]) for k in range(9)])[:, 4:], tilt[:9])
        learned = training_source(carried).full_poses(poses)[:, 4:]
        other = CarriedEye(plain, carried.posture, seed=5).full_poses(poses)[:, 4:]
        for noise in (learned, other):
            assert abs(np.corrcoef(noise[:, 0], tilt[:, 0])[0, 1]) < 0.2


def test_a_walk_over_hills_pitches_and_rolls_and_says_so(hilly):
    route = Route.through(np.column_stack([np.linspace(1, 5, 30), np.full(30, 2.2)]))
    base = Experiment(world=hilly, ground="mesh", route=route, eye=SMALL)
    level, body = base.run(), base.replace(posture=Posture(gaze="body")).run()
    assert set(level.column("pitch_deg")) == set(level.column("roll_deg")) == {""}
    assert body.summary()["arrived"]
    facing = np.array([body.column(name) for name in ("x_m", "y_m")]).T
    poses = np.column_stack([facing, np.radians(body.column("heading_deg"))])
    pitch, roll = slopes_under(hilly, poses, 0.01)
    assert np.allclose(np.array([value or 0 for value in body.column("pitch_deg")]), np.degrees(pitch), atol=1e-6)
    assert np.allclose(np.array([value or 0 for value in body.column("roll_deg")]), np.degrees(roll), atol=1e-6)
    assert np.abs(pitch).max() > np.radians(5)


def test_settings_come_back_and_decide_the_run():
    settings = {"gaze": "body", "body_length_m": 0.02, "pitch_noise_deg": 3.0, "roll_noise_deg": 2.0}
    experiment = experiment_of(settings)
    assert {name: settings_of(experiment)[name] for name in settings} == settings
    with pytest.raises(SettingError, match="level"):
        experiment_of({"gaze": "sideways"})
    with pytest.raises(SettingError, match="pitch"):
        experiment_of({"pitch_noise_deg": -1})


def test_image_databases_and_the_cuda_renderer_refuse_it(tmp_path):
    with pytest.raises(SettingError, match="--gaze"):
        experiment_of({"gaze": "body", "route_database": tmp_path})
    with open_renderer(random_world(), SMALL, "cpu") as renderer:
        renderer.backend = "cuda"
        with pytest.raises(SettingError, match="level eyes only"):
            CarriedEye(renderer, Posture(pitch_noise=0.1))
