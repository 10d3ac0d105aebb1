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


HEAVY = "distributed matplotlib numba numpy pandas pyarrow rerun scipy sklearn torch trimesh"
OF_FIGURES_AND_MODELS = "distributed matplotlib pandas pyarrow rerun sklearn torch"
WITHOUT_FIGURES = "distributed matplotlib pandas pyarrow rerun sklearn trimesh"
TINY = "--world tiny --size 60x12"


WITHOUT_TORCH = """
class Without:
    def find_spec(self, name, path=None, target=None):
        if name == "torch":
            raise ModuleNotFoundError("No module named 'torch'", name="torch")
sys.meta_path.insert(0, Without())
"""


def run_main(arguments: str, folder: Path, before: str = "") -> subprocess.CompletedProcess:
    """Run the command line in a process of its own, which prints last of all what of HEAVY it has loaded."""
    script = (
        f"import sys\n{before}\nfrom tussock.navigation.cli.main import main\n"
        f"try: main({arguments.split()!r})\n"
        f"finally: print(*(name for name in {HEAVY.split()!r} if sys.modules.get(name)), sep=',')"
    )
    return subprocess.run([sys.executable, "-c", script], cwd=folder, capture_output=True, text=True)


def test_importing_tussock_loads_nothing_heavy():
    script = f"import sys, tussock, tussock.navigation; print(set({HEAVY.split()!r}) & set(sys.modules))"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert done.stdout == "set()\n"


@pytest.mark.parametrize(
    ("arguments", "unneeded"),
    [
        ("--help", HEAVY),
        ("run --help", HEAVY),
        pytest.param("sweep --help", HEAVY, marks=pytest.mark.slow),
        pytest.param("world --preset tiny --out w.ply", OF_FIGURES_AND_MODELS, marks=pytest.mark.slow),
        (f"view {TINY}", OF_FIGURES_AND_MODELS),
        pytest.param("route --world tiny --length-m 1", OF_FIGURES_AND_MODELS, marks=pytest.mark.slow),
        pytest.param(
            f"database route {TINY} --route-length-m 1 --spacing-m 0.5 --out d",
            OF_FIGURES_AND_MODELS,
            marks=pytest.mark.slow,
        ),
        (f"evaluate {TINY} --route-length-m 1 --grid-m 0.5", WITHOUT_FIGURES),
        pytest.param(f"train {TINY} --route-length-m 1 --spacing-m 0.2", WITHOUT_FIGURES, marks=pytest.mark.slow),
        pytest.param(
            f"run {TINY} --route-length-m 1 --spacing-m 0.2", "distributed sklearn trimesh", marks=pytest.mark.slow
        ),
        pytest.param(  # nothing listens there
            f"run {TINY} --live --viewer rerun+http://127.0.0.1:1/proxy", WITHOUT_FIGURES, marks=pytest.mark.slow
        ),
        ("play nothing", HEAVY),
    ],
)
def test_a_command_loads_nothing_heavy_that_it_does_not_need(arguments, unneeded, tmp_path):
    loaded = run_main(arguments, tmp_path).stdout.splitlines()[-1].split(",")
    assert not set(unneeded.split()) & set(loaded)


@pytest.mark.slow
def test_worlds_views_and_databases_do_without_torch(tmp_path):
    for arguments in (
        "world --preset tiny --out w.ply --picture w.png",
        "view --world w.ply --size 60x12",
        "route --world tiny --length-m 1",
        f"database grid {TINY} --from-m 0,0 --to-m 1,1 --spacing-m 0.5 --out grid",
        "database check grid",
        "models",
    ):
        done = run_main(arguments, tmp_path, WITHOUT_TORCH)
        assert done.returncode == 0, done.stderr
    assert "there is no recording" in run_main("play nothing", tmp_path, WITHOUT_TORCH).stderr
    for arguments in (f"run {TINY}", f"train {TINY}"):
        done = run_main(arguments, tmp_path, WITHOUT_TORCH)
        assert done.returncode == 2
        assert done.stderr.splitlines()[-1].startswith("tussock: this command needs torch")


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


SWEEP = """
[fixed]
world = "tiny"
size = "60x12"
route-length-m = 1
[axes]
model = ["random", "perfect-memory"]
seed = { from = 0, to = 1 }
"""


@pytest.mark.slow
def test_nor_do_those_of_the_same_names_as_a_library(folder):
    (folder / "coverage").mkdir()  # which numba looks for
    (folder / "bin").mkdir()
    installed = folder / "bin" / "command.py"  # as the installed command: in another folder than the current one
    installed.write_text("from tussock.navigation.cli.main import main\n\nif __name__ == '__main__':\n    main()\n")
    (folder / "sweep.toml").write_text(SWEEP)
    command = [sys.executable, installed, "sweep", "sweep.toml", "--out", "out"]
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
