"""All rotations of views against what models keep."""

import naive
import pytest
import torch

from tussock.navigation import Infomax, PerfectMemory
from tussock.navigation.models.infomax import infomax_update


def noise(n: int, height: int, width: int, seed: int = 0) -> torch.Tensor:
    return torch.rand(n, height, width, generator=torch.Generator().manual_seed(seed))


@pytest.mark.parametrize("size", [(90, 25), (180, 50)], ids=lambda size: "x".join(map(str, size)))
@pytest.mark.parametrize("batch", [1, 32])
def test_perfect_memory(measure, size, batch):
    width, height = size
    snapshots, views = noise(1000, height, width), noise(32, height, width, 1)
    memory = PerfectMemory().fit(snapshots)
    measure(
        f"all rotations of a {width} x {height} view, 1,000 snapshots, {'in batches of 32' if batch > 1 else 'one by one'}",
        lambda: memory.scan(views[:batch]), items=batch, unit="ms a view", rounds=40,
        naive=lambda: naive.scan(views[0].numpy(), snapshots.numpy()),
    )  # fmt: skip


@pytest.mark.parametrize("n", [100, 1_000, 10_000, 100_000])
def test_growth_with_snapshots(measure, n):
    memory, view = PerfectMemory().fit(noise(n, 25, 90)), noise(1, 25, 90, 1)
    measure(
        f"all rotations of a 90 x 25 view, {n:,} snapshots", lambda: memory.scan(view), unit="ms a view", rounds=7,
        curve=("snapshots", "90 x 25", n),
    )  # fmt: skip


def test_infomax_scan(measure):
    model, view = Infomax().fit(noise(1, 25, 90)), noise(1, 25, 90, 1)
    weights = model.learned["weights"].flatten(start_dim=1).numpy()
    measure(
        "all rotations of a 90 x 25 view, Infomax of 2,250 units", lambda: model.scan(view), unit="ms a view",
        naive=lambda: naive.infomax_scan(view[0].numpy(), weights),
    )  # fmt: skip


def test_infomax_training(measure):
    weights, view = torch.randn(2250, 2250), torch.randn(2250)
    measure(
        "a view learned by Infomax of 2,250 units", lambda: [infomax_update(weights, view, 1e-9) for _ in range(10)], items=10,
        unit="ms a view", naive=lambda: naive.infomax_update(weights.numpy(), view.numpy(), 1e-9),
    )  # fmt: skip
