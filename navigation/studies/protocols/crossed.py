"""The interval of runs that are crossed: every route with every seed. Neither runs of one route nor those of one seed are independent."""

import numpy as np
from jaxtyping import Float

from ...intervals import CONFIDENCE, MIN_WORLDS

SAMPLES = 20_000  # of a bootstrap


def crossed_interval(values: Float[np.ndarray, "routes seeds"]) -> tuple[float, float]:
    """Percentile bootstrap interval of the mean: routes are drawn, and seeds are drawn, independently of each other.

    Args:
        values: One value for each route and seed.

    Returns:
        Its ends; nan for fewer than MIN_WORLDS routes.
    """
    routes, seeds = values.shape
    if routes < MIN_WORLDS:
        return np.nan, np.nan
    random = np.random.default_rng(0)
    of_route, of_seed = (random.multinomial(n, np.full(n, 1 / n), size=SAMPLES) / n for n in (routes, seeds))
    means = np.einsum("kr,rs,ks->k", of_route, values, of_seed, optimize=True)
    low, high = np.quantile(means, [(1 - CONFIDENCE) / 2, (1 + CONFIDENCE) / 2])
    return float(low), float(high)
