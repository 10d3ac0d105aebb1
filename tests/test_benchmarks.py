"""Fast and naive versions of the benchmarks give the same results: the naive ones are independent oracles."""

import naive
import numpy as np
import pytest
import torch
from scenes import random_poses, random_world, views
from worlds import blades

from tussock.navigation import Infomax, PerfectMemory
from tussock.navigation.models.infomax import infomax_update
from tussock.render import Eye, open_renderer


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
