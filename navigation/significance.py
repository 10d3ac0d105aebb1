"""Whether two models differ: paired tests over worlds, corrected for many comparisons (docs/statistics.md)."""

from collections.abc import Sequence
from functools import lru_cache
from itertools import product
from math import erfc

import numpy as np
from jaxtyping import Float, Int

from .intervals import MIN_WORLDS, world_sums

EXACT_WORLDS = 13  # up to this number of worlds, all 8,192 changes of signs are tried
DRAWS = 9_999  # changes that are drawn for more worlds ..
MAX_DRAWN_WORLDS = 100  # .. and with still more, their sum has a normal distribution


def sign_flip_p(differences: Float[np.ndarray, " n"], worlds: Int[np.ndarray, " n"]) -> float:
    """The p value of "the two are alike": how often a difference as large appears where the two are exchanged at random in each world.

    All runs in one world are exchanged together, as they are not independent. Nothing is assumed about distributions.

    Args:
        differences: Of the results of two models in runs that are equal in everything else.
        worlds: Number of each run's world.

    Returns:
        The two-sided p value; nan with fewer than MIN_WORLDS worlds.
    """
    sums, _ = world_sums(differences, worlds)
    if len(sums) < MIN_WORLDS:
        return float("nan")
    observed, rounding = abs(sums.sum()), 1e-12 * np.abs(sums).sum()
    if len(sums) > MAX_DRAWN_WORLDS:
        size = np.linalg.norm(sums)
        return erfc(observed / size / 2**0.5) if size else 1.0
    return float(np.mean(np.abs(_signs(len(sums)) @ sums) >= observed - rounding))


@lru_cache(maxsize=2)  # of 8 MB at most; the pairs of a report have the same
def _signs(worlds: int) -> Float[np.ndarray, "changes worlds"]:
    """Signs that the worlds' differences may have; the first row leaves all as they are."""
    if worlds <= EXACT_WORLDS:
        return np.array(list(product((1.0, -1.0), repeat=worlds)))
    drawn = np.random.default_rng(0).choice([1.0, -1.0], size=(DRAWS, worlds))
    return np.vstack([np.ones(worlds), drawn])


def holm(p_values: Sequence[float]) -> list[float]:
    """Holm's correction (1979): corrected p values of several comparisons, such that an error in any of them has the stated probability.

    Args:
        p_values: One for each comparison; nan where there was no test, which is no comparison.

    Returns:
        The corrected ones, in the same order.
    """
    given = np.array(p_values, dtype=float)
    corrected, tested = np.full(len(given), np.nan), np.flatnonzero(np.isfinite(given))
    order = tested[np.argsort(given[tested], kind="stable")]
    factors = len(order) - np.arange(len(order))
    corrected[order] = np.maximum.accumulate(given[order] * factors).clip(max=1.0)
    return corrected.tolist()
