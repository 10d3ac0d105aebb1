"""Working with image databases and no world: the same headings as in the world that they were drawn from, and walks over them."""

import csv
import json
import logging
import pickle
import shutil
import time
from collections import OrderedDict
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import attrs
import cv2
import numpy as np
import pytest
from commands import printed, tussock

from tussock.navigation.encoding import Encoding
from tussock.navigation.experiment import Experiment
from tussock.navigation.experiment_keys import key_of, route_key, training_key
from tussock.navigation.stopping import StopReason
from tussock.navigation.tested_poses import poses_to_test
from tussock.navigation.training import AHEAD, training_poses_in, training_views
from tussock.navigation.walk import Walk
from tussock.render.eye import Eye
from tussock.render.images import Grid, read_database, write_database
from tussock.render.images.folders import eye_of, reach_of, route_of
from tussock.render.images.metadata import METADATA, read_metadata, write_metadata
from tussock.render.images.source import open_views
from tussock.render.renderer import Renderer, open_renderer
from tussock.world.errors import FileError, InputError, SettingError
from tussock.world.geometry import Bounds, Pose, Route, turn_of_columns
from tussock.world.routes import generate_route
from tussock.world.scene import World

EYE = Eye(width=120, height=30, samples=2)


@pytest.fixture(scope="module")
def drawn(tmp_path_factory) -> tuple[Path, Path, World, Route]:
    """Databases of a route and of a grid, the world that they were drawn from, and the route."""
    folder, world = tmp_path_factory.mktemp("drawn"), World.generate("tiny", 0)
    route = generate_route(world, 0, 2.0)
    low, high = route.xy.min(axis=0) - 0.4, route.xy.max(axis=0) + 0.4
    inside = Bounds(*np.maximum(low, 0).tolist(), *high.tolist())
    with open_renderer(world, EYE, "cpu") as renderer:
        write_database(folder / "route", renderer, route.resampled(0.05).poses)
        write_database(folder / "grid", renderer, Grid.over(inside, 0.1))
    return folder / "route", folder / "grid", world, route


@pytest.fixture
def copies(drawn, tmp_path) -> tuple[Path, Path]:
    """Copies of the databases, to be changed."""
    for folder in drawn[:2]:
        shutil.copytree(folder, tmp_path / folder.name)
    return tmp_path / "route", tmp_path / "grid"


def as_jpeg(folder: Path, quality: int) -> None:
    """Make the images of a database JPEGs, without alpha."""
    for path in folder.glob("*.png"):
        cv2.imwrite(str(path.with_suffix(".jpg")), cv2.imread(str(path)), [cv2.IMWRITE_JPEG_QUALITY, quality])
        path.unlink()
    entries = folder / "database_entries.csv"
    entries.write_text(entries.read_text().replace(".png", ".jpg"))


# The source of views


def test_a_source_of_views_is_a_renderer(drawn):
    with open_views(*drawn[:2]) as views:
        assert isinstance(views, Renderer)
        assert (views.backend, views.eye) == ("database", EYE)
        assert len(views.world.triangles) == 0
    with pytest.raises(InputError, match="closed"):
        views.render([(1.0, 1.0, 0.0)])


def test_at_its_own_pose_an_image_is_unchanged(drawn):
    grid = read_database(drawn[1])
    with open_views(*drawn[:2]) as views:
        assert np.array_equal(views.render(grid.poses), grid.views())
        assert np.array_equal(views.training.render(read_database(drawn[0]).poses), read_database(drawn[0]).views())


@pytest.mark.parametrize("columns", [1, -7, 60, 119])
def test_a_view_at_another_heading_is_the_image_rolled_as_the_world_turns(drawn, columns):
    """Turning by whole columns, the renderer draws the same panorama as the roll of the image."""
    route, grid, world, _ = drawn
    pose = read_database(grid).poses[[30]]
    turned = pose + [[0, 0, float(turn_of_columns(columns, EYE.width))]]
    with open_views(route, grid) as views, open_renderer(world, EYE, "cpu") as renderer:
        off = np.abs(views.render(turned).astype(int) - renderer.render(turned).astype(int))
    assert (off > 1).mean() < 0.001
    # Nearly half a column more changes nothing.
    with open_views(route, grid) as views:
        assert np.array_equal(views.render(turned), views.render(turned + [[0, 0, 0.49 * 2 * np.pi / EYE.width]]))


def test_the_nearest_entry_is_taken_and_how_far_it_is_is_told(drawn):
    with open_views(*drawn[:2]) as views:
        poses = np.random.default_rng(0).uniform([0, 0, -3], [4, 4, 3], (200, 3))
        distances = np.hypot(*(poses[:, None, :2] - views.poses[:, :2]).transpose(2, 0, 1))
        rows, distance = views.nearest(poses)
        assert np.array_equal(rows, distances.argmin(axis=1))
        assert np.allclose(distance, distances.min(axis=1))


def test_of_views_at_one_position_that_of_the_nearest_heading_is_taken(tmp_path):
    world = World.generate("tiny", 0)
    poses = [(1.0, 1.0, 0.0), (1.5, 1.0, 0.0), (1.0, 1.0, 2.0)]
    with open_renderer(world, EYE, "cpu") as renderer:
        database, _ = write_database(tmp_path / "route", renderer, poses)
    with open_views(tmp_path / "route") as views:
        assert np.array_equal(views.render([(1.0, 1.0, 2.0)]), database.views([2]))
        assert views.nearest([(1.0, 1.0, 0.9), (1.0, 1.0, 1.1)])[0].tolist() == [0, 2]


def test_the_cache_changes_nothing(drawn, monkeypatch):
    poses = np.random.default_rng(1).uniform([0, 0, -3], [3, 3, 3], (40, 3))
    with open_views(*drawn[:2]) as views:
        expected = views.render(poses)
        monkeypatch.setattr("tussock.render.images.source.CACHE_BYTES", 3 * EYE.width * EYE.height * 4)
        for part in range(0, 40, 5):
            assert np.array_equal(views.render(poses[part : part + 5]), expected[part : part + 5])


class Slow(OrderedDict):
    """A cache that lets other threads work while it is being changed."""

    def __setitem__(self, row, image):
        super().__setitem__(row, image)
        time.sleep(1e-4)


def test_views_go_to_another_process(drawn):
    with open_views(*drawn[:2]) as views:
        before = views.render(views.poses[:5])
        sent = pickle.loads(pickle.dumps(views))
        assert np.array_equal(sent.render(views.poses[:5]), before)


def test_threads_share_a_source_of_views(drawn, monkeypatch):
    poses = np.random.default_rng(1).uniform([0, 0, -3], [3, 3, 3], (40, 4, 3))
    with open_views(*drawn[:2]) as views, ThreadPoolExecutor(4) as threads:
        expected = [views.render(some) for some in poses]
        monkeypatch.setattr("tussock.render.images.source.CACHE_BYTES", 0)
        monkeypatch.setattr(views, "_kept", Slow())
        assert all(map(np.array_equal, threads.map(views.render, poses), expected))


@pytest.mark.parametrize(("spacing", "reach"), [(0.1, 0.1 * np.sqrt(2) / 2), (0.25, 0.25 * np.sqrt(2) / 2)])
def test_the_reach_of_a_grid_is_half_the_diagonal_of_a_cell(tmp_path, spacing, reach):
    with open_renderer(World.generate("tiny", 0), Eye(width=8, height=2), "cpu") as renderer:
        whole, _ = write_database(tmp_path / "a", renderer, Grid(begin=(0.0, 0.0), spacing=spacing, size=(6, 4)))
        line, _ = write_database(tmp_path / "b", renderer, [(spacing * k, 0.0, 0.0) for k in range(9)])
    assert reach_of(whole) == pytest.approx(reach)
    assert reach_of(line) == pytest.approx(spacing)


# Headings


def test_views_are_those_of_the_same_poses_in_the_world(drawn):
    route_folder, grid_folder, world, _ = drawn
    database = Experiment(route_database=route_folder, grid_database=grid_folder)
    route = database.open_route(database.open_world())
    poses = poses_to_test(database, world, route)
    with open_views(route_folder, grid_folder) as views, open_renderer(world, EYE, "cpu") as renderer:
        for at, source in ((route.poses, views.training), (poses, views)):
            assert np.array_equal(source.render(at), renderer.render(at))


@pytest.fixture
def arguments(drawn) -> list:
    return ["--route-database", drawn[0], "--grid-database", drawn[1]]


def test_evaluate_gives_what_the_world_gives(capfd, drawn, arguments, tmp_path):
    from tussock.navigation.evaluation import heading_errors
    from tussock.navigation.models import PerfectMemory

    route_folder, grid_folder, world, _ = drawn
    result = printed(capfd, "evaluate", *arguments)
    experiment = Experiment(route_database=route_folder, grid_database=grid_folder)
    route = Route(read_database(route_folder).poses)
    poses = read_database(grid_folder).poses
    poses = poses[route.nearest(poses[:, :2])[0] <= 0.2]
    with open_renderer(world, EYE, "cpu") as renderer:
        model = PerfectMemory().fit(experiment.encoding(renderer.render(route.poses)))
        errors = heading_errors(model, experiment.encoding, renderer, route, poses[:, :2])
    assert result["n_positions"] == len(poses) > 20
    assert result["n_views"] == len(route.poses)
    assert result["median_error_deg"] == errors.median_error_deg
    assert result["mean_error_deg"] == errors.mean_error_deg
    assert result["median_error_deg"] < 5


def test_a_model_that_was_trained_from_a_database_is_evaluated_and_walks(capfd, arguments, tmp_path):
    model = tmp_path / "m.safetensors"
    trained = printed(capfd, "train", *arguments, "--out", model)
    result = printed(capfd, "evaluate", *arguments, "--model", model)
    assert result["n_views"] == trained["n_views"] > 40  # those of the learning walk too
    run = printed(capfd, "run", *arguments, "--model", model, "--out", tmp_path / "run")
    assert run["arrived"]


def test_jpeg_costs_less_than_a_degree(capfd, copies):
    flags = ["--route-database", copies[0], "--grid-database", copies[1]]
    for folder in copies:  # RGB first: what the compression costs, not the alpha
        as_jpeg(folder, 100)
    before = printed(capfd, "evaluate", *flags)
    for folder in copies:
        for path in folder.glob("*.jpg"):
            cv2.imwrite(str(path), cv2.imread(str(path)), [cv2.IMWRITE_JPEG_QUALITY, 80])
    after = printed(capfd, "evaluate", *flags)
    assert after["median_error_deg"] < before["median_error_deg"] + 1
    assert after["median_error_deg"] < 5


def test_without_a_grid_the_views_between_are_tested(capfd, drawn):
    result = printed(capfd, "evaluate", "--route-database", drawn[0], "--every", 2)
    assert (result["n_views"], result["n_positions"]) == (20, 20)
    assert result["median_error_deg"] < 5
    code, _, err = tussock(capfd, "evaluate", "--route-database", drawn[0])
    assert code == 2
    assert "--every" in err


def test_models_are_compared_over_a_database(capfd, arguments):
    rows = printed(capfd, "compare", *arguments, "--models", "perfect-memory,random")["models"]
    assert rows["perfect-memory"]["median_error_deg"] == printed(capfd, "evaluate", *arguments)["median_error_deg"]
    assert rows["perfect-memory"]["arrived"]
    assert not rows["random"]["arrived"]


# Learning and walking


def test_a_learning_walk_takes_the_views_of_the_grid_beside_the_route(drawn):
    route, beside = Route(read_database(drawn[0]).poses), read_database(drawn[1]).poses[:, :2]
    poses = training_poses_in(route, beside, every=2, learning_walk=0.2)
    on_route = [pose for pose in poses.tolist() if pose in route.poses[::2].tolist()]
    assert on_route == route.poses[::2].tolist()
    assert np.array_equal(poses[-1], route.poses[::2][-1])
    others = np.array([pose for pose in poses.tolist() if pose not in on_route])
    distance, along = route.nearest(beside)
    assert len(others) == ((distance <= 0.2) & (along <= route.arc[::2][-1])).sum() > 20
    for x, y, heading in others.tolist():
        ahead = route.at(route.nearest(np.array([[x, y]]))[1] + AHEAD)[0, :2]
        assert np.allclose([np.cos(heading), np.sin(heading)], (ahead - [x, y]) / np.hypot(*(ahead - [x, y])))


def test_what_is_learned_are_the_images_of_the_route(drawn):
    experiment = Experiment(route_database=drawn[0], grid_database=drawn[1]).replace(training__learning_walk=0.0)
    with experiment.opened() as trained:
        assert trained.model is not None
        expected = experiment.encoding(read_database(drawn[0]).views())
        learned, _ = training_views(experiment.encoding, trained.renderer, trained.poses)
        assert np.array_equal(learned, expected)


def test_a_walk_over_the_grid_arrives_and_tells_how_far_its_views_were(capfd, arguments, tmp_path):
    result = printed(capfd, "run", *arguments, "--offset-m", 0.1, "--out", tmp_path / "run")
    assert result["arrived"]
    rows = list(csv.DictReader((tmp_path / "run" / "trajectory.csv").read_text().splitlines()))
    distances = [float(row["view_distance_m"]) for row in rows]
    assert result["max_view_distance_m"] == max(distances)
    assert 0 < max(distances) <= 0.1 * np.sqrt(2) / 2 + 1e-6
    assert all(row["covered"] == "" for row in rows)  # not known
    settings = json.loads((tmp_path / "run" / "summary.json").read_text())["settings"]
    assert settings["world"] is None
    assert settings["grid_database"] == str(arguments[3])
    for name in ("recording.rrd", "overview.png", "route.csv"):
        assert (tmp_path / "run" / name).stat().st_size > 1000 or name == "route.csv"


def test_off_the_grid_a_walk_ends(drawn, copies):
    """The grid lacks all beyond the middle of the route."""
    route = Route(read_database(copies[0]).poses)
    middle = route.at(route.length / 2)[0, :2]
    entries = copies[1] / "database_entries.csv"
    header, *lines = entries.read_text().splitlines()
    xy = read_database(copies[1]).poses[:, :2]
    keep = route.nearest(xy)[1] <= route.nearest(middle[None])[1][0]
    entries.write_text("\n".join([header, *(line for line, kept in zip(lines, keep, strict=True) if kept)]) + "\n")
    experiment = Experiment(route_database=copies[0], grid_database=copies[1])
    trajectory = experiment.run()
    assert trajectory.summary()["reason"] == StopReason.OFF_GRID
    assert float(trajectory.column("view_distance_m")[-1]) > 0.1 * np.sqrt(2) / 2
    again = experiment.replace(stopping__put_back=True, stopping__max_steps=60).run()
    assert again.summary()["resets"] > 0
    with open_views(*copies) as views, pytest.raises(SettingError, match="no view near the start"):
        Walk(
            renderer=views,
            encoding=experiment.encoding,
            route=route,
            starts=[Pose(*route.at(0.8 * route.length)[0].tolist())],
        )


def test_in_a_world_no_view_is_far(tmp_path):
    trajectory = Experiment(world="tiny", route_length=1.0, eye=EYE).run()
    assert set(trajectory.column("view_distance_m")) == {""}
    assert trajectory.summary()["max_view_distance_m"] is None


def test_a_sweep_goes_over_databases(capfd, copies, cluster, tmp_path):
    sweep = tmp_path / "sweep.toml"
    sweep.write_text(
        '[fixed]\nroute-database = "route"\ngrid-database = "grid"\n[axes]\nmodel = ["perfect-memory", "random"]\n'
    )
    out = tmp_path / "out"
    result = printed(capfd, "sweep", sweep, "--out", out, "--scheduler", cluster)
    assert (result["runs"], result["arrived"], result["could_not_run"]) == (2, 1, 0)
    report = printed(capfd, "report", out)  # with the view and the map of the walk that failed
    assert "cannot" not in Path(report["report"]).read_text()
    assert printed(capfd, "sweep", sweep, "--out", out, "--scheduler", cluster)["done_before"] == 2


# Refusals, remarks and keys


def test_without_a_grid_a_learning_walk_is_remarked_upon(drawn, caplog):
    from tussock.navigation.training import _remark_on_learning_walk

    _remark_on_learning_walk.cache_clear()
    with caplog.at_level(logging.WARNING):
        experiment = Experiment(route_database=drawn[0])
        for _ in range(2):
            experiment.training_poses(experiment.open_world(), experiment.open_route(experiment.open_world()))
    assert [record.message.count("--grid-database") for record in caplog.records] == [1]


REFUSED = [
    (["--world", "tiny"], ["--world", "one of the two"]),
    (["--world", "tussock-field"], ["--world", "one of the two"]),
    (["--route", __file__], ["--route", "one of the two"]),
    (["--route-length-m", "3"], ["--route-length-m"]),
    (["--renderer", "cpu"], ["--renderer"]),
    (["--spacing-m", "0.1"], ["--spacing-m", "--every"]),
    (["--top-deg", "40"], ["60 degrees", "40 degrees"]),
    (["--size", "90x20"], ["120", "90"]),
]


@pytest.mark.parametrize(("flags", "words"), REFUSED)
def test_what_contradicts_a_database_is_refused_in_a_line(capfd, arguments, flags, words):
    code, _, err = tussock(capfd, "evaluate", *arguments, *flags)
    assert code == 2
    assert all(word in err for word in words), err
    assert len(err.splitlines()) == 1


def test_databases_that_cannot_be_used_are_refused_in_a_line(drawn, copies, tmp_path):
    route, grid = copies
    for settings, words in (
        ({"grid_database": grid}, "grid without a route"),
        ({"route_database": tmp_path / "none"}, "there is no .*none"),
        ({"route_database": grid}, "database of a grid"),
        ({"route_database": route, "ground": "mesh"}, "ground is 'mesh'; give none with image databases"),
    ):
        with pytest.raises(InputError, match=words):
            Experiment(**settings).open_route(World.generate("tiny", 0))
    with open_renderer(drawn[2], Eye(width=60, height=15), "cpu") as renderer:
        write_database(tmp_path / "small", renderer, Grid(size=(2, 2)))
    with pytest.raises(FileError, match="different eyes: width 120 and 60"):
        Experiment(route_database=route, grid_database=tmp_path / "small")
    lines = (route / "database_entries.csv").read_text().splitlines()
    lines[3] = ", ".join(["", *lines[3].split(", ")[1:]])
    (route / "database_entries.csv").write_text("\n".join(lines) + "\n")
    with pytest.raises(FileError, match="line 4: the position or heading is missing"):
        Experiment(route_database=route, grid_database=grid)


def test_a_route_without_headings_is_used_with_those_of_its_path(copies):
    route = copies[0]
    entries = route / "database_entries.csv"
    entries.write_text(entries.read_text().replace("Heading [degrees]", "Something"))
    with pytest.raises(FileError, match="--headings path takes the direction"):
        route_of(route)
    with open_views(route, headings="path") as views:
        assert np.allclose(views.poses, route_of(route, "path").poses)
    lines = entries.read_text().splitlines()
    entries.write_text("\n".join([lines[0], lines[1], lines[1].replace("image_00000", "image_00001")]) + "\n")
    with pytest.raises(FileError, match="views of one position"):
        route_of(route, "path")


def test_the_eye_of_a_database_is_that_of_its_metadata_or_its_images(copies, caplog):
    assert eye_of(*copies) == EYE
    for folder in copies:
        metadata = read_metadata(folder / METADATA)
        del metadata["tussock"]
        write_metadata(folder / METADATA, metadata)
    with caplog.at_level(logging.WARNING):
        eye = eye_of(*copies)
    assert eye == Eye(width=120, height=30)
    assert [record.message for record in caplog.records if "--top-deg" in record.message]
    assert eye_of(*copies, {"top": 0.5, "bottom": -0.5}) == Eye(width=120, height=30, top=0.5, bottom=-0.5)


def test_a_mask_hides_unknown_parts_where_the_metadata_do_not_say_who_drew_the_images(copies):
    metadata = read_metadata(copies[0] / METADATA)
    write_metadata(copies[0] / METADATA, metadata | {"tussock": None})
    mask = np.ones((EYE.height, EYE.width), bool)
    mask[:, :9] = False
    with pytest.raises(FileError, match="its mask hides parts"):
        open_views(copies[0], eye=attrs.evolve(EYE, mask=mask))


def test_the_key_of_a_run_depends_on_the_images(copies):
    experiment = Experiment(route_database=copies[0], grid_database=copies[1])
    keys = [[key(experiment) for key in (key_of, route_key, training_key)]]
    for folder in copies:
        as_jpeg(folder, 90)
        keys.append([key(experiment) for key in (key_of, route_key, training_key)])
    for of_one_kind in zip(*keys, strict=True):
        assert len(set(of_one_kind)) == 3


def test_an_image_in_which_the_encoding_sees_nothing_is_named(drawn, tmp_path, caplog):
    """One photo without transparency among others: through foreground-mask it is the same everywhere."""
    shutil.copytree(drawn[0], tmp_path / "route")
    path = sorted((tmp_path / "route").glob("*.png"))[3]
    image = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    image[..., 3] = 255
    cv2.imwrite(str(path), image)
    with open_views(tmp_path / "route") as views, caplog.at_level(logging.WARNING, "tussock.navigation"):
        _, poses = training_views(Encoding.named("edges"), views, views.training.poses)
    assert len(poses) == len(views.training.poses) - 1
    (message,) = [record.message for record in caplog.records if "training views" in record.message]
    assert str(path) in message
    assert "foreground-mask" in message
