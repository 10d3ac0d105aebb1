"""The command line as a contract: names, flags, keys, exit codes, and the files that it leaves."""

import ast
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
import tomllib
from pathlib import Path

import cv2
import numpy as np
import pytest
import trimesh
from commands import KEYS, TUSSOCK, Process, printed, process, process_json, tussock

from tussock.navigation.cli.main import main
from tussock.navigation.cli.options import WORLD
from tussock.navigation.cli.overview import COMMANDS, GROUPS
from tussock.navigation.evaluation import grid_positions
from tussock.navigation.experiment import Experiment
from tussock.navigation.models import MODELS
from tussock.navigation.models.files import load_model
from tussock.render.eye import Eye
from tussock.render.renderer import open_renderer
from tussock.world.files import read_world, write_world
from tussock.world.meshes.reading import MeshReading
from tussock.world.obstacles import clearance
from tussock.world.params import DESCRIPTIONS, WORLDS
from tussock.world.route_files import read_route
from tussock.world.scene import World

SMALL = ["--world", "tiny", "--size", "90x20", "--seed", "2"]
RUN = ["run", *SMALL, "--offset-m", "0.1", "--heading-noise-deg", "5"]
HEAVY = {
    "torch", "numba", "trimesh", "rerun", "matplotlib", "cv2", "scipy", "sklearn", "pandas", "pyarrow", "distributed", "joblib",
    "safetensors", "gymnasium", "pyrender", "rich",
}  # fmt: skip


def files(folder: Path) -> set[str]:
    return {str(path.relative_to(folder)) for path in folder.rglob("*")}


def contents(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


# Help


@pytest.mark.parametrize("arguments", [["--help"], ["models", "--help"]])
def test_help_may_be_read_in_part(arguments):
    reading, writing = os.pipe()
    os.close(reading)  # as head does that has read enough
    done = subprocess.run([TUSSOCK, *arguments], stdout=writing, stderr=subprocess.PIPE)
    os.close(writing)
    assert (done.returncode, done.stderr) == (0, b"")


def test_help_lists_every_command(capfd):
    code, out, _ = tussock(capfd, "--help")
    assert code == 0
    assert set(COMMANDS) == {name.split()[0] for name in KEYS}
    assert all(name in out for name in [*COMMANDS, *GROUPS, "--version"])
    assert max(map(len, out.splitlines())) <= 80
    for name in COMMANDS:
        assert tussock(capfd, name, "--help")[0] == 0


def test_the_version_is_that_of_the_package(capfd):
    expected = tomllib.loads(Path(__file__).parents[1].joinpath("pyproject.toml").read_text())["project"]["version"]
    assert tussock(capfd, "--version")[:2] == (0, f"tussock {expected}\n")


def test_no_command_shows_them_all_and_a_wrong_one_is_one_line(capfd):
    code, out, _ = tussock(capfd)
    assert code == 2
    assert all(name in out for name in COMMANDS)
    code, out, err = tussock(capfd, "wrold")
    assert (code, out) == (2, "")
    assert err == "tussock: unknown command 'wrold' (did you mean 'world'?); tussock --help lists all\n"


@pytest.mark.parametrize(
    "arguments",
    [
        ["--help"],
        ["run", "--help"],
        ["run", "--model", "opponent-perfect-memori"],
        ["run", "--model", "hemifields-perfect-memori"],
        ["evaluate", "--model", "infomx width=3"],
        ["run", "--navigator", "laterl(k=1)"],
    ],
)
def test_help_and_wrong_names_load_nothing_heavy(arguments):
    script = (
        "import sys; from tussock.navigation.cli.main import main\n"
        "try: main(sys.argv[1:])\n"
        "except SystemExit: print(sorted({name.partition('.')[0] for name in sys.modules}))"
    )
    done = subprocess.run([sys.executable, "-c", script, *arguments], capture_output=True, text=True)
    loaded = set(ast.literal_eval(done.stdout.splitlines()[-1]))
    assert "tyro" in loaded
    assert not loaded & HEAVY


def test_what_reads_the_output_may_have_enough_of_it():
    done = subprocess.run(
        f"{sys.executable} -c 'from tussock.navigation.cli.main import main; main()' models --json | head -c 1",
        shell=True, capture_output=True, text=True,
    )  # fmt: skip
    assert (done.stdout, done.stderr) == ("{", "")


def test_the_names_of_several_models_are_not_taken_for_one(capfd, tmp_path):
    """`all` names all models, which only the test bed takes; what follows is refused for another reason."""
    code, _, err = tussock(capfd, "benchmark", "--model", "all", "--quick", "--encoding", "nonsense", "--out", tmp_path)
    assert code == 2
    assert "nonsense" in err
    assert "'all'" not in err


# What the commands make


@pytest.mark.parametrize("suffix", ["glb", "ply"])
def test_world_writes_what_generate_makes(capfd, tmp_path, suffix):
    out, picture = tmp_path / f"w.{suffix}", tmp_path / "w.png"
    result = printed(capfd, "world", "--preset", "tiny", "--seed", 7, "--out", out, "--picture", picture)
    assert result["triangles"] == len(World.generate("tiny", 7).triangles)
    assert np.array_equal(read_world(out).triangles, World.generate("tiny", 7).triangles)
    assert cv2.imread(str(picture)) is not None


def test_view_writes_what_the_renderer_draws(capfd, tmp_path):
    pose = ["--world", "tiny", "--seed", 3, "--at", "1,2,90"]
    result = printed(capfd, "view", *pose, "--out", tmp_path / "v.png")
    assert result == {"view": str(tmp_path / "v.png"), "width": 720, "height": 150, "renderer": "cpu"}
    with open_renderer(World.generate("tiny", 3), Eye(), "cpu") as renderer:
        view = renderer.render([(1.0, 2.0, np.pi / 2)])[0]
    assert np.array_equal(cv2.imread(str(tmp_path / "v.png"), cv2.IMREAD_UNCHANGED)[..., ::-1], view[..., :3])
    tussock(capfd, "view", *pose, "--out", tmp_path / "a.png", "--alpha")
    assert np.array_equal(cv2.imread(str(tmp_path / "a.png"), cv2.IMREAD_UNCHANGED)[..., 3], view[..., 3])


def test_a_world_file_may_have_spaces_and_the_name_of_a_preset_in_its_name(capfd, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_world(World.generate("tiny", 3), "tiny world.glb")
    for world, picture in (("tiny world.glb", "a.png"), ("tiny", "b.png")):
        printed(capfd, "view", "--world", world, "--seed", 3, "--at", "1,2,90", "--out", picture)
    assert Path("a.png").read_bytes() == Path("b.png").read_bytes()


def test_a_mesh_of_another_program_is_read_as_the_flags_say(capfd, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    boxes = [
        trimesh.creation.box(bounds=[(x, 0, y), (x + 80, 300, y + 80)])
        for x, y in ((0, 0), (2900, 0), (0, -2900), (2900, -2900))
    ]
    trimesh.util.concatenate(boxes).export("mm.stl")
    asked, read = ["view", "--world", "mm.stl", "--size", "60x12", "--out", "v.png"], ["--up", "y", "--unit", "mm"]
    code, _, err = tussock(capfd, *asked)
    assert code == 0
    assert "--unit mm" in err
    assert "--up y" in err
    code, _, err = tussock(capfd, *asked, *read, "--at", "1.5,1.5,0", "--strict")
    assert (code, err) == (0, "renderer: cpu\n")
    assert tussock(capfd, *asked, "--up", "y", "--scale", "0.001")[0] == 0
    assert tussock(capfd, "route", "--world", "mm.stl", *read, "--length-m", "1.5", "--out", "r.csv")[0] == 0
    assert read_world("mm.stl", MeshReading(up="y", unit="mm")).field.contains(*read_route("r.csv").xy.T).all()
    for flags, words in (
        (["--unit", "mm", "--scale", "1"], "give one of the two"),
        (["--unit", "yards"], "one of auto, mm, cm, m, in, ft"),
        (["--up", "w"], "one of auto, x, y, z"),
        (["--scale", "0"], "scale is 0"),
        (["--world", "tiny", "--up", "y"], "is generated"),
    ):
        code, _, err = tussock(capfd, *asked, *flags)
        assert (code, err.count("\n")) == (2, 1)
        assert words in err


def test_places_in_a_world_far_from_0_are_given_as_in_its_file(capfd, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    boxes = [
        trimesh.creation.box(bounds=[(x, y, 0), (x + 0.1, y + 0.1, 0.3)]) for x, y in ((0, 0), (3, 0), (0, 3), (3, 3))
    ]
    mesh = trimesh.util.concatenate(boxes)
    mesh.apply_translation([512_340, 5_638_660, 0])
    Path("w.obj").write_text(mesh.export(file_type="obj", digits=12))
    for at, name in (("1.5,1.5,30", "a.png"), ("512341.5,5638661.5,30", "b.png")):
        assert tussock(capfd, "view", "--world", "w.obj", "--size", "60x12", "--at", at, "--out", name)[0] == 0
    assert Path("a.png").read_bytes() == Path("b.png").read_bytes()
    for goal in ("1.5,1.5", "512341.5,5638661.5"):
        result = printed(capfd, "route", "--world", "w.obj", "--length-m", "1", "--goal", goal)
        assert result["goal"] == pytest.approx((1.5, 1.5), abs=0.1)


def test_routes_of_several_seeds_lead_to_one_goal(capfd, tmp_path):
    ends = []
    for seed in (1, 2):
        out, picture = tmp_path / f"{seed}.csv", tmp_path / f"{seed}.png"
        flags = [
            "--world",
            "tiny field_width=6 field_depth=6",
            "--seed",
            5,
            "--route-seed",
            seed,
            "--goal",
            "4.9,4.9",
            "--length-m",
            4,
        ]
        result = printed(capfd, "route", *flags, "--out", out, "--picture", picture)
        assert read_route(out).goal[:2] == pytest.approx(result["goal"], abs=1e-6)
        assert cv2.imread(str(picture)) is not None
        ends.append(read_route(out))
    assert all(np.hypot(*(np.array(route.goal[:2]) - 4.9)) < 0.1 for route in ends)
    assert np.hypot(*(ends[0].xy[0] - ends[1].xy[0])) > 0.5


def test_databases_are_written_and_checked(capfd, tmp_path):
    world = ["--world", "tiny", "--seed", 2, "--size", "90x20"]
    grid = printed(capfd, "database", "grid", *world, "--spacing-m", 1, "--out", tmp_path / "grid")
    assert grid["images"] == grid["rendered"] == 16
    route = printed(capfd, "database", "route", *world, "--spacing-m", 0.5, "--out", tmp_path / "route")
    assert route["type"] == "route"
    assert printed(capfd, "database", "check", tmp_path / "grid")["ok"]
    next((tmp_path / "grid").glob("*.png")).unlink()
    broken = printed(capfd, "database", "check", tmp_path / "grid", code=1)
    assert len(broken["problems"]) == 1


def test_evaluate_recovers_headings(capfd):
    flags = ["--encoding", "grey", "--resize", 2, "--every", 2, "--spacing-m", 0.04, "--grid-m", 0.2, "--within-m", 0.2]
    result = printed(capfd, "evaluate", *SMALL, *flags, "--model", "perfect-memory", "--scan-deg", 360)
    assert result["encoding"] == "grey | resize 2"
    assert result["model"] == "perfect-memory"
    assert 0 <= result["median_error_deg"] <= 180
    code, out, err = tussock(capfd, "evaluate", *SMALL, *flags)
    assert code == 0
    assert "median_error_deg" in out
    assert "renderer: cpu" in err


def test_evaluate_reports_positions_with_room_and_by_distance(capfd):
    flags = ["evaluate", *SMALL, "--grid-m", 0.05, "--within-m", 0.1]
    result = printed(capfd, *flags)
    numbers = ("n_positions", "median_error_deg", "mean_error_deg", "share_over_45")
    assert result["by_distance"]["all"] == {name: result[name] for name in numbers}
    assert list(result["by_distance"]) == ["0 to 5 cm", "5 to 10 cm", "all"]
    assert result["clearance_m"] == 0.02
    world, route = Experiment(world="tiny", seed=2).open_world_and_route()
    room = clearance(world, grid_positions(route, grid=0.05, within=0.1, field=world.field))
    for metres in (0.0, float(np.median(room)), float(room.max()) + 0.01):
        with_room = printed(capfd, *flags, "--clearance-m", metres)["with_room"]
        assert with_room.get("all", {"n_positions": 0})["n_positions"] == (room >= metres).sum()
        assert (with_room == result["by_distance"]) == (metres == 0)
    assert with_room == {}


@pytest.mark.parametrize(
    ("flags", "encoding"),
    [
        (["--encoding", "grey", "--resize", 1], "grey | resize 1"),
        (["--encoding", "sky-mask"], "foreground-mask | resize 1"),
        ([], "foreground-mask | vertical-edges | normalise"),
        (["--encoding", "sky-mask | blur 1 | resize 3"], "foreground-mask | blur 1 | resize 3"),
    ],
)
def test_the_encoding_that_a_command_prints_can_be_given_back_to_it(capfd, flags, encoding):
    coarse = ["--every", 8, "--grid-m", 0.5, "--within-m", 0.3]
    first = printed(capfd, "evaluate", *SMALL, *coarse, *flags)
    assert first["encoding"] == encoding
    second = printed(capfd, "evaluate", *SMALL, *coarse, "--encoding", first["encoding"])
    assert {**second, "seconds": 0} == {**first, "seconds": 0}


def test_run_arrives_and_leaves_a_whole_folder(capfd, tmp_path):
    out = tmp_path / "run"
    result = printed(capfd, *RUN, "--out", out)
    assert result["arrived"]
    assert result["reason"] == "arrived"
    assert Path(result["recording"]).is_file()
    assert files(out) == {"recording.rrd", "trajectory.csv", "summary.json", "overview.png", "route.csv"}
    summary = json.loads((out / "summary.json").read_text())
    assert summary["steps"] == result["steps"] == len((out / "trajectory.csv").read_text().splitlines()) - 2
    assert summary["settings"]["seed"] == 2
    assert summary["settings"]["encoding"] == "foreground-mask | vertical-edges | normalise"
    assert cv2.imread(str(out / "overview.png")) is not None
    # A second run is refused and changes nothing; --overwrite replaces it with the same bytes.
    before = contents(out)
    code, out_text, err = tussock(capfd, *RUN, "--out", out, "--json")
    assert (code, out_text) == (2, "")
    assert "already holds a run" in err
    assert contents(out) == before
    printed(capfd, *RUN, "--out", out, "--overwrite", "--on-lost", "reset")  # it is never lost
    for name in ("trajectory.csv", "route.csv", "overview.png"):
        assert contents(out)[name] == before[name]


@pytest.mark.slow
def test_two_processes_with_one_seed_write_the_same_bytes(tmp_path):
    for name, threads in (("a", "2"), ("b", "1")):  # as on another machine: nothing may depend on it
        folder = tmp_path / name
        folder.mkdir()
        assert process("world", "--preset", "tiny", "--seed", "5", "--out", "w.glb", cwd=folder).returncode == 0
        environment = os.environ | {"OMP_NUM_THREADS": threads}
        assert process_json(*RUN, "--world", "w.glb", "--out", "run", cwd=folder, env=environment)["reason"]
    for name in ("w.glb", "run/route.csv", "run/trajectory.csv", "run/overview.png"):
        assert (tmp_path / "a" / name).read_bytes() == (tmp_path / "b" / name).read_bytes(), name
    a, b = (json.loads((tmp_path / name / "run" / "summary.json").read_text()) for name in ("a", "b"))
    for summary in (a, b):
        del summary["seconds"], summary["steps_per_second"]
    assert a == b


@pytest.fixture(scope="module")
def trained(tmp_path_factory) -> Path:
    """A model file that tussock train wrote."""
    path = tmp_path_factory.mktemp("trained") / "m.safetensors"
    main(["train", *SMALL, "--model", "infomax", "--learning-walk-m", "0", "--out", str(path), "--json"])
    return path


def test_a_trained_model_does_what_training_in_place_does(capfd, tmp_path, trained):
    same = ("median_error_deg", "mean_error_deg", "n_views", "model", "encoding")
    in_place = printed(capfd, "evaluate", *SMALL, "--model", "infomax")
    # The size and encoding come from the file.
    from_file = printed(capfd, "evaluate", "--world", "tiny", "--seed", 2, "--model", trained)
    assert [in_place[key] for key in same] == [from_file[key] for key in same]
    walk = ["run", "--world", "tiny", "--seed", 2, "--model", trained, "--out", tmp_path / "run", "--max-steps", 3]
    assert tussock(capfd, *walk)[0] == 0
    settings = json.loads((tmp_path / "run" / "summary.json").read_text())["settings"]
    assert settings["n_views"] == in_place["n_views"]


def test_a_trained_model_goes_on_learning_in_constant_memory(capfd, tmp_path, trained):
    second = [
        "route",
        "--world",
        "tiny",
        "--seed",
        2,
        "--route-seed",
        5,
        "--length-m",
        2,
        "--out",
        tmp_path / "second.csv",
    ]
    assert tussock(capfd, *second)[0] == 0
    go_on = ["train", *SMALL, "--model", trained, "--route", tmp_path / "second.csv", "--learning-walk-m", 0]
    result = printed(capfd, *go_on, "--out", tmp_path / "both.safetensors")
    assert result["n_views"] > 40
    assert result["model"] == "infomax"
    assert result["memory_bytes"] == load_model(trained).model.memory_bytes
    tussock(capfd, "train", *SMALL, "--every", 8, "--model", "rbm", "--out", tmp_path / "rbm.safetensors")
    again = ["train", *SMALL, "--model", tmp_path / "rbm.safetensors", "--out", tmp_path / "two.safetensors"]
    code, _, err = tussock(capfd, *again)
    assert code == 2
    assert "rbm" in err
    assert "cannot go on" in err
    assert not (tmp_path / "two.safetensors").exists()


@pytest.mark.parametrize(
    ("flags", "words"),
    [
        (["--encoding", "grey"], ["grey", "leave out", "--encoding"]),
        (["--size", "60x12"], ["another eye", "--size"]),
        (["--top-deg", "50"], ["another eye", "--top-deg"]),
    ],
)
def test_a_trained_model_refuses_what_it_did_not_learn_with(capfd, trained, flags, words):
    code, out, err = tussock(capfd, "evaluate", "--world", "tiny", "--seed", 2, "--model", trained, *flags)
    assert (code, out) == (2, "")
    assert all(word in err for word in [str(trained), *words])
    assert len(err.splitlines()) == 1


def test_compare_gives_the_numbers_of_evaluate_and_run(capfd, tmp_path):
    names, small = "perfect-memory,opponent-infomax", [*SMALL, "--resize", 4, "--spacing-m", 0.1]
    rows = printed(capfd, "compare", *small, "--models", names)["models"]
    assert list(rows) == names.split(",")
    for name, row in rows.items():
        assert set(row) == {
            "median_error_deg", "mean_error_deg", "share_over_45", "arrived", "memory_bytes", "fit_seconds", "scan_ms",
        }  # fmt: skip
        evaluated = printed(capfd, "evaluate", *small, "--model", name)
        assert all(row[key] == evaluated[key] for key in ("median_error_deg", "mean_error_deg", "share_over_45"))
        walked = printed(capfd, "run", *small, "--model", name, "--offset-m", 0.1, "--out", tmp_path / name)
        assert row["arrived"] == walked["arrived"]
    code, table, _ = tussock(capfd, "compare", *SMALL, "--models", "random")
    assert code == 0
    assert re.search(r"random .*(yes|no)", table)


def test_compare_refuses_a_start_outside_the_world_before_it_trains(capfd, monkeypatch):
    trained = []
    monkeypatch.setattr("tussock.navigation.comparison.training_views", lambda *given: trained.append(given))
    code, out, err = tussock(capfd, "compare", *SMALL, "--models", "perfect-memory", "--offset-m", 50)
    assert (code, out) == (2, "")
    assert "outside the world" in err
    assert not trained


def test_models_lists_each_with_a_line_and_its_paper(capfd):
    models = printed(capfd, "models")["models"]
    assert [*MODELS.names, "opponent-...", "hemifields-..."] == list(models)
    assert all(set(row) == {"what", "paper"} for row in models.values())
    assert all(len(models[name]["what"]) > 20 and models[name]["paper"] for name in MODELS.builtin)
    assert "Ardin" in tussock(capfd, "models")[1]


@pytest.mark.slow
def test_a_study_prints_its_claims(capfd, tmp_path):
    flags = ["--quick", "--world", "tiny", "--seed", 7, "--size", "60x12", "--out", tmp_path / "study"]
    claims = printed(capfd, "study", "frequency", *flags)["claims"]
    assert set(claims) == {"mean-biased-by-outliers", "error-grows-with-frequency"}
    assert all(set(claim) == {"figure", "holds"} for claim in claims.values())


# Bad input: the command, and what its message holds

BAD = {
    "a missing world": (["view", "--world", "nowhere.glb"], ["nowhere.glb"]),
    "a truncated world": (["view", "--world", "cut.glb"], ["cut.glb", "cannot be read"]),
    "a .bin of another size": (["view", "--world", "odd.bin"], ["odd.bin", "100 bytes", "96"]),
    "an unknown preset": (["view", "--world", "tundra"], ["tundra", "tussock-field"]),
    "an unknown preset to generate": (["world", "--preset", "tundra", "--out", "w.glb"], ["tundra", "tussock-field"]),
    "a negative seed": (["world", "--preset", "tiny", "--seed", "-1", "--out", "w.glb"], ["seed", "-1"]),
    "an unknown suffix of a world": (["world", "--preset", "tiny", "--out", "w.xyz"], ["w.xyz", ".glb or .ply"]),
    "NaN in a route": (["evaluate", *SMALL, "--route", "nan.csv"], ["nan.csv, line 3", "x_m", "'nan'"]),
    "a route of one point": (["run", *SMALL, "--route", "one.csv", "--out", "r"], ["one.csv", "at least 2"]),
    "a route elsewhere": (["run", *SMALL, "--route", "far.csv", "--out", "r"], ["leaves the world"]),
    "a pose outside": (["view", "--world", "tiny", "--at", "99,0,0"], ["99", "outside the world"]),
    "a pose of two numbers": (["view", "--world", "tiny", "--at", "1,2"], ["1,2", "X,Y,HEADING_DEG"]),
    "a NaN pose": (["view", "--world", "tiny", "--at", "nan,2,0"], ["nan", "outside the world"]),
    "size 0": (["view", "--world", "tiny", "--size", "0x0"], ["width is 0", "4"]),
    "a size without numbers": (["run", *SMALL, "--size", "big", "--out", "r"], ["'big'", "columns x rows"]),
    "an unknown model": (
        ["run", *SMALL, "--model", "oracle", "--out", "r"],
        ["'oracle'", "visual-compass, perfect-memory"],
    ),
    "an unknown encoding": (["run", *SMALL, "--encoding", "smell", "--out", "r"], ["'smell'", "grey, sky, edges"]),
    "an unknown renderer": (
        ["run", *SMALL, "--renderer", "vulkan", "--out", "r"],
        ["'vulkan'", "auto, cpu, cuda, egl, osmesa"],
    ),
    "an unknown navigator": (["run", *SMALL, "--navigator", "pilot", "--out", "r"], ["'pilot'", "scan"]),
    "a scan of 0 degrees": (["evaluate", *SMALL, "--scan-deg", "0"], ["--scan-deg 0", "360"]),
    "a clearance of NaN": (["evaluate", *SMALL, "--clearance-m", "nan"], ["--clearance-m nan"]),
    "no spacing": (["evaluate", *SMALL, "--spacing-m", "0"], ["spacing", "0"]),
    "every 0": (["evaluate", *SMALL, "--every", "0"], ["every", "0"]),
    "a learning walk of -1 m": (["run", *SMALL, "--learning-walk-m", "-1", "--out", "r"], ["--learning-walk-m", "-1"]),
    "views that show nothing": (
        ["run", *SMALL, "--encoding", "sky", "--top-deg", "-5", "--out", "r"],
        ["training views shows anything"],
    ),
    "a scan about NaN": (["run", *SMALL, "--scan-about-deg", "nan", "--out", "r"], ["about", "nan"]),
    "positions within NaN": (["evaluate", *SMALL, "--within-m", "nan"], ["within nan m"]),
    "too many rays": (
        ["view", "--world", "tiny", "--size", "32768x16384", "--samples", "64"],
        ["32768 x 16384", "fewer"],
    ),
    "too many views": (["evaluate", *SMALL, "--spacing-m", "1e-9"], ["1e-09", "million"]),
    "an input that would be replaced": (
        ["run", *SMALL, "--route", "in/route.csv", "--out", "in", "--overwrite"],
        ["in/route.csv", "replaced"],
    ),
    "a start outside": (["run", *SMALL, "--offset-m", "50", "--out", "r"], ["outside the world"]),
    "neither stop nor reset": (["run", *SMALL, "--on-lost", "cry", "--out", "r"], ["'cry'", "reset or reset-nearest"]),
    "a file for a folder": (["run", *SMALL, "--out", "one.csv"], ["one.csv is a file"]),
    "a folder under a file": (["run", *SMALL, "--out", "one.csv/run"], ["one.csv/run", "cannot be written"]),
    "no viewer to stream to": (
        ["run", *SMALL, "--out", "r", "--live", "--viewer", "rerun+http://127.0.0.1:1/proxy"],
        ["rerun+http://127.0.0.1:1/proxy", "rerun --bind"],
    ),
    "nothing to play": (["play", "."], ["no recording"]),
    "a missing model file": (["evaluate", *SMALL, "--model", "no.safetensors"], ["no.safetensors"]),
    "a model file of zeros": (
        ["run", *SMALL, "--model", "odd.safetensors", "--out", "r"],
        ["odd.safetensors", "tussock train"],
    ),
    "hemifields of nothing": (["evaluate", *SMALL, "--model", "hemifields-chian"], ["'chian'", "did you mean 'chain'"]),
    "hemifields of one side": (
        ["evaluate", *SMALL, "--model", "hemifields-chain", "--side", "left"],
        ["nothing to the right of straight ahead"],
    ),
    "an opponent of nothing": (["evaluate", *SMALL, "--model", "opponent-oracle"], ["'oracle'"]),
    "an unknown suffix of a model": (["train", *SMALL, "--out", "m.pt"], ["m.pt", ".safetensors"]),
    "a model in a missing folder": (["train", *SMALL, "--out", "no/m.safetensors"], ["no", "folder"]),
    "an unknown model to compare": (["compare", *SMALL, "--models", "rbm,oracle"], ["'oracle'"]),
    "no model to compare": (["compare", *SMALL, "--models", ""], ["''"]),
    "a parameter out of range": (["compare", *SMALL, "--models", "infomax units=0"], ["units", "0"]),
    "an unknown device": (["evaluate", *SMALL, "--device", "abacus"], ["'abacus'"]),
    "a goal outside": (["route", "--world", "tiny", "--goal", "99,1", "--out", "r.csv"], ["99", "goal"]),
    "a goal without numbers": (["route", "--world", "tiny", "--goal", "home", "--out", "r.csv"], ["'home'", "X,Y"]),
    "a route as .bin": (["route", "--world", "tiny", "--out", "r.bin"], ["r.bin", ".csv"]),
    "a view as .jpg": (["view", "--world", "tiny", "--at", "1,1,0", "--out", "v.jpg"], ["v.jpg", ".png"]),
    "a view in a missing folder": (["view", "--world", "tiny", "--at", "1,1,0", "--out", "no/v.png"], ["no", "folder"]),
}


@pytest.fixture(scope="module")
def bad_files(tmp_path_factory) -> Path:
    """A folder with the files that the commands of BAD name."""
    folder = tmp_path_factory.mktemp("bad")
    (folder / "odd.safetensors").write_bytes(b"\0" * 100)
    (folder / "odd.bin").write_bytes(b"\0" * 100)
    (folder / "nan.csv").write_text("x_m,y_m,heading_deg\n1,1,0\nnan,1,0\n2,2,0\n")
    (folder / "in").mkdir()
    (folder / "in/route.csv").write_text("x_m,y_m,heading_deg\n1,1,0\n2,2,0\n")
    (folder / "one.csv").write_text("x_m,y_m,heading_deg\n1,1,0\n")
    (folder / "far.csv").write_text("x_m,y_m,heading_deg\n1,1,0\n100,1,0\n")
    write_world(World.generate("tiny", 0), folder / "cut.glb")
    (folder / "cut.glb").write_bytes((folder / "cut.glb").read_bytes()[:2000])
    return folder


@pytest.mark.parametrize("what", BAD)
def test_bad_input_is_one_line_exit_2_and_leaves_nothing(capfd, tmp_path, monkeypatch, bad_files, what):
    arguments, words = BAD[what]
    monkeypatch.chdir(shutil.copytree(bad_files, tmp_path / "bad"))
    before = files(tmp_path)
    code, out, err = tussock(capfd, *arguments)
    assert code == 2
    assert out == ""
    lines = [line for line in err.splitlines() if line != "renderer: cpu"]
    assert len(lines) == 1, err
    assert lines[0].startswith("tussock: ")
    assert all(word in lines[0] for word in words), lines
    assert files(tmp_path) == before


WALK, IMPORTED = ["run", "--world", "tiny"], ["database", "import", "."]
WRONG_VALUES = {  # how the message begins, and the flags
    "--headings is 'foo'; give one of auto, ccw": [*WALK, "--headings", "foo"],
    "--top-deg is 100; give a number from -90 to 90 (degrees)": [*WALK, "--top-deg", "100"],
    "--bottom-deg is 70 and top is 60 degrees": [*WALK, "--bottom-deg", "70"],
    "--eye-height-m is inf; give": [*WALK, "--eye-height-m", "inf"],
    "--size: width is 2; give": [*WALK, "--size", "2x2"],
    "720 x 150 pixels of 64 x 64 rays are more": [*WALK, "--samples", "64"],
    "--samples is 0; give a whole number from 1 to 64\n": [*WALK, "--samples", "0"],
    "--step-m is -1.0; give": [*WALK, "--step-m", "-1"],
    "--offset-m is nan; give": [*WALK, "--offset-m", "nan"],
    "--arrive-m is 0.0; give": [*WALK, "--arrive-m", "0"],
    "--lost-m is 0.0; give": [*WALK, "--lost-m", "0"],
    "--waypoint-m is 0.0; give": [*WALK, "--waypoint-m", "0"],
    "--heading-noise-deg is -1; give a number from 0 (degrees)": [*WALK, "--heading-noise-deg", "-1"],
    "--scan-deg is 900; give a number over 0 to 360 (degrees)": [*WALK, "--scan-deg", "900"],
    "Scan: width is 9 rad": [*WALK, "--navigator", "scan width=9"],
    "--every is 0; give": [*WALK, "--every", "0"],
    "--unit is 'foo'; give one of auto, mm": [*WALK, "--unit", "foo"],
    "--max-slope-deg is 0; give a number from 1 to 89 (degrees)": ["route", "--max-slope-deg", "0"],
    "--kind is 'foo'; give one of route, grid\n": [*IMPORTED, "--kind", "foo"],
    "--format is 'gif'; give one of png, jpg": [*IMPORTED, "--format", "gif"],
    "--inner-px is -1.0; give": [*IMPORTED, "--inner-px", "-1"],
    "--lens is 'foo'; give": ["unwrap", "a.png", "--lens", "foo"],
}


@pytest.mark.parametrize("begin", WRONG_VALUES)
def test_an_invalid_value_is_reported_with_the_flag_that_gave_it(capfd, tmp_path, begin):
    code, _, err = tussock(capfd, *WRONG_VALUES[begin], "--out", tmp_path / "out.csv")
    assert code == 2
    assert err.startswith(f"tussock: {begin}"), err


def test_wrong_flags_exit_with_2(capfd):
    assert tussock(capfd, "run", "--no-such-flag")[0] == 2
    assert tussock(capfd, "fly")[0] == 2
    assert tussock(capfd, "world")[0] == 2  # --out is missing


def test_a_renderer_without_its_library_is_an_error_that_names_the_package():
    # In its own process, in which the loader finds neither EGL nor OSMesa.
    script = (
        "import ctypes.util, ctypes, sys\n"
        "real = ctypes.CDLL\n"
        "def missing(name, *a, **k):\n"
        "    if name and ('EGL' in str(name) or 'OSMesa' in str(name)): raise OSError('cannot open shared object file')\n"
        "    return real(name, *a, **k)\n"
        "ctypes.CDLL = missing\n"
        "ctypes.util.find_library = lambda name: None\n"
        "from tussock.navigation.cli.main import main\n"
        "for backend in ('egl', 'osmesa'):\n"
        "    try:\n"
        "        main(['view', '--world', 'tiny', '--at', '1,1,0', '--renderer', backend])\n"
        "    except SystemExit as stop:\n"
        "        assert stop.code == 2\n"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True)
    assert (done.returncode, done.stdout) == (0, ""), done.stderr
    egl, osmesa = done.stderr.splitlines()
    assert "libegl1" in egl
    assert "libosmesa6" in osmesa


# Interrupted commands


def start(*arguments, cwd: Path) -> Process:
    """A command that goes on in a process of its own."""
    command = [TUSSOCK, *map(str, arguments)]
    return Process(command, cwd=cwd, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


LONG = ["run", "--world", "tiny", "--seed", "2", "--size", "720x150", "--resize", "1"]


@pytest.mark.parametrize(
    "command", ["run", "world", "play", "database grid", "replicate azevedo2025", "replicate thesis"]
)
def test_help_names_kinds_of_values_as_people_do(capfd, command):
    _, text, _ = tussock(capfd, *command.split(), "--help")
    assert "--out" in text or "--web" in text
    assert "None}|" not in text


def test_names_that_are_nearly_right_are_suggested(capfd):
    for flag, wrong, right in (
        ("model", "perfectmemory", "perfect-memory"),
        ("world", "medow", "meadow"),
        ("navigator", "laterl", "lateral"),
    ):
        code, _, err = tussock(capfd, "run", f"--{flag}", wrong)
        assert code == 2
        assert f"did you mean {right!r}?" in err.splitlines()[-1]


def test_the_models_are_listed_without_torch():
    script = "import sys; from tussock.navigation.cli.main import main; main(['models', '--json']); assert 'torch' not in sys.modules"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    models = json.loads(done.stdout)["models"]
    assert {name for name in MODELS.names if ":" not in name} <= set(models)  # other tests found some by their location
    for name in MODELS.builtin:
        cls = MODELS.find(name)
        assert models[name]["paper"] == cls.paper
        assert (cls.__doc__ or "").startswith(models[name]["what"][:20])


IGNORED = """
import os, signal, sys, time
from tussock.navigation.cli.interruption import check_interrupted, end_on_signals

class Closed:
    def __del__(self):  # Python prints what is raised here, and goes on
        os.kill(os.getpid(), int(sys.argv[1]))
        time.sleep(1)

end_on_signals()
closed = Closed()
del closed
print("went on")
check_interrupted()
"""


@pytest.mark.parametrize(("end", "code"), [(signal.SIGINT, -signal.SIGINT), (signal.SIGTERM, 143)])
def test_an_interruption_that_a_library_ignores_still_ends_the_command(end, code):
    done = subprocess.run([sys.executable, "-c", IGNORED, str(int(end))], capture_output=True, text=True)
    assert (done.returncode, done.stdout) == (code, "went on\n"), done.stderr


@pytest.mark.slow
def test_ctrl_c_while_learning_leaves_the_earlier_run(capfd, tmp_path):
    tussock(capfd, *RUN, "--out", tmp_path / "run")
    before = contents(tmp_path / "run")
    with start(*LONG, "--spacing-m", "0.001", "--out", "run", "--overwrite", cwd=tmp_path) as running:
        assert running.stderr is not None
        assert running.stderr.readline() == "renderer: cpu\n"  # it is learning
        running.send_signal(signal.SIGINT)
        _, err = running.communicate(timeout=120)
    assert running.returncode == 130
    assert err.splitlines()[-1] == "tussock: interrupted"
    assert contents(tmp_path / "run") == before


@pytest.mark.slow
@pytest.mark.parametrize(("end", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_an_interrupted_walk_leaves_its_recording_and_trajectory(tmp_path, end, code):
    with start(*LONG, "--step-m", "0.001", "--out", "run", cwd=tmp_path) as running:
        recording, sizes = tmp_path / "run" / "recording.rrd", set()
        while len(sizes) < 6:  # step after step was added
            assert running.poll() is None
            time.sleep(0.05)
            sizes |= {recording.stat().st_size} if recording.exists() else set()
        running.send_signal(end)
        running.communicate()
    assert running.returncode == code
    assert files(tmp_path / "run") == {"recording.rrd", "trajectory.csv", "UNFINISHED.txt"}
    assert len((tmp_path / "run" / "trajectory.csv").read_text().splitlines()) > 2


@pytest.mark.slow
def test_of_two_runs_into_one_folder_at_once_one_is_refused(tmp_path):
    both = [start(*RUN, "--out", "run", cwd=tmp_path) for _ in range(2)]
    errors = [running.communicate()[1] for running in both]
    assert sorted(running.returncode for running in both) == [0, 2]
    assert "already holds a run" in "".join(errors)


def test_each_world_is_listed_with_what_it_is(capfd):
    worlds = printed(capfd, "world", "--list")["worlds"]
    assert set(DESCRIPTIONS) == set(WORLDS.builtin) <= set(worlds)
    assert f"({', '.join(WORLDS.builtin)})" in WORLD
    assert tussock(capfd, "world")[0] == 2
