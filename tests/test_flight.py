"""Flight: at a level, and at the heights of a route."""

import math
import pickle

import numpy as np
import pytest
from commands import printed
from scenes import post, random_world, world_of

from tussock.navigation.body import Body
from tussock.navigation.cli.main import main
from tussock.navigation.experiment import Experiment
from tussock.render.eye import Eye
from tussock.render.images.writing import write_database
from tussock.render.occlusion import covered_within
from tussock.render.renderer import open_renderer
from tussock.world.errors import SettingError
from tussock.world.flight import Flight
from tussock.world.geometry import Route
from tussock.world.obstacles import clearance
from tussock.world.route_files import read_route, write_route

SMALL = Eye(width=90, height=30, z=0.02)
PATH = np.array([[0.0, 0.0, 0.5], [1.0, 0.0, 0.5], [2.0, 1.0, 1.5]])


def climbing() -> Route:
    """From 0.2 m to 0.6 m over 1 m."""
    along = np.linspace(0, 1, 21)
    return Route(Route.through(np.column_stack([along - 0.5, 0.5 * along])).poses, 0.2 + 0.4 * along)


def test_heights_are_those_of_the_nearest_place_of_the_path():
    flight = Flight(PATH)
    places = np.array([[0.3, 0.2], [-5, 0], [1.5, 0.5], [3.0, 2.0], [1.0, 0.0]])
    assert flight.height(places) == pytest.approx([0.5, 0.5, 1.0, 1.5, 0.5], abs=0.01)
    assert (Flight.at(2.5).height(places) == 2.5).all()
    x, y = np.array([0.0, 1.5]), np.array([0.0, 0.5, 2.0])
    grid = np.array([[flight.height(np.array([[a, b]]))[0] for a in x] for b in y])
    assert np.array_equal(flight.height_on_grid(x, y), grid)
    again = pickle.loads(pickle.dumps(flight))
    assert np.array_equal(again.height(places), flight.height(places))


def test_an_eye_that_flies_sees_what_an_eye_at_that_height_sees():
    world, poses = random_world(3, 500), np.array([[0.2, 0.1, 0.4], [-1.0, 1.0, 2.0]])
    full = np.column_stack([poses, [0.7, 0.7], np.zeros((2, 2))])
    with (
        open_renderer(world.flown(Flight.at(0.68)), SMALL, "cpu") as flying,
        open_renderer(world, SMALL, "cpu") as still,
    ):
        assert np.array_equal(flying.render(poses), still.render(full))


def test_it_passes_over_what_is_lower_and_under_what_is_higher():
    world = world_of(post(0.5, 0.5, 0.0, height=0.3), np.full((10, 3), 100))
    beside = np.array([[0.5, 0.5]])
    touching, over = (clearance(world.flown(Flight.at(height)), beside)[0] for height in (0.1, 0.5))
    assert touching < 0.05
    assert over > 1
    pose = np.array([[0.45, 0.5, 0.0]])
    shares = [covered_within(world.flown(Flight.at(height)), SMALL, pose, 0.05)[0] for height in (0.1, 0.5)]
    assert shares[0] > 0.1
    assert shares[1] == 0


def test_a_walk_flies_at_an_altitude_or_along_the_heights_of_its_route():
    common = {"world": random_world(5, 300), "eye": SMALL, "encoding": "grey"}
    level = Experiment(**common, route=climbing(), altitude=0.4).run()
    assert level.summary()["arrived"]
    assert level.column("z_m") == pytest.approx(np.full(len(level.rows), 0.38))
    climb = Experiment(**common, route=climbing(), ground="route").run()
    assert climb.summary()["arrived"]
    expected = 0.2 + 0.4 * (np.array(climb.column("x_m")) + 0.5)
    assert np.abs(np.array(climb.column("z_m")) + SMALL.z - expected).max() < 0.02
    slides = Experiment(**common, route=climbing(), altitude=0.4, body=Body(collisions="slide")).run()
    assert slides.summary()["steps"] > 3
    with pytest.raises(SettingError, match="obstacles are known at one height"):
        Experiment(**common, route=climbing(), ground="route", body=Body(collisions="slide"))


def test_routes_keep_their_heights_through_files(tmp_path):
    write_route(climbing(), tmp_path / "r.csv")
    assert (tmp_path / "r.csv").read_text().startswith("x_m,y_m,heading_deg,z_m\n")
    again = read_route(tmp_path / "r.csv")
    assert again.heights is not None
    assert again.heights == pytest.approx(climbing().heights)
    assert again != Route(again.poses)
    assert hash(again) != hash(Route(again.poses))
    (tmp_path / "cm.csv").write_text("x [m],y [m],z [cm]\n0,0,50\n0.5,0,60\n1,0,\n2,0,90\n")
    assert read_route(tmp_path / "cm.csv").heights is None  # not at each point
    (tmp_path / "cm.csv").write_text("x [m],y [m],z [cm]\n0,0,50\n0,0,55\n0.5,0,60\n2,0,90\n")
    assert read_route(tmp_path / "cm.csv").heights == pytest.approx([0.5, 0.6, 0.9])  # one for each position


def test_heights_that_are_not_used_are_named(tmp_path, caplog):
    write_route(climbing(), tmp_path / "r.csv")
    experiment = Experiment(world=random_world(5, 300), eye=SMALL, route=tmp_path / "r.csv")
    experiment.open_world_and_route()
    assert "0.6 m high" in caplog.text
    assert "--ground route" in caplog.text
    caplog.clear()
    experiment.replace(ground="route").open_world_and_route()
    experiment.replace(altitude=1.0).open_world_and_route()
    assert caplog.text == ""


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"ground": "route"}, "column z_m"),
        ({"ground": "route", "route": Route.through(np.array([[0.0, 0.0], [1.0, 0.0]]))}, "column z_m"),
    ],
)
def test_a_route_without_heights_is_refused(settings, words):
    with pytest.raises(SettingError, match=words):
        Experiment(world="tiny", **settings).open_world()


def test_contradictions_and_bad_heights_are_refused():
    with pytest.raises(SettingError, match="one of the two"):
        Experiment(altitude=1.0, ground="mesh")
    with pytest.raises(SettingError, match="heights of a route"):
        Route(climbing().poses, np.full(21, math.nan))


def test_commands_fly(tmp_path, capfd):
    write_route(climbing(), tmp_path / "r.csv")
    flags = ["--world", "tiny", "--size", "60x12", "--route-length-m", "1", "--altitude-m", "1.5"]
    assert printed(capfd, "run", *flags, "--out", str(tmp_path / "run"))["steps"] > 3
    rows = (tmp_path / "run" / "trajectory.csv").read_text().splitlines()
    assert {row.split(",")[3] for row in rows[1:]} == {"1.49"}
    assert printed(capfd, "evaluate", *flags, "--grid-m", "0.3")["mean_error_deg"] < 90
    with pytest.raises(SystemExit) as end:
        main(["run", "--world", "tiny", "--ground", "route", "--out", str(tmp_path / "no")])
    assert end.value.code == 2
    assert "column z_m" in capfd.readouterr().err


def test_databases_in_flight_and_flights_under_the_ground_are_refused(tmp_path):
    world = random_world(5, 100)
    with (
        open_renderer(world.flown(Flight.at(1.0)), SMALL, "cpu") as renderer,
        pytest.raises(SettingError, match="one height"),
    ):
        write_database(tmp_path / "d", renderer, np.array([[0.0, 0.0, 0.0]]))
    assert list(tmp_path.iterdir()) == []
    with pytest.raises(SettingError, match="under the ground"):
        Experiment(world="tiny", altitude=-1.0).open_world()
    low = Route(climbing().poses, climbing().heights - 0.3)
    with pytest.raises(SettingError, match="under the ground"):
        Experiment(world="tiny", route=low, ground="route").open_world()


def test_a_route_is_read_again_when_its_file_changed(tmp_path):
    write_route(climbing(), tmp_path / "r.csv")
    experiment = Experiment(world=random_world(5, 100), route=tmp_path / "r.csv", ground="route")
    before = len(pickle.dumps(experiment))
    assert experiment.open_world_and_route()[1].heights == pytest.approx(climbing().heights)
    write_route(Route(climbing().poses, climbing().heights + 1), tmp_path / "r.csv")
    assert experiment.open_world_and_route()[1].heights == pytest.approx(climbing().heights + 1)
    assert len(pickle.dumps(experiment)) == before
