"""The package as others get it: its public names, next to a user's own files, and installed without its clone."""

import os
import shutil
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import pytest

CLONE = Path(__file__).parents[1]
FOLDERS = ("world", "render", "navigation")
ROOMS = sorted(path.parent.relative_to(CLONE) for room in FOLDERS for path in CLONE.glob(f"{room}/**/__init__.pyi"))


@pytest.mark.parametrize("room", ["", *map(str, ROOMS)])
def test_public_names_are_listed_and_can_be_loaded(room):
    module = import_module(".".join(["tussock", *Path(room).parts]))
    names = (CLONE / room / "__init__.pyi").read_text().split(" as ")[1:]
    assert set(module.__all__) == {name.split()[0] for name in names}
    assert set(module.__all__) <= set(dir(module))
    for name in module.__all__:
        assert getattr(module, name) is not None


def test_importing_tussock_loads_nothing_heavy():
    script = (
        "import sys, tussock; print({'numpy', 'torch', 'numba', 'rerun', 'pandas', 'matplotlib'} & set(sys.modules))"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert done.stdout == "set()\n"


def test_the_help_of_a_command_loads_nothing_heavy():
    script = (
        "import sys\nfrom tussock.navigation.cli.main import main\n"
        "try: main(['run', '--help'])\nexcept SystemExit: pass\n"
        "print({'numpy', 'torch', 'numba', 'rerun', 'pandas', 'matplotlib'} & set(sys.modules))"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert done.stdout.endswith("set()\n")


@pytest.fixture
def folder(tmp_path) -> Path:
    """A folder with a user's own files, named like tussock's."""
    for name in ("world.py", "render/__init__.py", "navigation/__init__.py"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text("raise RuntimeError('this is not tussock')\n")
    return tmp_path


def test_a_users_own_files_of_the_same_names_do_not_matter(folder):
    script = (
        "from tussock import World, Agent, PerfectMemory; print(len(World.generate('tiny', 1).triangles) > 0, Agent)"
    )
    done = subprocess.run([sys.executable, "-c", script], cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    command = [sys.executable, "-m", "tussock", "world", "--preset", "tiny", "--out", "w.glb"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


@pytest.mark.slow
def test_a_wheel_is_complete(folder):
    """It has every module, and the files that a run, a sweep and its report need."""
    copy, target = folder / "clone", folder / "installed"
    shutil.copytree(CLONE, copy, ignore=shutil.ignore_patterns(".*", "build", "*.egg-info", "__pycache__", "installed"))
    pip = [sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--no-build-isolation", "--target", target]
    subprocess.run([*pip, copy], check=True, capture_output=True)
    shutil.rmtree(copy)
    modules = {path.relative_to(CLONE) for room in FOLDERS for path in CLONE.glob(f"{room}/**/*.py")}
    assert modules <= {path.relative_to(target / "tussock") for path in target.glob("tussock/**/*.py")}
    small = "--world tiny --size 60x12 --route-length-m 1 --spacing-m 0.1"
    (folder / "sweep.toml").write_text(
        '[fixed]\nworld = "tiny"\nsize = "60x12"\nroute-length-m = 1\n[axes]\nseed = [0, 1]\n'
    )
    environment = os.environ | {"PYTHONPATH": str(target)}
    for command in (f"run {small} --out run", "sweep sweep.toml --out sweep", "report sweep"):
        done = subprocess.run(
            [sys.executable, "-m", "tussock", *command.split()],
            cwd=folder,
            env=environment,
            capture_output=True,
            text=True,
        )
        assert done.returncode == 0, done.stderr
    script = "import tussock; print(tussock.__file__)"
    done = subprocess.run([sys.executable, "-c", script], cwd=folder, env=environment, capture_output=True, text=True)
    assert Path(done.stdout.strip()).is_relative_to(target)
