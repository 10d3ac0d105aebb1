"""Any input is used or refused in one line: see fuzzing.py.

Each property is tried on a few examples, the same in each run; by the quick tests on very few.
"""

import os
import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest
import torch
from safetensors.torch import save_file

from tussock.navigation.models import make_model
from tussock.navigation.models.files import load_model
from tussock.render import Eye, open_renderer
from tussock.render.images.database import read_database
from tussock.render.images.entries import ENTRIES, read_entries
from tussock.render.images.metadata import METADATA
from tussock.render.images.pictures import read_image
from tussock.world.errors import InputError
from tussock.world.files import read_world
from tussock.world.routes import generate_route
from tussock.world.scene import World

HERE = Path(__file__).parent
LIMIT = 600  # seconds; only a process that hangs takes as long


@pytest.mark.parametrize(
    "file",
    ["fuzz_files", "fuzz_meshes", "fuzz_textures", "fuzz_databases", "fuzz_models", "fuzz_numbers", "fuzz_sweeps"],
)
@pytest.mark.parametrize(
    "examples",
    [["--examples", "6"], pytest.param([], marks=pytest.mark.slow)],
    ids=["very few examples", "few examples"],
)
def test_any_input_is_used_or_refused(file, examples):
    paths = os.pathsep.join([str(HERE.parent), str(HERE), os.environ.get("PYTHONPATH", "")])
    run = subprocess.run(
        [sys.executable, "-W", "error::RuntimeWarning", str(HERE / f"{file}.py"), *examples],
        env=os.environ | {"PYTHONPATH": paths}, capture_output=True, text=True, errors="replace", timeout=LIMIT,
    )  # fmt: skip
    assert run.returncode == 0, run.stdout + run.stderr[-5000:]
    assert "holds" in run.stdout


# Defects that fuzzing found, each in a test of its own.


def test_names_that_would_leave_a_copy_are_refused(tmp_path):
    folder = tmp_path / "d"
    (folder / "sub").mkdir(parents=True)
    (folder / METADATA).write_text("%YAML:1.0\n---\nmetadata:\n   type: route\n")
    cv2.imwrite(str(folder / "a.png"), np.zeros((2, 4, 3), np.uint8))
    for name in ("../d/a.png", "sub/../a.png", str(folder / "a.png")):  # all of them are in the folder
        (folder / ENTRIES).write_text(f"X [mm], Y [mm], Filename\n1, 2, {name}\n")
        with pytest.raises(InputError, match=r"line 2: .* is not in the folder"):
            read_database(folder)
    (folder / ENTRIES).write_text('X [mm], Y [mm], Filename\n1, 2, "a\nb.png"\n')
    with pytest.raises(InputError, match="not a valid file name"):
        read_database(folder)


def test_a_sheet_of_many_columns_is_refused(tmp_path):
    (tmp_path / ENTRIES).write_text(",".join(map(str, range(100_000))) + "\n1\n" * 1000)
    with pytest.raises(InputError, match="100000 columns; a database has up to 1000"):
        read_entries(tmp_path / ENTRIES)


def test_an_image_that_unpacks_to_gigabytes_is_refused(tmp_path):
    cv2.imwrite(str(tmp_path / "bomb.png"), np.zeros((8_001, 10_000), np.uint8))
    with pytest.raises(InputError, match=r"10000 x 8001; .* 80,000,000 pixels"):
        read_image(tmp_path / "bomb.png")


def test_a_mesh_that_is_repeated_too_often_is_refused(tmp_path, monkeypatch):
    import trimesh

    scene = trimesh.Scene()
    for i in range(9):
        scene.add_geometry(trimesh.creation.box(), geom_name="box", node_name=f"place{i}")
    scene.export(tmp_path / "w.glb")
    monkeypatch.setattr("tussock.world.meshes.files.MAX_TRIANGLES", 100)
    with pytest.raises(InputError, match="holds 108 triangles; a world has up to 100"):
        read_world(tmp_path / "w.glb")


def test_archives_are_not_unpacked(tmp_path):
    for name in ("w.zip", "w.bz2"):
        (tmp_path / name).write_bytes(b"PK")
        with pytest.raises(InputError, match="unknown kind of world"):
            read_world(tmp_path / name)


def test_views_of_large_numbers_are_refused_and_no_scan_overflows():
    views = torch.ones(2, 3, 8)
    model = make_model("perfect-memory").fit(views)
    for wrong in (views * 1e18, views.double(), torch.ones(1, 0, 8)):
        for act in (make_model("perfect-memory").fit, model.scan):
            with pytest.raises(Exception, match=r"over 1e\+12|float32|Float32|0 pixels|learned views of shape"):
                act(wrong)
    assert torch.isfinite(model.scan(views * 1e12)).all()


def test_a_wide_view_in_a_model_file_takes_no_memory(tmp_path):
    header = '{"version": 1, "model": "perfect-memory", "parameters": {}, "shape": [1, 65536], "encoding": null, "eye": null}'
    save_file({"learned.snapshots": torch.zeros(1, 1, 65536)}, tmp_path / "m", {"tussock": header})
    with pytest.raises(InputError, match="views of 65536 columns; give at most 8192"):
        load_model(tmp_path / "m")


def test_a_far_eye_and_a_vast_field_are_refused():
    world = World.generate("tiny", 0)
    with open_renderer(world, Eye(width=8, height=3, samples=1), "cpu") as renderer:
        for pose in ((1e30, 0, 0), (0, 0, 1e300)):
            with pytest.raises(InputError, match=r"finite numbers up to 1e\+07"):
                renderer.render([pose])
    vast = World(**{**vars(world), "field": world.field._replace(x_max=1e6, y_max=1e6)})
    with pytest.raises(InputError, match="too large to look for a route in"):
        generate_route(vast, 0)
