"""Fast and naive versions of the benchmarks give the same results: the naive ones are independent oracles. Jobs are measured right."""

import argparse
import importlib
import json
import subprocess
import sys
import time
from array import array
from functools import reduce
from pathlib import Path

import naive
import numpy as np
import pytest
import torch
from heading_oracle import dense_poses, known_position
from job_results import compare, compare_numbers
from scenes import random_poses, random_world, views
from stages import sitecustomize as stages
from worlds import blades

from tussock.navigation import Infomax, PerfectMemory
from tussock.navigation.models.infomax import infomax_update
from tussock.navigation.sweeps.store import Finished, Store
from tussock.render import Eye, open_renderer
from tussock.world.geometry import Bounds, Route


@pytest.mark.parametrize("world", [random_world(seed=8, n=60), blades(300)], ids=["random", "blades"])
def test_views_equal_every_ray_against_every_triangle(world):
    eye = Eye(width=48, height=20, top=np.radians(80), bottom=np.radians(-60), z=0.07, samples=1)
    with open_renderer(world, eye, "cpu") as renderer:
        for pose in random_poses(4, seed=3):
            assert (renderer.render([pose])[0] != naive.view(world, eye, pose)).any(axis=-1).mean() < 0.003


def test_scans_equal_a_loop_that_rolls_the_view():
    snapshots, seen = views(40), views(3, 1)
    scans = PerfectMemory().fit(snapshots).scan(seen)
    for view, scan in zip(seen, scans, strict=True):
        assert np.allclose(scan, naive.scan(view.double().numpy(), snapshots.double().numpy()), atol=1e-5)


def test_infomax_equals_its_formula_in_numpy():
    model, seen = Infomax().fit(views(6)), views(2, 1)
    weights = model.learned["weights"].flatten(start_dim=1)
    for view, scan in zip(seen, model.scan(seen), strict=True):
        assert np.allclose(scan, naive.infomax_scan(view.numpy(), weights.numpy()), rtol=1e-4)
    expected = naive.infomax_update(weights.numpy(), seen[0].flatten().numpy(), 1e-4)
    infomax_update(weights, seen[0].flatten(), 1e-4)
    assert torch.allclose(weights, torch.tensor(expected, dtype=torch.float32), atol=1e-4)


ROUTE = Route.through(np.array([[1.0, 1.0], [2.0, 1.3], [2.5, 2.2]])).resampled(0.05)


def test_the_oracle_of_headings_has_seen_all_around_the_route_but_no_tested_position():
    poses = dense_poses(ROUTE, argparse.Namespace(dense_m=0.04, within_m=0.1), Bounds(0, 0, 10, 10))
    off = np.abs(poses[:, :2] / 0.2 - np.round(poses[:, :2] / 0.2)) * 0.2
    assert off.min() > 0.019  # a tested position is a multiple of 0.2 m
    assert np.hypot(*(poses[:, None, :2] - ROUTE.xy).transpose(2, 0, 1)).min(axis=1).max() < 0.15
    fine = np.random.default_rng(0).uniform([1, 1], [2.5, 2.2], (300, 2))
    near = fine[ROUTE.nearest(fine)[0] <= 0.1]
    assert np.hypot(*(near[:, None] - poses[:, :2]).transpose(2, 0, 1)).min(axis=1).max() <= 0.04 / 2**0.5 + 1e-9


def test_the_oracle_that_knows_the_position_compares_with_the_nearest_view_alone():
    poses, memories = ROUTE.poses[:4], views(4)
    seen = memories[[1, 1, 2, 0]].roll(3, dims=-1)  # at the second and third position the view that was learned there
    errors = known_position(memories, poses, seen, ROUTE, poses).errors
    turn = 3 * 2 * np.pi / memories.shape[2]
    assert np.allclose(errors[1:3], turn, atol=0.02)
    assert (np.abs(errors[[0, 3]] - turn) > 0.1).all()


def test_the_functions_whose_stages_are_measured_are_there():
    for module, names in stages.FUNCTIONS.items():
        for name, stage in names.items():
            assert callable(reduce(getattr, name.split("."), importlib.import_module(module)))
            assert stage in stages.STAGES


def test_time_belongs_to_the_innermost_stage(tmp_path, monkeypatch):
    now = 0.0
    monkeypatch.setattr(time, "process_time", lambda: now)
    clock = stages.Clock(str(tmp_path))

    def work(seconds):
        nonlocal now
        now += seconds

    def of_stage(stage, function):
        return stages.timed(function, stages.STAGES.index(stage), clock)

    def walk():
        for _ in range(3):
            work(1)
            of_stage("write", work)(10)
            yield

    work(1000)
    for _ in of_stage("walk", walk)():
        work(100)
    with pytest.raises(TypeError):
        of_stage("route", work)("no number")
    (file,) = tmp_path.iterdir()
    assert dict(zip(stages.STAGES, array("d", file.read_bytes()), strict=True)) == {
        **dict.fromkeys(stages.STAGES, 0.0),
        "walk": 3,
        "write": 30,
    }


def _sweep(folder, x=1.0, steps=2, **settings):
    with Store(folder) as store:
        for seed in (0, 1):
            row = {"arrived": True, "steps": steps, "mean_deviation_m": 0.1}
            csv = f"step,x_m,y_m\n0,0,0\n1,{x},{seed}\n"
            store.add([Finished(key=str(seed), settings={"seed": seed} | settings, row=row, steps=csv)])
    return folder


def test_results_of_jobs_are_compared(tmp_path):
    base = _sweep(tmp_path / "base", encoding="edges")
    assert (
        str(compare(base, _sweep(tmp_path / "same", 1 + 1e-8, encoding="chain")))
        == "2 of 2 runs equal, positions to 1e-08 m"
    )
    found = str(compare(base, _sweep(tmp_path / "apart", 1.5)))
    assert found.startswith("0 of 2 runs equal; ")
    assert "seed 0: 5e-01 m apart at step 1" in found
    models = [_sweep(tmp_path / name, model=name) for name in ("random", "random seed=1")]
    assert "2 of 2 runs equal" in str(compare(*models))
    assert "seed 1: steps 2 and 3" in str(compare(base, _sweep(tmp_path / "longer", steps=3)))
    one, other = ({"a": [1.0, 2.0], "b": {"c": value}, "seconds": value} for value in (3, 4))
    assert str(compare_numbers(one, other)) == "2 of 3 numbers equal; /b/c: 3 and 4"
    assert "1 without a counterpart" in str(compare_numbers(one, {"a": [1.0, 2.0]}))


CHILD = """
import time
kept = b"1" * 200_000_000
while time.process_time() < 1:
    pass
time.sleep(0.5)
"""
JOB = "import subprocess, sys; subprocess.run([sys.executable, '-S', 'child.py'])"
MEASURE = """
import json, pathlib, sys
from job_process import measure
print(json.dumps(vars(measure([sys.executable, "-S", *sys.argv[1:]], pathlib.Path(), {}))))
"""


@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
def test_memory_and_time_of_the_children_of_a_job_count(tmp_path):
    (tmp_path / "child.py").write_text(CHILD)
    benchmarks = {"PYTHONPATH": str(Path(naive.__file__).parent)}
    command = [sys.executable, "-c", MEASURE, "-c", JOB]  # in a process of its own, as it takes in all orphans
    printed = subprocess.run(command, check=True, capture_output=True, cwd=tmp_path, env=benchmarks)
    measured = json.loads(printed.stdout)
    assert measured["peak_bytes"] > 200e6
    assert 1 < measured["cpu_seconds"] < measured["seconds"]
