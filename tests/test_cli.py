"""The command line as a contract: names, flags, keys, exit codes, and what it leaves behind."""

import json
import os
import re
import signal
import subprocess
import sys
import time
import tomllib
from pathlib import Path

import cv2
import numpy as np
import pytest

from tussock.navigation.cli.main import main
from tussock.navigation.models import MODELS
from tussock.navigation.models.files import load_model
from tussock.render.eye import Eye
from tussock.render.renderer import open_renderer
from tussock.world.files import read_world
from tussock.world.route_files import read_route
from tussock.world.scene import World

TUSSOCK = str(Path(sys.executable).with_name("tussock"))
SMALL = ["--world", "tiny", "--size", "180x40", "--seed", "2"]


def tussock(capfd, *arguments) -> tuple[int, str, str]:
    """Exit code, standard output and standard error of a command, run in this process."""
    capfd.readouterr()
    code = 0
    try:
        main([str(argument) for argument in arguments])
    except SystemExit as stop:
        code = int(stop.code or 0)
    return code, *capfd.readouterr()


def files(folder: Path) -> set[str]:
    return {str(path.relative_to(folder)) for path in folder.rglob("*")}


def test_help_names_every_command(capfd):
    code, out, _ = tussock(capfd, "--help")
    assert code == 0
    names = (
        "world",
        "view",
        "route",
        "evaluate",
        "train",
        "compare",
        "models",
        "run",
        "play",
        "database",
        "sweep",
        "report",
        "benchmark",
        "replicate",
        "study",
    )
    assert all(name in out for name in names)
    for name in names:
        assert tussock(capfd, name, "--help")[0] == 0


def test_version_is_that_of_the_package(capfd):
    expected = tomllib.loads(Path(__file__).parents[1].joinpath("pyproject.toml").read_text())["project"]["version"]
    assert tussock(capfd, "--version")[:2] == (0, f"tussock {expected}\n")


def test_help_loads_nothing_heavy():
    script = (
        "import sys; from tussock.navigation.cli.main import main\n"
        "try: main(['run', '--help'])\n"
        "except SystemExit: print(sorted({'torch', 'numba', 'trimesh', 'rerun', 'matplotlib', 'cv2', 'scipy'} & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True)
    assert done.stdout.splitlines()[-1] == "[]"


@pytest.mark.parametrize("suffix", ["glb", "ply"])
def test_world_writes_what_generate_makes(capfd, tmp_path, suffix):
    out = tmp_path / f"w.{suffix}"
    code, printed, _ = tussock(
        capfd, "world", "--preset", "tiny", "--seed", 7, "--out", out, "--picture", tmp_path / "w.png", "--json"
    )
    assert code == 0
    assert json.loads(printed)["triangles"] == len(World.generate("tiny", 7).triangles)
    assert np.array_equal(read_world(out).triangles, World.generate("tiny", 7).triangles)
    assert cv2.imread(str(tmp_path / "w.png")) is not None


def test_view_writes_what_the_renderer_draws(capfd, tmp_path):
    code, printed, _ = tussock(
        capfd, "view", "--world", "tiny", "--seed", 3, "--at", "1,2,90", "--out", tmp_path / "v.png", "--json"
    )
    assert code == 0
    assert json.loads(printed) == {"view": str(tmp_path / "v.png"), "width": 720, "height": 150, "renderer": "cpu"}
    with open_renderer(World.generate("tiny", 3), Eye(), "cpu") as renderer:
        view = renderer.render([(1.0, 2.0, np.pi / 2)])[0]
    assert np.array_equal(cv2.imread(str(tmp_path / "v.png"), cv2.IMREAD_UNCHANGED)[..., ::-1], view[..., :3])
    tussock(capfd, "view", "--world", "tiny", "--seed", 3, "--at", "1,2,90", "--out", tmp_path / "a.png", "--alpha")
    assert np.array_equal(cv2.imread(str(tmp_path / "a.png"), cv2.IMREAD_UNCHANGED)[..., 3], view[..., 3])


def test_evaluate_prints_one_object(capfd):
    code, out, err = tussock(
        capfd, "evaluate", *SMALL, "--model", "perfect-memory", "--encoding", "grey", "--resize", 2, "--every", 2, "--spacing-m", 0.04,
        "--learning-walk-m", 0, "--grid-m", 0.2, "--within-m", 0.2, "--scan-deg", 360, "--json",
    )  # fmt: skip
    assert code == 0
    result = json.loads(out)
    assert {"n_views", "n_positions", "median_error_deg", "mean_error_deg", "share_over_45", "seconds"} <= set(result)
    assert result["encoding"] == "grey | resize 2"
    assert 0 <= result["median_error_deg"] <= 180
    assert "renderer: cpu" in err


RUN = ["run", *SMALL, "--step-m", 0.05, "--offset-m", 0.1, "--heading-noise-deg", 5]


def test_run_arrives_and_leaves_a_whole_folder(capfd, tmp_path):
    out = tmp_path / "run"
    code, printed, _ = tussock(capfd, *RUN, "--out", out, "--json")
    assert code == 0
    result = json.loads(printed)
    assert set(result) == {
        "arrived", "reason", "steps", "mean_deviation_m", "max_deviation_m", "mean_error_deg", "resets", "cause", "poor_steps", "causes",
        "seconds", "steps_per_second", "recording",
    }  # fmt: skip
    assert result["arrived"]
    assert result["reason"] == "arrived"
    assert Path(result["recording"]).is_file()
    assert files(out) == {"recording.rrd", "trajectory.csv", "summary.json", "overview.png", "route.csv"}
    summary = json.loads((out / "summary.json").read_text())
    assert summary["steps"] == result["steps"] == len((out / "trajectory.csv").read_text().splitlines()) - 2
    assert summary["settings"]["seed"] == 2
    assert cv2.imread(str(out / "overview.png")) is not None
    # A second run is refused and changes nothing; --overwrite replaces it, and the route it left can be walked again.
    before = {path: path.stat().st_mtime_ns for path in out.iterdir()}
    code, printed, err = tussock(capfd, *RUN, "--out", out, "--json")
    assert (code, printed) == (2, "")
    assert "already holds a run" in err
    assert before == {path: path.stat().st_mtime_ns for path in out.iterdir()}
    code, again, _ = tussock(capfd, *RUN, "--out", out, "--overwrite", "--json", "--on-lost", "reset")
    assert code == 0
    assert json.loads(again)["steps"] == result["steps"]


def test_two_processes_with_one_seed_write_the_same_bytes(tmp_path):
    for name in ("a", "b"):
        folder = tmp_path / name
        folder.mkdir()
        subprocess.run(
            [TUSSOCK, "world", "--preset", "tiny", "--seed", "5", "--out", "w.glb"],
            cwd=folder,
            check=True,
            capture_output=True,
        )
        run = [TUSSOCK, *map(str, RUN), "--world", "w.glb", "--out", "run", "--json"]
        # The number of threads is another machine's: nothing may depend on it.
        threads = os.environ | ({"OMP_NUM_THREADS": "1"} if name == "b" else {})
        done = subprocess.run(run, cwd=folder, check=True, capture_output=True, text=True, env=threads)
        assert json.loads(done.stdout)["reason"]  # one object and nothing else
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
    _, in_place, _ = tussock(capfd, "evaluate", *SMALL, "--model", "infomax", "--json")
    # The size and encoding come from the file.
    _, from_file, _ = tussock(capfd, "evaluate", "--world", "tiny", "--seed", 2, "--model", trained, "--json")
    assert [json.loads(in_place)[key] for key in same] == [json.loads(from_file)[key] for key in same]
    code, _, _ = tussock(
        capfd, "run", "--world", "tiny", "--seed", 2, "--model", trained, "--out", tmp_path / "run", "--max-steps", 3
    )
    assert code == 0
    assert (
        json.loads((tmp_path / "run" / "summary.json").read_text())["settings"]["n_views"]
        == json.loads(in_place)["n_views"]
    )


def test_a_trained_model_goes_on_learning_in_constant_memory(capfd, tmp_path, trained):
    tussock(
        capfd,
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
    )
    go_on = ["train", *SMALL, "--model", trained, "--route", tmp_path / "second.csv", "--learning-walk-m", 0]
    code, printed, _ = tussock(capfd, *go_on, "--out", tmp_path / "both.safetensors", "--json")
    assert code == 0
    result = json.loads(printed)
    assert result["n_views"] > 40
    assert result["model"] == "infomax"
    assert result["memory_bytes"] == load_model(trained).model.memory_bytes
    tussock(capfd, "train", *SMALL, "--model", "rbm", "--out", tmp_path / "rbm.safetensors")
    code, _, err = tussock(
        capfd, "train", *SMALL, "--model", tmp_path / "rbm.safetensors", "--out", tmp_path / "two.safetensors"
    )
    assert code == 2
    assert "rbm learns all its views at once" in err


@pytest.mark.parametrize(
    ("flags", "message"),
    [
        (["--encoding", "grey"], "leave out --encoding"),
        (["--size", "90x20"], "another eye"),
        (["--top-deg", "50"], "another eye"),
    ],
)
def test_a_trained_model_refuses_what_it_did_not_learn_with(capfd, trained, flags, message):
    code, out, err = tussock(capfd, "evaluate", "--world", "tiny", "--seed", 2, "--model", trained, *flags)
    assert (code, out) == (2, "")
    assert message in err
    assert len(err.splitlines()) == 1


def test_compare_says_what_evaluate_and_run_say(capfd, tmp_path):
    names = "perfect-memory,opponent-mushroom-body"
    code, printed, _ = tussock(capfd, "compare", *SMALL, "--models", names, "--json")
    assert code == 0
    rows = json.loads(printed)["models"]
    assert list(rows) == names.split(",")
    for name, row in rows.items():
        assert set(row) == {
            "median_error_deg", "mean_error_deg", "share_over_45", "arrived", "memory_bytes", "fit_seconds", "scan_ms",
        }  # fmt: skip
        evaluated = json.loads(tussock(capfd, "evaluate", *SMALL, "--model", name, "--json")[1])
        assert all(row[key] == evaluated[key] for key in ("median_error_deg", "mean_error_deg", "share_over_45"))
        walked = tussock(capfd, "run", *SMALL, "--model", name, "--offset-m", 0.1, "--out", tmp_path / name, "--json")[
            1
        ]
        assert row["arrived"] == json.loads(walked)["arrived"]
    code, table, _ = tussock(capfd, "compare", *SMALL, "--models", "perfect-memory")
    assert code == 0
    assert re.search(r"perfect-memory .*(yes|no)", table)


def test_models_lists_each_with_a_line_and_its_paper(capfd):
    code, printed, _ = tussock(capfd, "models", "--json")
    assert code == 0
    models = json.loads(printed)["models"]
    assert [*MODELS.builtin, "opponent-..."] == list(models)
    assert all(len(row["what"]) > 20 and row["paper"] for row in models.values())
    assert "Ardin" in tussock(capfd, "models")[1]


def test_routes_of_several_seeds_lead_to_one_goal(capfd, tmp_path):
    ends = []
    for seed in (1, 2):
        out, picture = tmp_path / f"{seed}.csv", tmp_path / f"{seed}.png"
        code, printed, _ = tussock(
            capfd, "route", "--seed", 5, "--route-seed", seed, "--goal", "4.9,4.9", "--length-m", 4, "--out", out,
            "--picture", picture, "--json",
        )  # fmt: skip
        assert code == 0
        assert read_route(out).goal[:2] == pytest.approx(json.loads(printed)["goal"], abs=1e-6)
        assert cv2.imread(str(picture)) is not None
        ends.append(read_route(out))
    assert all(np.hypot(*(np.array(route.goal[:2]) - 4.9)) < 0.1 for route in ends)
    assert np.hypot(*(ends[0].xy[0] - ends[1].xy[0])) > 0.5


BAD = {
    "a missing world": (["view", "--world", "nowhere.glb"], r"there is no world file nowhere\.glb"),
    "a truncated world": (["view", "--world", "cut.glb"], r"cut\.glb cannot be read"),
    "an odd .bin": (["view", "--world", "odd.bin"], r"odd\.bin has 100 bytes; .* multiple of 96"),
    "an unknown preset": (["view", "--world", "desert"], "tussock-field"),
    "an unknown preset to grow": (["world", "--preset", "desert", "--out", "w.glb"], "known: tussock-field"),
    "a negative seed": (["world", "--preset", "tiny", "--seed", "-1", "--out", "w.glb"], "seed"),
    "an odd ending": (["world", "--preset", "tiny", "--out", "w.xyz"], r"\.glb or \.ply"),
    "NaN in a route": (["evaluate", *SMALL, "--route", "nan.csv"], r"nan\.csv, line 3: x_m is 'nan'"),
    "a route of one point": (["run", *SMALL, "--route", "one.csv", "--out", "r"], "at least 2"),
    "a route elsewhere": (["run", *SMALL, "--route", "far.csv", "--out", "r"], "leaves the world"),
    "a pose outside": (["view", "--world", "tiny", "--at", "99,0,0"], "outside the world"),
    "a pose that is none": (["view", "--world", "tiny", "--at", "1,2"], "X,Y,HEADING_DEG"),
    "a NaN pose": (["view", "--world", "tiny", "--at", "nan,2,0"], "outside the world"),
    "size 0": (["view", "--world", "tiny", "--size", "0x0"], "width is 0"),
    "a size that is none": (["run", *SMALL, "--size", "big", "--out", "r"], "columns x rows"),
    "an unknown model": (
        ["run", *SMALL, "--model", "oracle", "--out", "r"],
        "visual-compass, perfect-memory, chain, mlp",
    ),
    "an unknown encoding": (["run", *SMALL, "--encoding", "smell", "--out", "r"], "grey, sky, edges"),
    "an unknown renderer": (["run", *SMALL, "--renderer", "vulkan", "--out", "r"], "auto, cpu, egl, osmesa"),
    "a scan of nothing": (["evaluate", *SMALL, "--scan-deg", "0"], "scan"),
    "no spacing": (["evaluate", *SMALL, "--spacing-m", "0"], "spacing"),
    "every 0": (["evaluate", *SMALL, "--every", "0"], "every 0"),
    "every 0 in a run": (["run", *SMALL, "--every", "0", "--out", "r"], "every 0"),
    "a learning walk of -1 m": (["run", *SMALL, "--learning-walk-m", "-1", "--out", "r"], "learning walk of -1"),
    "views that show nothing": (
        ["run", *SMALL, "--encoding", "sky", "--top-deg", "-5", "--out", "r"],
        "training views shows anything",
    ),
    "a scan about nowhere": (["run", *SMALL, "--scan-about-deg", "nan", "--out", "r"], "scan about nan"),
    "within nowhere": (["evaluate", *SMALL, "--within-m", "nan"], "within nan m"),
    "too many rays": (["view", "--world", "tiny", "--size", "32768x16384", "--samples", "64"], "give fewer"),
    "too many views": (["evaluate", *SMALL, "--spacing-m", "1e-9"], "over a million"),
    "an input that would be replaced": (
        ["run", *SMALL, "--route", "in/route.csv", "--out", "in", "--overwrite"],
        "would be replaced",
    ),
    "a start outside": (["run", *SMALL, "--offset-m", "50", "--out", "r"], "outside the world"),
    "neither stop nor reset": (["run", *SMALL, "--on-lost", "cry", "--out", "r"], "stop or reset"),
    "a file for a folder": (["run", *SMALL, "--out", "one.csv"], r"one\.csv is a file"),
    "a folder under a file": (["run", *SMALL, "--out", "one.csv/run"], "cannot be written"),
    "no viewer to stream to": (
        ["run", *SMALL, "--out", "r", "--live", "--viewer", "rerun+http://127.0.0.1:1/proxy"],
        "no rerun viewer",
    ),
    "nothing to play": (["play", "."], "no recording"),
    "a missing model file": (["evaluate", *SMALL, "--model", "no.safetensors"], r"no model file no\.safetensors"),
    "a model file that is none": (
        ["run", *SMALL, "--model", "odd.safetensors", "--out", "r"],
        r"odd\.safetensors is no model",
    ),
    "an opponent of nothing": (["evaluate", *SMALL, "--model", "opponent-oracle"], "unknown model 'oracle'"),
    "an odd model ending": (["train", *SMALL, "--out", "m.pt"], r"\.safetensors"),
    "a model into nowhere": (["train", *SMALL, "--out", "no/m.safetensors"], "there is no folder no"),
    "an unknown model to compare": (["compare", *SMALL, "--models", "rbm,oracle"], "unknown model 'oracle'"),
    "no model to compare": (["compare", *SMALL, "--models", ""], "unknown model ''"),
    "a device that is none": (["evaluate", *SMALL, "--device", "abacus"], "device 'abacus' cannot be used"),
    "a goal outside": (["route", "--world", "tiny", "--goal", "99,1", "--out", "r.csv"], "a goal at"),
    "a goal that is none": (["route", "--world", "tiny", "--goal", "home", "--out", "r.csv"], "give X,Y"),
    "a route as .bin": (["route", "--world", "tiny", "--out", "r.bin"], r"\.csv"),
    "a view as .jpg": (["view", "--world", "tiny", "--at", "1,1,0", "--out", "v.jpg"], r"\.png"),
    "a view into nowhere": (["view", "--world", "tiny", "--at", "1,1,0", "--out", "no/v.png"], "there is no folder no"),
}


@pytest.mark.parametrize("what", BAD)
def test_bad_input_is_one_line_exit_2_and_leaves_nothing(capfd, tmp_path, monkeypatch, what):
    arguments, message = BAD[what]
    monkeypatch.chdir(tmp_path)
    Path("odd.safetensors").write_bytes(b"\0" * 100)
    Path("odd.bin").write_bytes(b"\0" * 100)
    Path("nan.csv").write_text("x_m,y_m,heading_deg\n1,1,0\nnan,1,0\n2,2,0\n")
    Path("in").mkdir()
    Path("in/route.csv").write_text("x_m,y_m,heading_deg\n1,1,0\n2,2,0\n")
    Path("one.csv").write_text("x_m,y_m,heading_deg\n1,1,0\n")
    Path("far.csv").write_text("x_m,y_m,heading_deg\n1,1,0\n100,1,0\n")
    tussock(capfd, "world", "--preset", "tiny", "--out", "cut.glb")
    Path("cut.glb").write_bytes(Path("cut.glb").read_bytes()[:2000])
    before = files(tmp_path)
    code, out, err = tussock(capfd, *arguments)
    assert code == 2
    assert out == ""
    lines = [line for line in err.splitlines() if line != "renderer: cpu"]
    assert len(lines) == 1, err
    assert re.search(message, lines[0]), lines
    assert files(tmp_path) == before


def start(*arguments, cwd: Path) -> subprocess.Popen:
    """A command in its own process."""
    command = [TUSSOCK, *map(str, arguments)]
    return subprocess.Popen(command, cwd=cwd, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


LONG = ["run", "--world", "tiny", "--seed", "2", "--size", "720x150", "--resize", "1"]


def test_ctrl_c_while_learning_leaves_the_earlier_run(capfd, tmp_path):
    tussock(capfd, *RUN, "--out", tmp_path / "run")
    before = {path.name: path.read_bytes() for path in (tmp_path / "run").iterdir()}
    with start(*LONG, "--spacing-m", "0.001", "--out", "run", "--overwrite", cwd=tmp_path) as process:
        assert process.stderr is not None
        assert process.stderr.readline() == "renderer: cpu\n"  # it is learning
        process.send_signal(signal.SIGINT)
        _, err = process.communicate()
    assert process.returncode == 130
    assert err.splitlines()[-1] == "tussock: interrupted"
    assert before == {path.name: path.read_bytes() for path in (tmp_path / "run").iterdir()}


@pytest.mark.parametrize(("end", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_an_interrupted_walk_leaves_its_recording_and_trajectory(tmp_path, end, code):
    with start(*LONG, "--step-m", "0.001", "--out", "run", cwd=tmp_path) as process:
        recording, sizes = tmp_path / "run" / "recording.rrd", set()
        while len(sizes) < 6:  # it has grown by step after step
            assert process.poll() is None
            time.sleep(0.05)
            sizes |= {recording.stat().st_size} if recording.exists() else set()
        process.send_signal(end)
        process.communicate()
    assert process.returncode == code
    assert files(tmp_path / "run") == {"recording.rrd", "trajectory.csv", "UNFINISHED.txt"}
    assert len((tmp_path / "run" / "trajectory.csv").read_text().splitlines()) > 2


def test_two_runs_into_one_folder_at_once_are_one_run(tmp_path):
    both = [start(*RUN, "--out", "run", cwd=tmp_path) for _ in range(2)]
    errors = [process.communicate()[1] for process in both]
    assert sorted(process.returncode for process in both) == [0, 2]
    assert "already holds a run" in "".join(errors)


def test_a_renderer_that_is_not_there_is_an_error_and_not_another_one():
    # Without its libraries in sight: the loader finds no EGL in an empty folder of names that are not libraries.
    script = (
        "import ctypes.util, ctypes, sys\n"
        "real = ctypes.CDLL\n"
        "def missing(name, *a, **k):\n"
        "    if name and ('EGL' in str(name) or 'OSMesa' in str(name)): raise OSError('cannot open shared object file')\n"
        "    return real(name, *a, **k)\n"
        "ctypes.CDLL = missing\n"
        "ctypes.util.find_library = lambda name: None\n"
        "from tussock.navigation.cli.main import main\n"
        "main(['view', '--world', 'tiny', '--at', '1,1,0', '--renderer', sys.argv[1]])"
    )
    for backend, package in (("egl", "libegl1"), ("osmesa", "libosmesa6")):
        done = subprocess.run([sys.executable, "-c", script, backend], capture_output=True, text=True)
        assert done.returncode == 2, done.stderr
        assert done.stdout == ""
        assert package in done.stderr
        assert len(done.stderr.splitlines()) == 1


def test_wrong_flags_exit_with_2(capfd):
    assert tussock(capfd, "run", "--no-such-flag")[0] == 2
    assert tussock(capfd, "fly")[0] == 2
    assert tussock(capfd, "world")[0] == 2  # --out is missing
