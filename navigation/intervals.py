"""Confidence intervals of shares and means of runs in several worlds, and of their differences (docs/statistics.md)."""

from dataclasses import dataclass
from functools import cache

import numpy as np
from jaxtyping import Float, Int
from scipy.stats import t as student

CONFIDENCE = 0.95
MIN_WORLDS = 5  # for an interval: fewer tell too little about how much worlds differ
SHARES, DEVIATIONS = (
    200,
    32,
)  # values of the mean share, and of the standard deviation of the worlds' shares, that are tried


@dataclass(frozen=True)
class Interval:
    """A mean, and the ends of its confidence interval; nan for what is undetermined."""

    value: float
    low: float
    high: float


def world_sums(
    values: Float[np.ndarray, " n"], worlds: Int[np.ndarray, " n"]
) -> tuple[Float[np.ndarray, " worlds"], Float[np.ndarray, " worlds"]]:
    """Sum of the values in each world, and their number.

    Args:
        values: The values of runs.
        worlds: Number of each run's world; any numbers.
    """
    _, place = np.unique(worlds, return_inverse=True)
    return np.bincount(place, weights=values).astype(float), np.bincount(place).astype(float)


def share_interval(values: Float[np.ndarray, " n"], worlds: Int[np.ndarray, " n"]) -> Interval:
    """Share of runs, and its interval from a beta-binomial model: each world has a share of its own, drawn from a beta distribution.

    Before the runs are known, any mean share is equally likely, and any standard deviation of the worlds' shares (flat priors; that of the
    deviation after Gelman 2006). Once they are known, the mean share is in the interval with a probability of CONFIDENCE. Where no run has
    what is counted, or all have, the interval ends at 0 or 1.

    Args:
        values: 1 for a run that has what is counted, else 0.
        worlds: Number of each run's world.
    """
    having, runs = world_sums(values, worlds)
    share = float(values.mean()) if len(values) else np.nan
    if len(runs) < MIN_WORLDS:
        return Interval(share, np.nan, np.nan)
    edges, probability = _posterior_of_share(having, runs)
    low, high = np.interp([(1 - CONFIDENCE) / 2, (1 + CONFIDENCE) / 2], probability, edges)
    return Interval(share, 0.0 if share == 0 else float(low), 1.0 if share == 1 else float(high))


def _posterior_of_share(
    having: Float[np.ndarray, " worlds"], runs: Float[np.ndarray, " worlds"]
) -> tuple[Float[np.ndarray, " edges"], Float[np.ndarray, " edges"]]:
    """Values of the mean share, and the probabilities that it is below them.

    A world with k of n has the likelihood B(k + a, n - k + b) / B(a, b), with a and b from the mean share and the deviation. It is
    a product of a + i for i < k, b + i for i < n - k and 1 / (a + b + i) for i < n, so the worlds with the same factor are counted.
    """
    worlds = len(runs)
    middle = (having.sum() / runs.sum() * worlds + 1) / (worlds + 2)
    reach = 6 * np.sqrt(middle * (1 - middle) / worlds)  # 6 standard errors, if all runs in a world were alike
    edges = np.linspace(max(0.0, middle - reach), min(1.0, middle + reach), SHARES + 1)
    share = ((edges[1:] + edges[:-1]) / 2)[:, None]
    deviation = (
        np.arange(DEVIATIONS) + 0.5
    ) / DEVIATIONS  # as a share of the greatest possible one; its square is 1 / (a + b + 1)
    total = 1 / deviation**2 - 1  # a + b
    logarithm = np.zeros((SHARES, DEVIATIONS))
    for i in range(int(runs.max())):
        logarithm += np.sum(having > i) * np.log(share * total + i)
        logarithm += np.sum(runs - having > i) * np.log((1 - share) * total + i)
        logarithm -= np.sum(runs > i) * np.log(total + i)
    probability = np.exp(logarithm - logarithm.max()).sum(axis=1).cumsum()
    return edges, np.concatenate([[0.0], probability / probability[-1]])


def mean_interval(values: Float[np.ndarray, " n"], worlds: Int[np.ndarray, " n"]) -> Interval:
    """Mean of values of any sign, as differences are, and its interval from Student's t distribution over worlds.

    Args:
        values: The values of runs.
        worlds: Number of each run's world.

    Returns:
        The interval; nan for its ends where it is undetermined: with fewer than MIN_WORLDS worlds, and where all worlds are alike.
    """
    mean, error, worlds_ = _mean_and_error(values, worlds)
    reach = _quantile(worlds_) * error
    return Interval(mean, mean - reach, mean + reach)


def positive_interval(values: Float[np.ndarray, " n"], worlds: Int[np.ndarray, " n"]) -> Interval:
    """As `mean_interval` for values that are never negative: the interval is that of the logarithm of the mean.

    Distances and errors have skewed distributions. So this one covers better, and it does not reach below 0.
    """
    mean, error, worlds_ = _mean_and_error(values, worlds)
    factor = np.exp(_quantile(worlds_) * error / mean) if mean > 0 else np.nan
    return Interval(mean, float(mean / factor), float(mean * factor))


def _mean_and_error(values: Float[np.ndarray, " n"], worlds: Int[np.ndarray, " n"]) -> tuple[float, float, int]:
    """Mean of all runs, its standard error over worlds (nan where undetermined), and the number of worlds."""
    sums, runs = world_sums(values, worlds)
    mean = float(values.mean()) if len(values) else np.nan
    if len(runs) < MIN_WORLDS:
        return mean, np.nan, len(runs)
    residuals = sums - mean * runs  # of a mean that is a ratio of two sums over worlds
    error = float(np.linalg.norm(residuals) / len(values) * np.sqrt(len(runs) / (len(runs) - 1)))
    return mean, error if error > 1e-12 * np.abs(values).max() else np.nan, len(runs)


@cache
def _quantile(worlds: int) -> float:
    return float(student.ppf((1 + CONFIDENCE) / 2, worlds - 1)) if worlds > 1 else np.nan


def share_difference_interval(
    first: Float[np.ndarray, " n"], second: Float[np.ndarray, " n"], worlds: Int[np.ndarray, " n"]
) -> Interval:
    """Difference of two shares over the same runs, and its interval, from those of the two (MOVER of Zou and Donner 2008).

    Each end is as far from the difference as the ends of the two shares are together, less what the two have in common: the correlation of
    their shares over worlds, which is taken a little towards 0, as few worlds overestimate it.

    Args:
        first: 1 for a run that has what is counted, else 0.
        second: The same of the runs that are paired with these.
        worlds: Number of each pair's world.
    """
    one, other = share_interval(first, worlds), share_interval(second, worlds)
    difference = one.value - other.value
    if np.isnan(one.low):
        return Interval(difference, np.nan, np.nan)
    (a, runs), (b, _) = world_sums(first, worlds), world_sums(second, worlds)
    a, b = a - one.value * runs, b - other.value * runs
    size = np.linalg.norm(a) * np.linalg.norm(b)
    correlation = float(a @ b / size) if size else 0.0
    correlation *= (len(runs) - 1) / (len(runs) + 1) if correlation > 0 else 1.0

    def reach(of_one: float, of_other: float) -> float:
        return float(np.sqrt(max(0.0, of_one**2 + of_other**2 - 2 * correlation * of_one * of_other)))

    low = difference - reach(one.value - one.low, other.high - other.value)
    high = difference + reach(one.high - one.value, other.value - other.low)
    return Interval(difference, max(-1.0, low), min(1.0, high))
