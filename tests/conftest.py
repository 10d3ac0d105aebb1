"""What all tests share. Shapes and types in signatures are checked while the tests run."""

import os
import signal
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest
import typecheck
from hypothesis import settings

typecheck.install()

# Workers of pytest-xdist share the cores: more threads than one each would only wait for one another.
if "PYTEST_XDIST_WORKER" in os.environ:
    os.environ.setdefault("OMP_NUM_THREADS", "1")

# No test asserts a time, those of hypothesis included.
settings.register_profile("no deadline", settings(), deadline=None)
settings.load_profile("no deadline")

# A shell lets what it runs in the background ignore Ctrl-C, and so everything that the tests start; here it must not be ignored.
signal.signal(signal.SIGINT, signal.default_int_handler)

SUSSEX = Path(__file__).parents[2] / "shared" / "sussex"


# A worker of pytest-xdist gets whole files, in this order: none is left alone with a long one at the end.
LONGEST = [
    "sweeps",
    "navigators",
    "models",
    "fuzz",
    "cli",
    "gl_renderers",
    "world_generation",
    "leaderboard",
    "fields",
    "protocols",
    "collisions",
    "model_oracles",
    "environment",
    "terrain_walks",
    "images_only",
    "database_check",
    "batches",
    "experiment",
    "package",
    "database",
]


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """The files that take longest first, all others in their order."""
    rank = {f"test_{name}": number for number, name in enumerate(LONGEST)}
    items.sort(key=lambda item: rank.get(item.path.stem, len(rank)))


@pytest.fixture(params=["egl", "osmesa"])
def backend(request) -> str:
    """A backend of OpenGL that this process can use."""
    from tussock.render import gl
    from tussock.world.errors import InputError

    name = request.param
    if gl.bound_backend() not in (None, name):
        pytest.skip(f"this process is bound to {gl.bound_backend()}; {name} runs in another process")
    try:
        gl.open_context(name)
    except InputError as error:
        if os.environ.get("TUSSOCK_REQUIRE_GL") == "1":
            pytest.fail(f"TUSSOCK_REQUIRE_GL=1, but {error}")
        pytest.skip(str(error))
    return name


@pytest.fixture(scope="session")
def sussex() -> Path:
    """The folder of the original world and routes."""
    if not SUSSEX.is_dir():
        pytest.skip("the Sussex world is not on this machine (a folder shared/sussex next to the project)")
    return SUSSEX


@pytest.fixture(scope="module")
def cluster() -> Iterator[str]:
    """The address of a Dask scheduler with one worker, both in threads of this process."""
    from distributed import LocalCluster

    free = "127.0.0.1:0"  # of the pages that they serve
    pages = {"dashboard_address": free, "worker_dashboard_address": free}
    with LocalCluster(processes=False, n_workers=1, threads_per_worker=1, **pages) as local:
        yield local.scheduler_address


@pytest.fixture
def small_disk(tmp_path) -> Iterator[Path]:
    """A disk of 150 kB."""
    disk = tmp_path / "disk"
    disk.mkdir()
    if subprocess.run(["mount", "-t", "tmpfs", "-o", "size=150k", "tmpfs", disk], capture_output=True).returncode:
        pytest.skip("no right to mount a tmpfs here (as root, it has)")
    yield disk
    subprocess.run(["umount", "-l", disk], check=True)
