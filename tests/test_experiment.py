"""Experiments and their flat settings: each other's inverse, with keys that depend on everything that decides a run."""

import dataclasses
import math
import shlex
import subprocess
import sys
from pathlib import Path
from typing import Any

import attrs
import cv2
import numpy as np
import pytest
import torch
import tyro
from hypothesis import given, settings
from hypothesis import strategies as st
from navigators import AHEAD

from tussock.navigation.body import Body
from tussock.navigation.cli.main import choice_of, command_of, main
from tussock.navigation.cli.models import RunCommand
from tussock.navigation.cli.options import RunOptions
from tussock.navigation.devices import chosen_device
from tussock.navigation.encoding import Encoding
from tussock.navigation.experiment import Experiment
from tussock.navigation.experiment_keys import ROUTE_SETTINGS, WALK_SETTINGS, key_of, route_key, training_key
from tussock.navigation.experiment_settings import TYPES, default_settings, experiment_of, run_command, settings_of
from tussock.navigation.models import MODELS, PerfectMemory
from tussock.navigation.models.files import TrainedModel, save_model
from tussock.navigation.steering import NAVIGATORS, Motion, Scan
from tussock.navigation.stopping import StoppingRules
from tussock.navigation.surroundings import Surroundings
from tussock.navigation.training_setup import TrainingSetup
from tussock.render.backends import BACKENDS
from tussock.render.eye import Eye
from tussock.render.images import Grid, write_database
from tussock.render.renderer import open_renderer
from tussock.world.errors import InputError, SettingError
from tussock.world.files import write_world
from tussock.world.geometry import Route
from tussock.world.heading_names import HEADINGS
from tussock.world.routes import generate_route
from tussock.world.scene import World

ROUTE = "x_m,y_m\n0,0\n1,1\n"


def decimals(low: float, high: float) -> st.SearchStrategy[float]:
    """Decimal fractions, as people write them."""
    return st.integers(round(low * 1000), round(high * 1000)).map(lambda thousandths: thousandths / 1000)


SEEDS, POSITIVE = st.integers(0, 2**62), st.floats(1e-3, 1e3)
VALUES: dict[str, st.SearchStrategy] = {
    "world": st.sampled_from(["tiny", "meadow", "scrub", "tussock-field field_width=20", "tiny grass_density=3.5"]),
    "world_seed": SEEDS,
    "seed": SEEDS,
    "size": st.sampled_from(["60x12", "180x40", "1000x90", "8x3"]),
    "renderer": st.sampled_from(BACKENDS),
    "samples": st.integers(1, 4),
    "eye_height_m": st.floats(-1, 1),
    "top_deg": decimals(0.001, 90),
    "bottom_deg": decimals(-90, 0),
    "ground": st.sampled_from(["flat", "mesh"]),
    "max_slope_deg": decimals(1, 89),
    "cull_back_faces": st.booleans(),
    "route": st.just("route.csv"),
    "route_seed": SEEDS,
    "route_length_m": st.floats(0.1, 100),
    "headings": st.sampled_from(HEADINGS),
    "columns": st.sampled_from(["x,y", "x [mm],y [mm],-,heading"]),
    "smooth_m": st.floats(0, 1),
    "spacing_m": POSITIVE,
    "every": st.integers(1, 100),
    "learning_walk_m": st.floats(0, 10),
    "parallel_views": st.integers(0, 20),
    "goal_walk_m": POSITIVE,
    "goal_turns": POSITIVE,
    "goal_views": st.integers(1, 99),
    "goal_spread_deg": decimals(0, 180),
    "device": st.just("cpu"),
    "model": st.sampled_from(
        ["perfect-memory", "infomax rate=baddeley units=none", "mushroom-body inputs=10 cells=200", "chain", "random"]
    ),
    "threads": st.integers(1, 64),
    "step_m": POSITIVE,
    "offset_m": st.floats(-9, 9),
    "heading_noise_deg": decimals(0, 90),
    "collisions": st.sampled_from(["pass", "stop", "slide"]),
    "body_radius_m": st.floats(0, 1),
    "senses": st.sampled_from(["ideal", "ant", "robot odometry=0.2 speed=0.3"]),
    "release_m": st.floats(0, 9),
    "release_deg": decimals(-180, 180),
    "displace_at": st.floats(0, 1),
    "displace_m": st.floats(-2, 2),
    "scan_deg": decimals(0.001, 360),
    "scan_about_deg": decimals(-360, 360),
    "on_lost": st.sampled_from(["stop", "reset"]),
    "waypoint_m": POSITIVE,
    "put_back_ahead_m": st.floats(0, 9),
    "arrive_m": POSITIVE,
    "lost_m": POSITIVE,
    "patience_m": POSITIVE,
    "max_steps": st.integers(1, 10**6),
    "navigator": st.just("scan"),
}
PRESET = st.fixed_dictionaries(
    {"encoding": st.sampled_from(["edges", "grey", "sky"])},
    optional={"resize": decimals(1, 20), "blur": decimals(0.01, 9)},
)
CHAIN = st.sampled_from(
    ["grey | blur 2.5 | resize 3", "sky-mask", "foreground-mask | widen 3 | normalise", "grey | resize 1"]
)
ENCODINGS = PRESET | CHAIN.map(lambda chain: {"encoding": chain}) | st.just({})


def agreeing(settings: dict) -> dict:
    """Settings without those that contradict others."""
    if settings.get("release_m"):
        settings.pop("offset_m", None)
    if abs(settings.get("displace_m", 0.0)) > settings.get("lost_m", 0.5):
        settings.pop("displace_m")
    return settings


SETTINGS = st.tuples(st.fixed_dictionaries({}, optional=VALUES), ENCODINGS).map(
    lambda parts: agreeing(parts[0] | parts[1])
)
OF_DATABASES = (
    "every",
    "learning_walk_m",
    "model",
    "threads",
    "step_m",
    "offset_m",
    "scan_deg",
    "max_steps",
)  # some that go with them
DATABASES = st.fixed_dictionaries(
    {"route_database": st.just("views"), "grid_database": st.just("around")},
    optional={name: VALUES[name] for name in OF_DATABASES},
)


@pytest.fixture(scope="module", autouse=True)
def folder(tmp_path_factory):
    """A current folder with a route in it."""
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(tmp_path_factory.mktemp("folder"))
        Path("route.csv").write_text(ROUTE)
        write_mask(Path("mask.png"), 40)
        with open_renderer(World.generate("tiny", 0), Eye(width=60, height=12), "cpu") as renderer:
            write_database("views", renderer, [(1.0 + 0.1 * k, 1.0, 0.0) for k in range(4)])
            write_database("around", renderer, Grid(begin=(1.0, 1.0), spacing=0.1, size=(2, 2)))
        yield


def write_mask(path: Path, hidden: int) -> None:
    """The picture of a mask of 720 x 150 pixels that hides some columns."""
    picture = np.full((150, 720), 255, np.uint8)
    picture[:, :hidden] = 0
    cv2.imwrite(str(path), picture)


def parsed(arguments: list[str]) -> Any:
    """A command with its flags."""
    config = (tyro.conf.FlagCreatePairsOff, tyro.conf.OmitArgPrefixes, tyro.conf.OmitSubcommandPrefixes)
    return tyro.cli(choice_of({arguments[0]: command_of(arguments[0])}), args=arguments, config=config)


# Settings


@given(SETTINGS | DATABASES)
def test_an_experiment_follows_from_its_settings(given_settings):
    experiment = experiment_of(given_settings)
    settings = settings_of(experiment)
    assert experiment_of(settings) == experiment
    for name, value in given_settings.items():  # what was given, where it is not as by default in other words
        if name not in ("encoding", "resize"):
            assert settings[name] == (value if name != "model" else value.removesuffix(" units=none"))


def test_an_agent_is_put_back_at_the_nearest_point_or_ahead_of_it():
    settings = {"on_lost": "reset-nearest"}
    assert settings_of(experiment_of(settings))["on_lost"] == "reset-nearest"
    with pytest.raises(SettingError, match="--on-lost reset with --put-back-ahead-m"):
        experiment_of({**settings, "put_back_ahead_m": 0.3})


@given(st.floats(0, 2), st.floats(1e-3, 2 * math.pi), st.floats(-9, 9), st.floats(0.01, math.pi / 2))
def test_angles_in_radians_keep_their_digits(noise, width, about, top):
    scan = {"width": width, "about": about}
    experiment = Experiment(body=Body(heading_noise=noise), eye=Eye(top=top))
    experiment = experiment.replace(navigator=dataclasses.replace(experiment.navigator, parameters=scan))
    again = experiment_of(settings_of(experiment))
    angles = [(again.body.heading_noise, noise), (again.eye.top, top)]
    angles += [(again.navigator.parameters.get(name, math.pi), value) for name, value in scan.items()]
    for found, expected in angles:
        assert math.isclose(found, expected, rel_tol=1e-15, abs_tol=1e-300)


def test_settings_have_the_names_of_the_flags_of_run():
    assert list(settings_of(experiment_of({}))) == list(TYPES)
    flags = {each.name for each in dataclasses.fields(RunOptions)}
    assert flags - set(TYPES) == {"use", "json"}  # which name classes and the output, and decide nothing
    assert set(TYPES) <= flags
    assert {each.name for each in dataclasses.fields(RunCommand)} - flags == {
        "out",
        "overwrite",
        "live",
        "viewer",
    }


def test_an_unknown_setting_is_refused_by_its_name():
    with pytest.raises(SettingError, match="'colour'"):
        experiment_of({"colour": "red"})


@pytest.mark.parametrize(
    "together",
    [{"size": "60x12", "samples": 64}, {"top_deg": -20.0, "bottom_deg": -60.0}, {"size": "32768x3", "samples": 1}],
)
def test_settings_are_checked_together_and_not_against_the_defaults_of_others(together):
    """Each alone would be refused with the defaults of the others."""
    eye = experiment_of(together).eye
    expected = {"top_deg": math.degrees(eye.top), "bottom_deg": math.degrees(eye.bottom), "samples": eye.samples}
    expected |= {"size": f"{eye.width}x{eye.height}"}
    assert all(expected[name] == pytest.approx(value) for name, value in together.items())


@pytest.mark.parametrize("there", [False, True])
def test_auto_is_a_gpu_where_there_is_one(there, monkeypatch):
    monkeypatch.setattr(torch.cuda, "is_available", lambda: there)
    assert chosen_device("auto") == ("cuda" if there else "cpu")
    assert chosen_device("cuda:1") == "cuda:1"


def test_what_ran_on_a_device_says_on_which(tmp_path):
    assert settings_of(Experiment(device="auto"))["device"] == chosen_device("auto")
    trained = TrainedModel(
        model=PerfectMemory().fit(torch.rand(2, 5, 24)), encoding=Encoding.named("grey"), eye=Eye(width=24, height=5)
    )
    save_model(trained, tmp_path / "m.safetensors")
    assert experiment_of({"model": str(tmp_path / "m.safetensors"), "device": "auto"}).device == chosen_device("auto")


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"size": "720x150", "samples": 64}, ["720 x 150", "fewer"]),
        ({"top_deg": -20.0}, ["-15", "-20"]),
        ({"on_lost": "cry"}, ["'cry'", "stop, reset or reset-nearest"]),
        ({"scan_deg": 400.0}, ["width", "400 degrees"]),
        ({"navigator": "scan width=1", "scan_deg": 90.0}, ["width", "once"]),
        ({"every": 0}, ["every", "0"]),
        ({"renderer": "gpu"}, ["'gpu'", "osmesa"]),
        ({"model": "oracle"}, ["'oracle'", "perfect-memory"]),
        ({"model": "infomax units=0"}, ["units", "0"]),
        ({"model": "no.safetensors"}, ["no.safetensors"]),
        ({"route": "no.csv"}, ["no.csv"]),
        ({"world": "no.glb"}, ["no.glb"]),
        ({"device": "abacus"}, ["'abacus'"]),
        ({"encoding": "grey | resize 3", "blur": 1.0}, ["blur", "chain"]),
    ],
)
def test_what_makes_no_sense_is_refused_where_the_experiment_is_made(settings, words):
    with pytest.raises(InputError) as refused:
        experiment_of(settings)
    assert all(word in str(refused.value) for word in words), refused.value
    assert "\n" not in str(refused.value)


# Keys

OTHER: dict[str, Any] = {
    "world": "meadow", "world_seed": 5, "up": "y", "unit": "mm", "scale": 0.5, "strict": True,
    "ground": "mesh", "max_slope_deg": 30.0, "altitude_m": 0.5,
    "seed": 6, "size": "180x40", "renderer": "cpu", "samples": 2, "eye_height_m": 0.02,
    "top_deg": 50.0, "bottom_deg": -20.0, "field_deg": 270.0,
    "side": "left", "overlap_deg": 20.0, "eye": "ant", "spectrum": "insect ground=0.2", "mask": "mask.png", "cull_back_faces": True,
    "light": "overcast",
    "route": "route.csv", "route_seed": 5, "route_length_m": 7.0,
    "headings": "bearing", "columns": "x,y", "smooth_m": 0.1,
    "encoding": "sky", "resize": 3.0, "blur": 1.0, "spacing_m": 0.05, "every": 2, "learning_walk_m": 0.0, "parallel_views": 3,
    "goal_walk_m": 1.0, "goal_turns": 3.0,
    "goal_views": 9, "goal_spread_deg": 20.0, "goal_only": True, "collisions": "slide", "body_radius_m": 0.01,
    "senses": "ant", "release_m": 1.0, "release_deg": 30.0, "displace_at": 0.4, "displace_m": 0.3,
    "test_change": "removed amount=0.2", "change_seed": 5,
    "gaze": "body", "body_length_m": 0.02, "pitch_noise_deg": 3.0, "roll_noise_deg": 3.0,
    "device": "cpu:0",
    "model": "infomax", "threads": 1, "step_m": 0.1, "offset_m": 0.1, "heading_noise_deg": 5.0, "scan_deg": 90.0, "scan_about_deg": 10.0,
    "on_lost": "reset", "waypoint_m": 0.2, "put_back_ahead_m": 0.3, "arrive_m": 0.1, "lost_m": 0.6, "patience_m": 2.0, "max_steps": 9,
}  # fmt: skip


def test_the_keys_differ_where_a_setting_differs(tmp_path):
    assert set(OTHER) == set(TYPES) - {"navigator", "route_database", "grid_database"}
    base = experiment_of({})
    needed = {"goal_only": {"goal_walk_m": 0.9}}  # by which settings others are refused without
    others = {name: experiment_of({name: value} | needed.get(name, {})) for name, value in OTHER.items()}
    others["navigator"] = experiment_of({"navigator": AHEAD})
    assert len({key_of(base), *map(key_of, others.values())}) == 1 + len(others)
    for key, names in ((route_key, {*ROUTE_SETTINGS, "seed"}), (training_key, set(TYPES) - set(WALK_SETTINGS))):
        assert {name for name, other in others.items() if key(other) != key(base)} == names - {
            "route_database",
            "grid_database",
        }
    # It is the content of a file that counts.
    Path(tmp_path / "route.csv").write_text("x_m,y_m\n0,0\n1,2\n")
    elsewhere = experiment_of({"route": tmp_path / "route.csv"})
    assert key_of(elsewhere) != key_of(others["route"])
    Path(tmp_path / "route.csv").write_text(ROUTE)
    assert key_of(elsewhere) == key_of(others["route"])
    for hidden in (41, 40):
        write_mask(tmp_path / "mask.png", hidden)
        elsewhere = experiment_of({"mask": str(tmp_path / "mask.png")})
        assert (key_of(elsewhere) == key_of(others["mask"])) == (hidden == 40)


MESHES = {  # a file, and those that decide what it looks like
    "wall.obj": (
        "mtllib no.mtl \\\n two.mtl\nmtllib my walls.mtl\nv 0 0 0\n",
        ["two.mtl", "my walls.mtl", "Skin/Bark.PNG"],
    ),
    "wall.gltf": (
        '{"asset": {}, "buffers": [{"uri": "a%20b.bin"}, {"uri": "data:,"}], "images": [{"uri": "Skin\\\\Bark.PNG"}, {}]}',
        ["a b.bin", "Skin/Bark.PNG"],
    ),
    "wall.ply": ("ply\nformat ascii 1.0\ncomment TextureFile skin/bark.png\nend_header\n", ["Skin/Bark.PNG"]),
}


@pytest.mark.parametrize("name", MESHES)
def test_the_key_of_a_run_depends_on_the_files_that_its_mesh_needs(name, tmp_path):
    content, others = MESHES[name]
    (tmp_path / "Skin").mkdir()
    contents = {name: content, "my walls.mtl": "newmtl a\n\tmap_Kd\t-clamp on C:\\art\\skin\\bark.png\nmap_Ks no.png\n"}
    for each in (name, *others, "beside.png"):
        (tmp_path / each).write_text(contents.get(each, "first"))
    experiment = experiment_of({"world": str(tmp_path / name)})
    keys = [key_of(experiment)]
    for each in (name, *others):
        (tmp_path / each).write_text(contents.get(each, "other") + " \n")
        keys.append(key_of(experiment))
    assert len(set(keys)) == len(keys)
    (tmp_path / "beside.png").write_text("not used")
    (tmp_path / "no.png").write_text("not used")
    assert key_of(experiment) == keys[-1]
    (tmp_path / "Skin" / "Bark.PNG").unlink()
    assert key_of(experiment) not in keys


@pytest.mark.parametrize("given", [{"field_deg": 296.0}, {"mask": "mask.png"}, {"field_deg": 90.0, "mask": "mask.png"}])
def test_a_field_and_a_mask_are_settings_of_a_run(given):
    experiment = experiment_of(given)
    assert {name: settings_of(experiment)[name] for name in given} == given
    assert experiment_of(settings_of(experiment)) == experiment
    command = shlex.split(run_command(experiment, "out"))[1:]
    assert parsed(command).experiment() == experiment
    # A mask that is not from a file is its own text.
    unnamed = Experiment(eye=Eye(field=experiment.eye.field, mask=experiment.eye.visible()))
    assert experiment_of(settings_of(unnamed)) == unnamed
    assert parsed(shlex.split(run_command(unnamed, "out"))[1:]).experiment() == unnamed


def test_a_field_and_a_mask_are_known_from_the_file_of_a_model(tmp_path):
    eye = Eye(field=math.radians(270), mask="mask.png")
    encoding = Encoding.named("edges", resize=6)
    model = PerfectMemory().see(encoding.for_eye(eye).mask).fit(torch.rand(3, 25, 120))
    save_model(TrainedModel(model=model, encoding=encoding, eye=eye), tmp_path / "model.safetensors")
    given = {"model": str(tmp_path / "model.safetensors")}
    assert experiment_of(given).eye == experiment_of(given | {"field_deg": 270.0}).eye == eye
    with pytest.raises(SettingError, match=r"270 degrees.*280 degrees.*leave out --field-deg, or train"):
        experiment_of(given | {"field_deg": 280.0})
    for wrong in (eye, Eye(field=math.pi)):
        with pytest.raises(SettingError, match="not trained for what this eye sees"):
            TrainedModel(
                model=PerfectMemory().fit(torch.rand(3, 25, 120)) if wrong == eye else model,
                encoding=encoding,
                eye=wrong,
            )


SAME = [
    ({}, {"world": "tussock-field", "size": "720x150", "scan_deg": 180.0, "encoding": "edges", "resize": 6.0}),
    ({"seed": 4}, {"seed": 4, "world_seed": 4, "route_seed": 4}),
    ({"model": "infomax"}, {"model": "infomax rate=z-scored  units=none"}),
    ({}, {"encoding": "sky-mask | vertical-edges | resize 6 | normalise"}),
    ({"encoding": "sky-mask"}, {"encoding": "foreground-mask | resize 1"}),
    ({"route": "route.csv"}, {"route": "route.csv", "route_seed": 3, "route_length_m": 2.0}),
    ({"route": "route.csv"}, {"route": Path("..") / "route.csv"}),
    ({"offset_m": 0}, {"offset_m": 0.0, "every": 1}),
    ({"scan_deg": 90.0}, {"navigator": f"scan width={math.pi / 2}"}),
]


@pytest.mark.parametrize(("first", "second"), SAME)
def test_the_keys_are_the_same_for_the_same_run_in_other_words(first, second, tmp_path, monkeypatch):
    (tmp_path / "here").mkdir()
    (tmp_path / "route.csv").write_text(ROUTE)
    (tmp_path / "here" / "route.csv").write_text(ROUTE)
    monkeypatch.chdir(tmp_path / "here")
    for key in (key_of, route_key, training_key):
        assert key(experiment_of(first)) == key(experiment_of(second))


def test_worlds_and_routes_in_memory_have_the_keys_of_their_contents():
    experiments = [
        Experiment(world=World.generate("tiny", seed), route=Route.through(np.array([[0.5, 0.5], [1.5, 0.5 + bend]])))
        for seed, bend in ((0, 0), (0, 0), (1, 0), (0, 1))
    ]
    keys = [key_of(experiment) for experiment in experiments]
    assert keys[0] == keys[1]
    assert len(set(keys)) == 3


def test_a_file_that_is_named_like_a_model_or_a_preset_changes_no_key(tmp_path, monkeypatch):
    settings = [
        {"world": "tiny", "model": "infomax", "encoding": "grey"},
        {"world": "tiny grass_density=3", "model": "mlp hidden_layer_sizes=8"},
    ]
    before = [key_of(experiment_of(each)) for each in settings]
    monkeypatch.chdir(tmp_path)
    for name in ("infomax", "tiny", "grey", "scan", "cpu", "tiny grass_density=3", "mlp hidden_layer_sizes=8"):
        Path(name).write_bytes(b"something else")
    assert [key_of(experiment_of(each)) for each in settings] == before


def test_a_world_file_whose_name_begins_with_that_of_a_preset_is_opened(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_world(World.generate("tiny", 3), "tiny world.glb")
    experiment = experiment_of({"world": "tiny world.glb"})
    assert np.array_equal(experiment.open_world().triangles, World.generate("tiny", 3).triangles)
    assert key_of(experiment) == key_of(experiment.replace(world_seed=5))  # which is of generated worlds only


def test_a_path_is_a_file_even_where_it_is_named_like_a_preset(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("tiny").write_bytes(b"")
    experiment = Experiment(world=Path("tiny"))
    assert experiment_of(settings_of(experiment)) == experiment
    assert key_of(experiment) != key_of(experiment.replace(world="tiny"))


# The command that repeats a run


def repeats_it(given_settings):
    experiment = experiment_of(given_settings)
    program, *arguments = shlex.split(run_command(experiment, "the folder"))
    command = parsed(arguments)
    assert program == "tussock"
    assert isinstance(command, RunCommand)
    assert command.out == Path("the folder")
    assert command.experiment() == experiment


@settings(max_examples=30)
@given(SETTINGS | DATABASES)
def test_the_command_of_a_run_repeats_it(given_settings):
    repeats_it(given_settings)


@pytest.mark.slow
@settings(max_examples=200)
@given(SETTINGS | DATABASES)
def test_the_command_of_a_run_repeats_it_in_many_examples(given_settings):
    repeats_it(given_settings)


def test_the_command_names_only_what_is_not_as_by_default():
    assert run_command(Experiment(), "run") == "tussock run --out run"
    ahead = experiment_of({"navigator": AHEAD, "cull_back_faces": True, "offset_m": -0.1})
    words = f"--cull-back-faces --offset-m -0.1 --navigator {AHEAD}"
    assert run_command(ahead, "run") == f"tussock run {words} --out run"


# Flags


def test_the_defaults_of_the_flags_are_those_of_the_experiment():
    assert RunOptions().experiment() == Experiment()
    command = parsed(["run"])
    assert command.experiment() == Experiment()
    for each in [each for each in dataclasses.fields(RunOptions) if each.name in TYPES]:
        assert each.default in (None, default_settings().get(each.name, ""))


DEFAULTS = [  # a class of settings, one of its fields, another default, and the flag that shows it
    (Body, "step_length", 0.07, "step_m", 0.07),
    (Body, "heading_noise", math.radians(3), "heading_noise_deg", 3.0),
    (StoppingRules, "max_deviation", 0.7, "lost_m", 0.7),
    (StoppingRules, "waypoint_spacing", 0.3, "waypoint_m", 0.3),
    (TrainingSetup, "spacing", 0.06, "spacing_m", 0.06),
    (TrainingSetup, "learning_walk", 0.3, "learning_walk_m", 0.3),
    (Surroundings, "route_length", 5.0, "route_length_m", 5.0),
    (Experiment, "model", "infomax", "model", "infomax"),
    (Experiment, "start_offset", 0.2, "offset_m", 0.2),
]


def test_a_changed_default_of_the_settings_shows_in_the_flags():
    changes = [(kind.__module__, kind.__name__, field, value) for kind, field, value, _, _ in DEFAULTS]
    flags = {flag: value for _, _, _, flag, value in DEFAULTS}
    script = f"""
from importlib import import_module
import attrs

changed = attrs.Attribute.__setattr__ and object.__setattr__  # attributes of attrs are frozen
for module, kind, field, value in {changes!r}:
    changed(attrs.fields_dict(getattr(import_module(module), kind))[field], "default", value)
from tussock.navigation.cli.options import RunOptions

flags = RunOptions()
for flag, value in {flags!r}.items():
    assert getattr(flags, flag) == value, (flag, getattr(flags, flag))
"""
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def test_with_another_eye_a_preset_encoding_keeps_its_number_of_columns():
    small = Experiment(eye=Eye(width=90, height=20))
    assert Experiment().replace(eye=small.eye) == small
    assert Experiment().replace(eye__width=90, eye__height=20) == small
    chosen = Experiment(encoding=Encoding.named("edges", resize=3))
    assert chosen.replace(eye=small.eye).encoding == chosen.encoding


# Running


def test_an_experiment_walks_what_tussock_run_walks(tmp_path):
    experiment = Experiment(
        world="tiny", seed=2, eye=Eye(width=60, height=12), route_length=2.0, model="infomax", start_offset=0.1,
        body=Body(heading_noise=math.radians(5)), stopping=StoppingRules(max_steps=20, put_back=True),
    )  # fmt: skip
    before = torch.get_num_threads()
    flags = (
        "--world tiny --seed 2 --size 60x12 --route-length-m 2 --model infomax --offset-m 0.1 --heading-noise-deg 5 "
        "--max-steps 20 --on-lost reset --threads 1"
    )
    main(["run", *flags.split(), "--out", str(tmp_path / "run")])
    assert torch.get_num_threads() == before  # --threads is of this run alone
    assert experiment.replace(threads=1).run().to_csv() == (tmp_path / "run" / "trajectory.csv").read_text()


def test_progress_is_reported_while_it_walks():
    reported = []
    experiment = Experiment(world="tiny", eye=Eye(width=60, height=12), stopping=StoppingRules(max_steps=3))
    trajectory = experiment.run(lambda done, of: reported.append((done, of)))
    assert reported == [(k, 3) for k in range(len(trajectory))]


@pytest.mark.parametrize("model", ["perfect-memory", "visual-compass", "random"])
def test_training_views_are_in_memory_once(model):
    experiment = Experiment(world="tiny", route_length=1.0, eye=Eye(width=60, height=15), model=model)
    with experiment.opened() as trained:
        kept = getattr(trained.model.model, "snapshots", None)
        assert (kept is not None and kept.data_ptr() == trained.views.data_ptr()) == (model == "perfect-memory")
        assert len(trained.views) == len(trained.poses)


def test_a_navigator_without_a_model_walks(tmp_path):
    """One from outside: nothing is measured about learned views."""
    experiment = experiment_of({"world": "tiny", "size": "60x12", "navigator": AHEAD, "max_steps": 60})
    trajectory = experiment.run()
    headings = {round(heading, 9) for heading in trajectory.column("heading_deg")}
    assert len(headings) == 1
    assert trajectory.summary()["poor_steps"] > 0


def test_nothing_changes_an_experiment():
    experiment = Experiment(world="tiny")
    with pytest.raises(attrs.exceptions.FrozenInstanceError):
        experiment.seed = 3
    changed = experiment.replace(seed=3, body__heading_noise=0.1, training__every=2)
    assert (changed.seed, changed.body.heading_noise, changed.training.every) == (3, 0.1, 2)
    assert (experiment.seed, experiment.body.heading_noise, experiment.training.every) == (0, 0.0, 1)


@given(SETTINGS)
def test_an_encoding_is_the_same_from_its_text(given_settings):
    """What a command prints as its encoding can be given back to it."""
    encoding = experiment_of(given_settings).encoding
    assert experiment_of({"encoding": str(encoding)}).encoding == encoding == Encoding.parse(str(encoding))


# Classes from outside that do not fit, and objects that are not what a field takes


class NoModel:
    """A navigator that takes no model, and turns as it is told."""

    def __init__(self, turn: float = 0.0, step: float = 1.0):
        self.turn, self.step = turn, step

    def learn(self, views):
        self.model = "a linear layer, say"

    def begin(self):
        return None

    def decide(self, look, memories):
        return Motion(turn=np.full(len(look), self.turn), step=np.full(len(look), self.step))


HERE = f"{__name__}:NoModel"
TINY = {"world": "tiny", "eye": Eye(width=36, height=8), "route_length": 1.0}


@pytest.fixture
def forgetful(monkeypatch):
    """Registries that forget afterwards what a test enters."""
    for registry in (MODELS, NAVIGATORS):
        monkeypatch.setattr(registry, "_registered", {})


def test_a_navigator_with_something_else_as_its_model_walks(forgetful):
    assert Experiment(**TINY, navigator=HERE, stopping=StoppingRules(max_steps=2)).run().summary()["steps"] == 2


def test_a_navigator_that_takes_no_model_refuses_one_from_a_file(forgetful, tmp_path):
    model = PerfectMemory().fit(torch.zeros(1, 4, 8))
    save_model(TrainedModel(model=model), tmp_path / "a.safetensors")
    with pytest.raises(SettingError, match="takes no model"):
        Experiment(**TINY, navigator=HERE, model=tmp_path / "a.safetensors")


@pytest.mark.parametrize("parameters", ["turn=inf", "step=7", "step=-1"])
def test_a_motion_that_cannot_be_made_is_refused_naming_the_navigator(forgetful, parameters):
    with pytest.raises(SettingError, match="NoModel decided"):
        Experiment(**TINY, navigator=f"{HERE} {parameters}").run()


@pytest.mark.parametrize(
    ("field", "value", "words"),
    [
        ("model", "builtins:dict", "builtins:dict"),
        ("model", "os:getcwd", "fit"),
        ("model", 5, "int"),
        ("model", PerfectMemory(seed=3), "seed"),
        ("model", PerfectMemory().fit(torch.zeros(1, 4, 8)), "untrained"),
        ("navigator", "os:getcwd", "decide"),
        ("navigator", Scan(model=PerfectMemory()), "spec"),
        ("navigator", 5, "spec"),
        ("encoding", "grey | math:sin 1", "math:sin"),
        ("threads", 10**10, "threads"),
        ("world", 5, "world"),
        ("route", np.zeros((3, 2)), "route"),
    ],
)
def test_what_a_field_cannot_be_is_refused(forgetful, field, value, words):
    with pytest.raises(SettingError, match=words):
        Experiment(**TINY | {field: value})


def test_the_class_of_a_model_is_part_of_the_key_not_its_name_alone(forgetful):
    class Other(PerfectMemory):
        pass

    keys = set()
    for cls in (PerfectMemory, Other):
        MODELS.register("near", cls)
        keys.add(key_of(Experiment(**TINY, model="near")))
    assert len(keys) == 2


def test_routes_in_memory_have_keys_and_names_of_their_own_that_do_not_change():
    world = World.generate("tiny", 0)
    experiments = [Experiment(**TINY, route=generate_route(world, seed, 1.0)) for seed in (1, 2)]
    keys = [key_of(each) for each in experiments]
    assert len({*keys}) == 2
    assert len({settings_of(each)["route"] for each in experiments}) == 2
    _ = [each.route.length for each in experiments]  # which a route remembers
    assert [key_of(each) for each in experiments] == keys


@pytest.mark.parametrize("width", [500, 887, 720])
def test_an_automatic_resize_is_recognised_at_any_width(width):
    assert settings_of(Experiment(eye=Eye(width=width, height=100)))["resize"] is None


def test_settings_and_a_field_of_them_can_be_replaced_together():
    changed = Experiment().replace(body=Body(step_length=0.1), body__heading_noise=0.2)
    assert changed.body == Body(step_length=0.1, heading_noise=0.2)


def test_experiments_are_equal_and_hash_by_content():
    world = World.generate("tiny", 0)
    one, other = (Experiment(**TINY, route=generate_route(world, 1, 1.0)) for _ in range(2))
    assert one == other
    assert hash(one) == hash(other)
    assert one != one.replace(route=generate_route(world, 2, 1.0))
