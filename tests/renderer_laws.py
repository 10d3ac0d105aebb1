"""Laws of exact renderers that hold in worlds of any kind."""

import pickle
from concurrent.futures import ThreadPoolExecutor

import numpy as np
from scenes import random_poses

from tussock.render.eye import Eye
from tussock.render.renderer import Renderer, open_renderer
from tussock.render.scanline import ScanlineRenderer
from tussock.world.scene import World


def batches_and_callers_do_not_matter(renderer: Renderer, poses: np.ndarray) -> None:
    """A batch equals its views one by one, drawn by several threads at once, or by the same renderer in another process."""
    batch = renderer.render(poses)
    assert all(np.array_equal(view, renderer.render([pose])[0]) for view, pose in zip(batch, poses, strict=True))
    with ThreadPoolExecutor(3) as threads:
        assert all(np.array_equal(views, batch) for views in threads.map(renderer.render, [poses] * 6))
    with pickle.loads(pickle.dumps(renderer)) as other:
        assert np.array_equal(other.render(poses), batch)


def batches_and_threads_do_not_matter(renderer: ScanlineRenderer) -> None:
    """The same, with any number of threads of its own."""
    poses = random_poses(7)
    batches_and_callers_do_not_matter(renderer, poses)
    batch = renderer.render(poses)
    for threads in (1, 3, 5):
        with ScanlineRenderer(renderer.world, renderer.eye, threads=threads) as other:
            assert np.array_equal(other.render(poses), batch)
            assert np.array_equal(other.render(poses[:1]), batch[:1])


def low_resolution_is_the_mean_over_each_pixels_solid_angle(world: World) -> None:
    """With 4 x 4 rays, a pixel is the mean of views that have a pixel for each of these rays."""
    coarse, fine = Eye(width=60, height=20, samples=4, z=0.05), Eye(width=240, height=80, samples=1, z=0.05)
    with open_renderer(world, coarse, "cpu") as low, open_renderer(world, fine, "cpu") as high:
        for pose in random_poses(4):
            weight = np.cos(fine.elevations()).reshape(20, 4, 1, 1, 1)
            pixels = high.render([pose])[0].reshape(20, 4, 60, 4, 4) * weight
            mean = pixels.sum(axis=(1, 3)) / (4 * weight.sum(axis=1))[:, 0]
            assert np.abs(low.render([pose])[0] - mean).max() <= 0.5 + 1e-6
