"""How the benchmarks measure; see `measure`."""

import time
from collections.abc import Callable

import pytest


@pytest.fixture
def measure(benchmark):
    """A function that measures some work and writes the result where benchmarks/report.py finds it."""

    def run(
        name: str,
        work: Callable[[], object],
        *,
        items: float = 1,
        unit: str = "ms",
        naive: Callable[[], object] | None = None,
        naive_share: float = 1.0,
        rounds: int = 15,
        warm: int = 1,
        curve: tuple[str, str, float] | None = None,
    ) -> None:
        """Measure some work.

        Args:
            name: In the table.
            work: What is measured.
            items: Number of things that it does; times are per item.
            unit: In which the table gives the time per item.
            naive: A naive version of one item, timed once.
            naive_share: Share of one item that the naive version does.
            rounds: How often the work is measured.
            warm: How often it is done before that.
            curve: Point of a growth curve: what grows, the name of the curve, and x.
        """
        seconds = None
        if naive is not None:
            began = time.perf_counter()
            naive()
            seconds = (time.perf_counter() - began) / naive_share
        benchmark.extra_info.update(name=name, items=items, unit=unit, naive_seconds=seconds, curve=curve)
        benchmark.pedantic(work, rounds=rounds, iterations=1, warmup_rounds=warm)

    return run
