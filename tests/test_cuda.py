"""The CUDA renderer against the CPU renderer: on a GPU where there is one, and always in numba's simulator, in a process of its own."""

import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from renderer_laws import batches_and_callers_do_not_matter
from scenes import (
    full_poses,
    hills,
    mesh_world,
    post,
    random_poses,
    random_texture,
    random_world,
    textured_world,
    world_of,
)

from tussock.render.compile import SIMULATED
from tussock.render.eye import Eye
from tussock.render.poses import AnyPoses
from tussock.render.renderer import Renderer, open_renderer
from tussock.world.errors import InputError, MissingDependencyError, SettingError
from tussock.world.scene import World
from tussock.world.textures import ALPHAS, FILTERS, WRAPS

pytestmark = pytest.mark.filterwarnings("ignore::RuntimeWarning")  # in the simulator nothing is compiled
SMALL = Eye(width=24, height=7, samples=1, z=0.05) if SIMULATED else Eye(width=240, height=70, samples=1, z=0.05)
FINE = Eye(width=12, height=4, samples=2, z=0.05) if SIMULATED else Eye(width=90, height=19, samples=4, z=0.05)
N = 12 if SIMULATED else 2000
POSES = random_poses(2 if SIMULATED else 20)


@pytest.fixture
def here(monkeypatch):
    """Skips where nothing can run the renderer."""
    try:
        with open_renderer(random_world(n=1), SMALL, "cuda"):
            pass
    except MissingDependencyError as error:
        pytest.skip(str(error))
    if SIMULATED:  # by a thread of Python for each thread of the GPU
        from tussock.render import cuda, cuda_kernels

        monkeypatch.setattr(cuda, "BLOCKS", 2)
        monkeypatch.setattr(cuda_kernels, "THREADS", 32)


def draws_as_the_cpu(world: World, eye: Eye, poses: AnyPoses = POSES) -> None:
    with open_renderer(world, eye, "cuda") as gpu, open_renderer(world, eye, "cpu") as cpu:
        assert isinstance(gpu, Renderer)
        views, exact = gpu.render(poses), cpu.render(poses)
    assert exact.std() > 10
    assert np.array_equal(views, exact)


@pytest.mark.usefixtures("here")
@pytest.mark.parametrize("eye", [SMALL, FINE], ids=["one ray", "several rays"])
@pytest.mark.parametrize("seed", range(2))
def test_equals_the_cpu_renderer(eye, seed):
    draws_as_the_cpu(random_world(seed, N), eye)
    draws_as_the_cpu(random_world(seed, N, ground=False, double_sided=False), eye)


@pytest.mark.usefixtures("here")
def test_triangles_over_all_columns_and_on_shared_edges():
    world = mesh_world(hills(3.0 if SIMULATED else 0.2), post(1.0, 1.0, 0.0), post(2.5, 1.0, 0.1, height=3.0))
    draws_as_the_cpu(world, SMALL, [(1.5, 1.1, 0.0), (3.0, 3.0, np.pi / 2)])


@pytest.mark.usefixtures("here")
@pytest.mark.parametrize("filter", FILTERS)
@pytest.mark.parametrize("wrap", WRAPS)
def test_textures_and_holes(filter, wrap):
    textures = [random_texture(k, alpha=alpha, filter=filter, wrap=(wrap, wrap)) for k, alpha in enumerate(ALPHAS)]
    for colours in (False, True):
        draws_as_the_cpu(textured_world(textures, 1, N, colours=colours), SMALL)


@pytest.mark.usefixtures("here")
@pytest.mark.parametrize("textured", [False, True])
def test_pitched_and_rolled_eyes(textured):
    textures = [random_texture(k, alpha=alpha) for k, alpha in enumerate(ALPHAS)]
    world = textured_world(textures, 1, N) if textured else random_world(2, N)
    tilted = full_poses(world.field, len(POSES))
    draws_as_the_cpu(world, SMALL, tilted)
    draws_as_the_cpu(world, FINE, tilted[:2] * [[1, 1, 1, 1, 1, 1], [1, 1, 1, 1, 0, 0]])  # the second one is level


@pytest.mark.usefixtures("here")
def test_too_many_wide_triangles_for_the_queue(monkeypatch):
    from tussock.render import cuda

    monkeypatch.setattr(cuda, "WIDE", 3)
    draws_as_the_cpu(random_world(3, N), SMALL)


@pytest.mark.usefixtures("here")
def test_batches_and_an_empty_world(monkeypatch):
    from tussock.render import cuda

    with open_renderer(random_world(4, N), SMALL, "cuda") as renderer:
        whole = renderer.render(POSES)
        batches_and_callers_do_not_matter(renderer, POSES[:2])
        assert renderer.render(np.empty((0, 3))).shape == (0, SMALL.height, SMALL.width, 4)
    monkeypatch.setattr(cuda, "RAYS", 1)
    with open_renderer(random_world(4, N), SMALL, "cuda") as renderer:
        assert np.array_equal(renderer.render(POSES), whole)
    nothing = world_of(np.empty((0, 3, 3)), np.empty((0, 3)), ground=False)
    with open_renderer(nothing, SMALL, "cuda") as renderer:
        assert (renderer.render(POSES) == [*nothing.sky_rgb, 0]).all()
        with pytest.raises(SettingError, match="pose 0"):
            renderer.render([(0.0, np.nan, 0.0)])
    renderer.close()
    with pytest.raises(InputError, match="closed"):
        renderer.render(POSES)


@pytest.mark.usefixtures("here")
def test_too_little_memory_is_said(monkeypatch):
    def full(*_):
        raise RuntimeError("[CUresult.CUDA_ERROR_OUT_OF_MEMORY] Call to cuMemAlloc results in an error")

    with open_renderer(random_world(n=1), SMALL, "cuda") as renderer:
        monkeypatch.setattr(renderer, "_draw", full)
        with pytest.raises(InputError, match="too little free memory"):
            renderer.render(POSES)


def test_without_a_gpu_the_reason_is_said():
    if SIMULATED:
        pytest.skip("there is a GPU, a simulated one")
    try:
        open_renderer(random_world(n=1), SMALL, "cuda").close()
    except MissingDependencyError as error:
        reason = str(error)
    else:
        pytest.skip("there is a GPU")
    assert re.search(r"needs (numba-cuda|an NVIDIA GPU).*use the cpu renderer", reason)


@pytest.mark.slow
def test_in_the_simulator():
    if SIMULATED:
        pytest.skip("this is the simulator")
    simulator = {"NUMBA_ENABLE_CUDASIM": "1", "NUMBA_DISABLE_JIT": "1"}
    command = [sys.executable, "-m", "pytest", "-p", "no:cacheprovider", str(Path(__file__))]
    done = subprocess.run(command, env=os.environ | simulator, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout
    assert "16 passed, 1 skipped" in done.stdout
