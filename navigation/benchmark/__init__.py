"""The test bed: the same worlds, routes, starts and noise for all who enter, their results, and the leaderboard (docs/benchmark.md)."""

from .definition import BENCHMARK, QUICK, Benchmark
from .models import enter

__all__ = ["BENCHMARK", "QUICK", "Benchmark", "enter"]
