"""How large an effect is: a number with its bootstrap interval over the units that it was measured on."""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Int
from scipy.stats import norm
from scipy.stats import t as student

SAMPLES = 1000  # of a bootstrap: with 20 units and more the ends of an interval are then good to about a twentieth of its width
CONFIDENCE = 0.95
MIN_UNITS = 5  # with fewer, the few samples that exist say too little of others

Statistic = Callable[[Int[np.ndarray, " n"]], float]


@dataclass(frozen=True, kw_only=True)
class Effect:
    """The size of an effect.

    Attributes:
        label: What the number is, with its unit in parentheses.
        value: The number; nan where it is undetermined.
        low: Lower end of its 95 % interval; nan where there is none.
        high: Upper end.
        units: Number of units that it was measured on.
        of: What the units are, in the plural: positions, routes, views.
    """

    label: str
    value: float
    low: float
    high: float
    units: int
    of: str


def effect_size(label: str, units: int, statistic: Statistic, *, of: str) -> Effect:
    """An effect with its bootstrap interval; there is none for fewer than MIN_UNITS units, and none where all samples agree, as
    the bootstrap knows nothing of values that were not seen.

    Args:
        label: See `Effect`.
        units: See `Effect`.
        statistic: Computes the number from the indices of units; in a sample, some are there several times and others are not.
        of: See `Effect`.

    Returns:
        The effect.
    """
    value = float(statistic(np.arange(units))) if units else math.nan
    low, high = bootstrap(units, statistic) if math.isfinite(value) else (math.nan, math.nan)
    if low == high:
        low = high = math.nan
    return Effect(label=label, value=value, low=low, high=high, units=units, of=of)


def bootstrap(units: int, statistic: Statistic, samples: int = SAMPLES) -> tuple[float, float]:
    """The ends of the bootstrap interval of a statistic; nan for fewer than MIN_UNITS units. Arguments as of `effect_size`.

    Percentiles of the samples, a little farther out than 2.5 and 97.5 where there are few units ("expanded percentiles", Hesterberg 2015):
    the variance of a mean over samples is too small, by the factor (n - 1) / n, and its tails are those of a normal distribution, not of
    Student's t.
    """
    if units < MIN_UNITS:
        return math.nan, math.nan
    tail = float(norm.cdf(math.sqrt(units / (units - 1)) * student.ppf((1 - CONFIDENCE) / 2, units - 1)))
    drawn = np.random.default_rng(0).integers(0, units, (samples, units))
    values = [statistic(sample) for sample in drawn]
    low, high = np.nanquantile(values, [tail, 1 - tail])
    return float(low), float(high)
