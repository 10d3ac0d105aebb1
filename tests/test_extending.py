"""Classes from outside: the package that docs/extending.md shows is installed, and its commands and its script are run."""

import json
import os
import re
import shlex
import shutil
import subprocess
import sys
import venv
from pathlib import Path

import pandas as pd
import pytest
import rerun_cli

PAGE_PATH = Path(__file__).parents[1] / "docs" / "extending.md"
PAGE = PAGE_PATH.read_text()
TUSSOCK = str(Path(sys.executable).with_name("tussock"))
SMALL = ["--world", "tiny", "--size", "60x12", "--route-length-m", "1", "--spacing-m", "0.1"]


def blocks(language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.+?)```", PAGE, flags=re.DOTALL)


@pytest.fixture(scope="module")
def source(tmp_path_factory) -> Path:
    """The package's files, not installed."""
    folder = tmp_path_factory.mktemp("antlab")
    (folder / "antlab").mkdir()
    (folder / "antlab" / "__init__.py").touch()
    for text in blocks("toml") + blocks("python"):
        if text.startswith("# "):
            (folder / text.partition("\n")[0].removeprefix("# ")).write_text(text.partition("\n")[2])
    return folder


@pytest.fixture(scope="module")
def installed(source, tmp_path_factory) -> dict[str, str]:
    """An environment in which the package is installed, with its entry points."""
    target, copy = tmp_path_factory.mktemp("installed"), tmp_path_factory.mktemp("built") / "antlab"
    shutil.copytree(source, copy)  # building leaves entry points there
    pip = [sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--no-build-isolation", "--target", target]
    subprocess.run([*pip, copy], check=True, capture_output=True, text=True)
    return environment(target)


def environment(*folders: Path) -> dict[str, str]:
    paths = [*map(str, folders), os.environ.get("PYTHONPATH", "")]
    return os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, paths))}


def run(arguments, env, folder, code: int = 0):
    done = subprocess.run([TUSSOCK, *map(str, arguments)], env=env, cwd=folder, capture_output=True, text=True)
    assert done.returncode == code, done.stderr
    return done


def run_json(arguments, env, folder):
    return json.loads(run([*arguments, "--json"], env, folder).stdout)


@pytest.mark.parametrize(
    "text", [text for text in blocks("python") if text.startswith("# ")], ids=lambda text: text.split()[1]
)
def test_each_example_has_at_most_20_lines(text):
    lines = [line for line in text.splitlines()[1:] if line.strip()]
    assert len(lines) <= 20


@pytest.mark.slow
def test_commands_of_the_page_run_with_the_installed_package(installed, tmp_path):
    (block,) = blocks("bash")
    commands = [shlex.split(line)[1:] for line in block.splitlines() if line.startswith("tussock")]
    assert {command[0] for command in commands} == {"compare", "run", "train", "benchmark", "replicate"}
    for command in commands:
        if command[0] != "benchmark":  # see test_the_test_bed_takes_a_model_from_outside
            run(command, installed, tmp_path)


@pytest.mark.slow
def test_the_script_of_the_page_runs(source, tmp_path):
    (script,) = [text for text in blocks("python") if not text.startswith("# ")]
    done = subprocess.run(
        [sys.executable, "-c", script], env=environment(source), cwd=tmp_path, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    assert "arrived" in done.stdout


def test_names_of_installed_classes_are_listed(installed, tmp_path):
    assert "nearest" in run_json(["models"], installed, tmp_path)["models"]
    assert "Is the mean difference as good a guide" in run(["replicate", "--help"], installed, tmp_path).stdout


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "workers"), [("nearest", 1), pytest.param("antlab.models:Nearest", 2, marks=pytest.mark.slow)]
)
def test_the_workers_of_a_sweep_take_classes_from_outside(name, workers, installed, tmp_path):
    sweep = tmp_path / "sweep.toml"
    sweep.write_text(
        '[fixed]\nsize = "60x12"\nroute-length-m = 1\nspacing-m = 0.1\nencoding = "grey | threshold 0.4"\n'
        f'[axes]\nmodel = ["{name} power=2", "perfect-memory"]\nnavigator = ["scan", "careful"]\nworld = ["tiny", "posts number=20"]\n'
    )
    result = run_json(["sweep", sweep, "--out", "out", "--workers", workers], installed, tmp_path)
    assert (result["runs"], result["could_not_run"]) == (8, 0)
    table = pd.read_parquet(tmp_path / "out" / "runs.parquet")
    assert set(table["model"]) == {f"{name} power=2.0", "perfect-memory"}
    command = table[table["model"] != "perfect-memory"].iloc[0]["command"]
    assert name in command
    repeated = run_json([*shlex.split(command)[1:], "--out", "again"], installed, tmp_path)
    assert repeated["steps"] == table[table["model"] != "perfect-memory"].iloc[0]["steps"]


@pytest.mark.slow
def test_a_wheel_works_in_an_environment_of_its_own_and_takes_plug_ins(source, tmp_path):
    """As `make dist` builds it, of the source archive; the libraries are those that are installed here."""
    copy, plug_in, room = tmp_path / "copy", tmp_path / "antlab", tmp_path / "elsewhere"
    ignored = shutil.ignore_patterns(".*", "build", "dist", "*.egg-info", "__pycache__")
    shutil.copytree(PAGE_PATH.parents[1], copy, ignore=ignored)
    shutil.copytree(source, plug_in)
    room.mkdir()
    for package in (copy, plug_in):
        build = [sys.executable, "-m", "build", "--no-isolation", "--outdir", tmp_path / "dist", package]
        subprocess.run(build, check=True, capture_output=True)
    wheels = list((tmp_path / "dist").glob("*.whl"))
    assert {path.name.partition("-")[0] for path in wheels} == {"tussock", "antlab"}
    assert len(list((tmp_path / "dist").glob("tussock-*.tar.gz"))) == 1
    shutil.rmtree(copy)
    venv.create(room / "venv", with_pip=True)
    python = room / "venv" / "bin" / "python"
    site = subprocess.run(
        [python, "-c", "import site; print(site.getsitepackages()[0])"], capture_output=True, text=True
    )
    libraries = Path(rerun_cli.__file__).parents[
        1
    ]  # not in their own folder, so that the clone that is installed there is not found
    Path(site.stdout.strip(), "libraries.pth").write_text(f"{libraries}\n")
    pip = [python, "-m", "pip", "install", "--quiet", "--no-deps", "--ignore-installed"]
    subprocess.run([*pip, *wheels], check=True, capture_output=True)
    for command in (["tussock"], ["python", "-m", "tussock"]):
        words = [
            room / "venv" / "bin" / command[0],
            *command[1:],
            "run",
            *SMALL,
            "--model",
            "nearest",
            "--overwrite",
            "--json",
        ]
        done = subprocess.run(words, cwd=room, capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
        assert json.loads(done.stdout)["steps"] > 0
    where = subprocess.run(
        [python, "-c", "import tussock; print(tussock.__file__)"], cwd=room, capture_output=True, text=True
    )
    assert Path(where.stdout.strip()).is_relative_to(room)


@pytest.mark.slow
def test_a_file_in_the_current_folder_is_enough(source, tmp_path):
    """By its location, in this process and in the workers of a sweep."""
    (tmp_path / "my_models.py").write_text((source / "antlab" / "models.py").read_text())
    row = run_json(["compare", *SMALL, "--models", "my_models:Nearest"], environment(), tmp_path)
    assert row["models"]["my_models:Nearest"]["memory_bytes"] > 0
    (tmp_path / "sweep.toml").write_text(
        '[fixed]\nworld = "tiny"\nsize = "60x12"\nroute-length-m = 1\nspacing-m = 0.1\n'
        '[axes]\nmodel = ["my_models:Nearest"]\nseed = [0, 1]\n'
    )
    result = run_json(["sweep", "sweep.toml", "--out", "out", "--workers", "2"], environment(), tmp_path)
    assert (result["runs"], result["could_not_run"]) == (2, 0)


@pytest.mark.slow
def test_a_class_with_fit_and_scan_alone_is_a_model(tmp_path):
    (tmp_path / "plain.py").write_text(
        "class First:\n"
        "    def fit(self, views):\n        self.first = views[0]\n"
        "    def scan(self, views):\n"
        "        rolled = [(views.roll(k, 2) - self.first).square().mean((1, 2)) for k in range(views.shape[2])]\n"
        "        return -__import__('torch').stack(rolled, 1)\n"
    )
    row = run_json(["compare", *SMALL, "--models", "plain:First"], environment(), tmp_path)["models"]["plain:First"]
    assert row["memory_bytes"] is None  # it does not report it
    run_json(["run", *SMALL, "--model", "plain:First", "--out", "out"], environment(), tmp_path)
    refused = run(
        ["train", *SMALL, "--model", "plain:First", "--out", "a.safetensors"], environment(), tmp_path, code=2
    )
    assert "derive it from tussock.navigation.models.base.Model" in refused.stderr


@pytest.mark.slow
def test_a_model_file_imports_nothing_by_itself(source, installed, tmp_path):
    trained = ["train", *SMALL, "--encoding", "grey | threshold 0.4 | resize 1"]
    named = ["--model", "antlab.models:Nearest", "--use", "antlab.encodings:Threshold"]
    path = environment(source)
    run([*trained, *named, "--out", "outside.safetensors"], installed, tmp_path)
    command = ["run", *SMALL[:2], *SMALL[4:6], "--model", "outside.safetensors", "--out", "out"]
    refused = run(command, path, tmp_path, code=2)  # it could be imported, but is neither installed nor named
    assert len(refused.stderr.splitlines()) == 1
    assert "--use antlab.models:Nearest" in refused.stderr
    run([*command, "--use", "antlab.models:Nearest,antlab.encodings:Threshold"], path, tmp_path)


@pytest.mark.slow
def test_the_test_bed_takes_a_model_from_outside(installed, tmp_path):
    encoding = ["--encoding", "grey | resize 24"]  # few pixels: this model compares all rotations one by one
    run(["benchmark", "--quick", "--model", "nearest", *encoding, "--workers", "2"], installed, tmp_path)
    assert "nearest" in run(["benchmark", "--leaderboard", "benchmark"], installed, tmp_path).stdout
