"""The room render as a whole: its names, what it loads, its settings, poses, cores, and compiled code without a cache."""

import math
import os
import shutil
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest
from scenes import random_poses, random_world

from tussock.render.cores import core_count
from tussock.render.eye import Eye
from tussock.render.occlusion import covered_within
from tussock.render.poses import as_poses
from tussock.render.renderer import open_renderer
from tussock.render.scanline import ScanlineRenderer
from tussock.world.errors import SettingError
from tussock.world.geometry import Pose

CLONE = Path(__file__).parents[1]
NAMES = {
    "tussock.render": {
        "Eye",
        "Ommatidia",
        "Posture",
        "Renderer",
        "compound_eye",
        "draw_ommatidia",
        "lit",
        "open_renderer",
    },
    "tussock.render.images": {
        "Camera",
        "Database",
        "Grid",
        "ImportSettings",
        "Problem",
        "Unwrapping",
        "check_database",
        "find_ring",
        "import_database",
        "read_database",
        "unwrap_files",
        "write_database",
    },
}


@pytest.mark.parametrize("module", NAMES)
def test_public_names(module):
    package = import_module(module)
    assert set(package.__all__) == NAMES[module]
    for name in NAMES[module]:
        assert name in dir(package)
        assert getattr(package, name).__name__ == name


def run_python(code: str, folder: Path, **environment: str) -> subprocess.CompletedProcess:
    """Run code in a new process that finds the package `tussock` in a folder, without a home folder."""
    environment |= {"PYTHONPATH": str(folder), "HOME": "/proc/none", "PATH": os.environ["PATH"]}
    return subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True)


@pytest.fixture
def package_without_cache(tmp_path) -> Path:
    """A folder with a copy of the package, in which no compiled code can be kept.

    Files stand where the cache folders would be made: unlike read-only folders, they stop the administrator, too.
    """
    copy = tmp_path / "tussock"
    copy.mkdir()
    for name in ("world", "render"):
        shutil.copytree(CLONE / name, copy / name, ignore=shutil.ignore_patterns("__pycache__"))
    for folder in (path for path in (copy, *copy.rglob("*")) if path.is_dir()):
        (folder / "__pycache__").touch()
    return tmp_path


COMPILE = """
from tussock.render.culling_kernels import key_of
print(key_of(1.0, 7), key_of.stats.cache_path)
"""


def test_code_is_compiled_without_a_cache_and_one_warning_says_what_to_set(package_without_cache, tmp_path):
    done = run_python(COMPILE, package_without_cache)
    assert done.stdout.split() == [str((0x3F800000 << 32) | 7), "None"]
    assert done.stderr.count("\n") == 1
    assert "NUMBA_CACHE_DIR" in done.stderr
    done = run_python(COMPILE, package_without_cache, NUMBA_CACHE_DIR=str(tmp_path / "cache"))
    assert done.stdout.split()[1].startswith(str(tmp_path / "cache"))
    assert done.stderr == ""


USERS = """
import used
from tussock.render.compile import compiled

def plain(x):
    return used.double(x)

caller = compiled(plain, uses=[used])
print(caller(3))
"""


def test_a_change_in_a_module_that_compiled_code_uses_is_noticed(tmp_path):
    (tmp_path / "tussock").symlink_to(CLONE)
    (tmp_path / "caller.py").write_text(USERS)
    seen = []
    for factor in (2, 2, 5):
        used = f"from tussock.render.compile import compiled\n@compiled\ndef double(x):\n    return {factor} * x\n"
        (tmp_path / "used.py").write_text(used)
        environment = {"NUMBA_CACHE_DIR": str(tmp_path / "cache"), "PYTHONDONTWRITEBYTECODE": "1"}
        seen.append(run_python("import caller", tmp_path, **environment).stdout.strip())
    assert seen == ["6", "6", "15"]


def test_the_first_process_that_compiles_says_so_once(tmp_path):
    (tmp_path / "tussock").symlink_to(CLONE)
    code = "from tussock.render.compile import compiled\n"
    for name in ("double", "triple"):
        code += f"@compiled\ndef {name}(x):\n    return x * {len(name) - 4}\n"
    (tmp_path / "caller.py").write_text(code)
    script = "import logging; logging.basicConfig(level=20, format='%(message)s'); import caller; caller.double(1), caller.triple(1)"
    said = [run_python(script, tmp_path, NUMBA_CACHE_DIR=str(tmp_path / "cache")).stderr for _ in range(2)]
    assert said[0].startswith("compiling")
    assert said[0].count("\n") == 1
    assert said[1] == ""


def test_only_one_module_compiles():
    """So that all loops work without a cache."""
    files = [path for room in ("world", "render", "navigation") for path in (CLONE / room).rglob("*.py")]
    assert [path.name for path in files if "njit" in path.read_text()] == ["compile.py"]


def test_names_load_neither_numba_nor_pyrender(tmp_path):
    (tmp_path / "tussock").symlink_to(CLONE)
    code = "from tussock.render import Eye, Renderer, open_renderer; import sys; print({'numba', 'pyrender'} & {*sys.modules})"
    assert run_python(code, tmp_path).stdout == "set()\n"


def test_cores_are_counted_where_there_is_no_affinity(monkeypatch):
    assert core_count() == len(os.sched_getaffinity(0))
    monkeypatch.delattr(os, "sched_getaffinity")
    assert core_count() == os.cpu_count()
    monkeypatch.setattr(os, "cpu_count", lambda: None)  # undetermined
    assert core_count() == 1
    world, eye = random_world(), Eye(width=8, height=2)
    with open_renderer(world, eye, "cpu") as renderer, open_renderer(world, eye, "cpu", threads=2) as other:
        assert np.array_equal(renderer.render(random_poses(2)), other.render(random_poses(2)))


@pytest.mark.parametrize("threads", [0, -1])
def test_a_number_of_threads_under_1_is_refused(threads):
    with pytest.raises(SettingError, match=f"{threads} threads; give at least 1"):
        ScanlineRenderer(random_world(), Eye(width=8, height=2), threads)


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        ({"width": 3}, "width is 3; give .* 4 to 32768"),
        ({"width": 720.0}, "width is 720.0; give a whole number"),
        ({"height": 0}, "height is 0; give .* 1 to 16384"),
        ({"top": 1.6}, r"top is 1.6 rad \(91.67.* degrees\); give"),
        ({"bottom": math.nan}, "bottom is nan"),
        ({"top": -1.0}, r"bottom is -15 and top is -57.29.*; give bottom < top"),
        ({"z": math.inf}, "z is inf; give a number from"),
        ({"samples": 0}, "samples is 0; give .* 1 to 64 or None"),
        (
            {"width": 32768, "height": 4000, "samples": 1},
            "32768 x 4000 pixels of 1 x 1 rays .* 100,000,000 rays; give fewer",
        ),
    ],
)
def test_eyes_that_cannot_be_drawn_are_refused(parameters, message):
    with pytest.raises(SettingError, match=message):
        Eye(**parameters)


@pytest.mark.parametrize(
    "parameters",
    [
        {"width": 60, "height": 12, "samples": 64},  # with the default size, too many rays
        {"top": math.radians(-20), "bottom": math.radians(-60)},  # below the default bottom
        {"top": np.float32(1.0), "width": np.int64(8)},
    ],
)
def test_settings_of_an_eye_are_checked_together_and_not_with_the_defaults_of_others(parameters):
    eye = Eye(**parameters)
    assert {name: getattr(eye, name) for name in parameters} == parameters
    assert all(type(getattr(eye, name)) in (int, float) for name in parameters)


@pytest.mark.parametrize(
    ("poses", "message"),
    [
        ([(0.0, 0.0, 0.0), (0.0, math.nan, 0.0)], "pose 1 is .*nan.*; give finite numbers up to"),
        ([(1e8, 0.0, 0.0)], r"pose 0 is \[100000000.0"),
        ([(0.0, 0.0)], r"shape \(1, 2\); give rows of x, y, heading"),
        ([(10**400, 0.0, 0.0)], "not numbers"),
    ],
)
def test_invalid_poses_are_refused(poses, message):
    with pytest.raises(SettingError, match=message):
        as_poses(poses)


def test_occlusion_is_found_for_eyes_with_very_many_rays_in_a_row():
    """Its own rays lie in more rows than this eye has, for which the eye's samples would be too many."""
    eye = Eye(width=32768, height=1, samples=50)
    assert 0 <= covered_within(random_world(), eye, [Pose(0.0, 0.0, 0.0)], 1.0) <= 1


def test_no_poses_are_an_empty_array():
    assert as_poses([]).shape == (0, 3)
