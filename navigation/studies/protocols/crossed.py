"""Statistics of runs that are crossed: every route with every seed. Neither runs of one route nor those of one seed are independent."""

from itertools import product

import numpy as np
from jaxtyping import Float

SAMPLES = 20_000  # of a bootstrap
CONFIDENCE = 0.95
MIN_ROUTES = 5  # fewer do not determine an interval
MAX_EXACT = 16  # routes up to which all signs are tried; of more, as many are drawn


def crossed_interval(values: Float[np.ndarray, "routes seeds"]) -> tuple[float, float]:
    """Percentile bootstrap interval of the mean: routes are drawn, and seeds are drawn, independently of each other.

    Args:
        values: One value for each route and seed.

    Returns:
        Its ends; nan for fewer than MIN_ROUTES routes.
    """
    routes, seeds = values.shape
    if routes < MIN_ROUTES:
        return np.nan, np.nan
    random = np.random.default_rng(0)
    of_route, of_seed = (random.multinomial(n, np.full(n, 1 / n), size=SAMPLES) / n for n in (routes, seeds))
    means = np.einsum("kr,rs,ks->k", of_route, values, of_seed, optimize=True)
    low, high = np.quantile(means, [(1 - CONFIDENCE) / 2, (1 + CONFIDENCE) / 2])
    return float(low), float(high)


def sign_flip(differences: Float[np.ndarray, " routes"]) -> float:
    """Two-sided p of the exact test that the signs of differences are random: the share of all signs with a mean as far from 0.

    Args:
        differences: One for each route.
    """
    routes = len(differences)
    if routes <= MAX_EXACT:
        signs = np.array(list(product((1, -1), repeat=routes)))
    else:
        signs = np.random.default_rng(0).choice((1, -1), size=(2**MAX_EXACT, routes))
    means = np.abs(signs @ differences)
    return float(np.mean(means >= np.abs(differences.sum()) * (1 - 1e-12)))


def holm(p: Float[np.ndarray, " tests"]) -> Float[np.ndarray, " tests"]:
    """p of several tests, corrected by Holm's method."""
    order = np.argsort(p, kind="stable")
    corrected = np.maximum.accumulate(p[order] * np.arange(len(p), 0, -1)).clip(max=1)
    adjusted = np.empty(len(p))
    adjusted[order] = corrected
    return adjusted
