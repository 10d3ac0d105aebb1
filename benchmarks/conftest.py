"""How things are measured: see `measure`."""

import time
from collections.abc import Callable

import pytest


@pytest.fixture
def measure(benchmark):
    """A function that measures `work`, which does `items` things, and notes how long the naive version takes for one of them.

    measure(name, work, items=, unit=, naive=, naive_share=, rounds=, warm=, curve=): naive does one item, or naive_share of it, and is
    timed once. curve: (what grows, name of the curve, x) where the figure is a point of a growth curve.
    """

    def run(
        name: str, work: Callable[[], object], *, items: float = 1, unit: str = "ms", naive: Callable[[], object] | None = None,
        naive_share: float = 1.0, rounds: int = 15, warm: int = 1, curve: tuple[str, str, float] | None = None,
    ) -> None:  # fmt: skip
        seconds = None
        if naive is not None:
            began = time.perf_counter()
            naive()
            seconds = (time.perf_counter() - began) / naive_share
        benchmark.extra_info.update(name=name, items=items, unit=unit, naive_seconds=seconds, curve=curve)
        benchmark.pedantic(work, rounds=rounds, iterations=1, warmup_rounds=warm)

    return run
