"""Bodies that stand on slopes, and eyes that pitch and roll with them."""

import pickle

import numpy as np
import pytest
from scenes import hills, mesh_world, post, random_poses, random_world, surface

from tussock.navigation.cli.main import main
from tussock.navigation.encoding import Encoding
from tussock.navigation.evaluation import heading_field
from tussock.navigation.experiment import Experiment
from tussock.navigation.experiment_keys import views_key
from tussock.navigation.experiment_settings import experiment_of, settings_of
from tussock.navigation.models import PerfectMemory
from tussock.navigation.training import training_source
from tussock.render.eye import Eye
from tussock.render.posture import Posture
from tussock.render.renderer import Renderer, open_renderer
from tussock.render.tilted_eye import TiltedEye
from tussock.world.errors import SettingError
from tussock.world.full_pose import FullPose, eye_axes, slopes_under
from tussock.world.geometry import Route

SMALL = Eye(width=72, height=15)


@pytest.fixture(scope="module")
def hilly():
    return mesh_world(hills(), *(post(x, x / 2, 0.2) for x in np.arange(0.5, 6, 0.5))).on_mesh()


@pytest.mark.parametrize("slope", [(0.3, 0.1), (-0.7, 0.4)])
@pytest.mark.parametrize("length", [0.01, 0.3])
def test_the_upward_axis_of_a_body_on_a_plane_is_the_normal_wherever_it_faces(slope, length):
    east, north = slope
    plane = mesh_world(surface(lambda x, y: east * x + north * y)).on_mesh()
    poses = np.column_stack([np.full((12, 2), 3.0), np.linspace(-3, 3, 12)])
    pitch, roll = slopes_under(plane, poses, length)
    axes = eye_axes(np.column_stack([poses, np.zeros(12), pitch, roll]))
    normal = np.array([-east, -north, 1]) / np.hypot(1, np.hypot(east, north))
    assert np.allclose(axes[:, 2], normal, atol=1e-4)  # the corners are float32


def test_a_ledge_counts_as_the_end_of_the_ground():
    low, high = surface(lambda x, y: 0 * x, high=3.0), surface(lambda x, y: 0 * x + 0.3, low=0.0, high=3.0) + [3, 0, 0]
    ledge = mesh_world(low, high).on_mesh()
    (pitch,), (roll,) = slopes_under(ledge, np.array([[2.998, 1.0, 0.0]]), 0.01)
    assert (pitch, roll) == (0, 0)


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
            assert not isinstance(renderer, TiltedEye)


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
        carried = TiltedEye(plain, Posture(gaze="body", body_length=0.05))
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
        carried = TiltedEye(plain, Posture(pitch_noise=0.1, roll_noise=0.03), seed=4)
        tilt = carried.full_poses(poses)[:, 4:]
        assert np.allclose(tilt.mean(axis=0), 0, atol=0.02)
        assert np.allclose(tilt.std(axis=0), (0.1, 0.03), rtol=0.15)
        assert np.array_equal(np.concatenate([carried.full_poses(poses[k : k + 1]) for k in range(9)])[:, 4:], tilt[:9])
        learned = training_source(carried).full_poses(poses)[:, 4:]
        other = TiltedEye(plain, carried.posture, seed=5).full_poses(poses)[:, 4:]
        for eye in (carried, carried.training):
            again = pickle.loads(pickle.dumps(eye))
            assert np.array_equal(again.full_poses(poses), eye.full_poses(poses))
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
    assert np.allclose(body.column("pitch_deg"), np.degrees(pitch), atol=1e-6)
    assert np.allclose(body.column("roll_deg"), np.degrees(roll), atol=1e-6)
    assert np.abs(pitch).max() > np.radians(5)


def test_settings_come_back_and_decide_the_run():
    settings = {"gaze": "body", "body_length_m": 0.02, "pitch_noise_deg": 3.0, "roll_noise_deg": 2.0}
    experiment = experiment_of(settings)
    assert {name: settings_of(experiment)[name] for name in settings} == settings
    with pytest.raises(SettingError, match="level"):
        experiment_of({"gaze": "sideways"})
    with pytest.raises(SettingError, match="pitch"):
        experiment_of({"pitch_noise_deg": -1})


def test_runs_of_a_sweep_share_views_only_where_their_noise_is_the_same():
    same = {"world": "tiny", "world_seed": 1, "route_seed": 1}
    for noise, shared in ((0.0, True), (3.0, False)):
        one, other = (experiment_of(same | {"roll_noise_deg": noise, "seed": seed}) for seed in (1, 2))
        assert (views_key(one) == views_key(other)) == shared


def test_what_turns_views_later_refuses_a_tilted_eye(hilly, tmp_path, capfd):
    with open_renderer(hilly, SMALL, "cpu") as renderer:
        tilted = TiltedEye(renderer, Posture(gaze="body"))
        with pytest.raises(SettingError, match="turning views"):
            heading_field(PerfectMemory(), Encoding.named("grey"), tilted, np.array([[3.0, 3.0]]))
    command = [
        "database",
        "grid",
        "--world",
        "tiny",
        "--roll-noise-deg",
        "3",
        "--spacing-m",
        "3",
        "--out",
        str(tmp_path / "grid"),
    ]
    with pytest.raises(SystemExit) as end:
        main(command)
    assert end.value.code == 2
    assert "level eye" in capfd.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_image_databases_refuse_it(tmp_path):
    with pytest.raises(SettingError, match="--gaze"):
        experiment_of({"gaze": "body", "route_database": tmp_path})
