"""The thesis's grid search: scikit-learn's GridSearchCV over the thesis's grids (appendices 7.4 to 7.6)."""

import os
import warnings
from typing import Any

import joblib
import numpy as np
import pandas as pd
import torch
from jaxtyping import Float32
from sklearn.exceptions import FitFailedWarning
from sklearn.model_selection import GridSearchCV, ParameterGrid

from ...models import MLP
from . import published
from .parameters import Progress, StudySettings

FOLDS = 3  # scikit-learn's default at the time; the scores in 7.4 to 7.6 are multiples of one in all samples
QUICK = {"activation": ("identity", "relu"), "solver": ("adam", "lbfgs"), "learning_rate_init": (1e-3,), "tol": (1e-4,)}


def search(
    name: str, views: Float32[torch.Tensor, "n h w"], settings: StudySettings, progress: Progress
) -> pd.DataFrame:
    """Search a grid of the thesis on all processor cores.

    Args:
        name: Name of one of `published.GRIDS`.
        views: Encoded views along the route; the network makes views that point off the route from them.
        settings: How many iterations, and how large a grid.
        progress: Called as tunings are done.

    Returns:
        One row per tuning, best first, with its mean scores over the folds.
    """
    grid, results = _grid(name, settings), []
    images, labels = MLP().training_data(views)
    pixels, labels = images.flatten(start_dim=1).numpy(), labels.numpy().astype(int)
    network = MLP(max_iter=settings.search_iterations, seed=settings.seed)
    workers = min(os.cpu_count() or 1, 8)
    with joblib.parallel_config("loky", n_jobs=workers, inner_max_num_threads=1), warnings.catch_warnings():
        # A tuning whose weights grow without bound fails; its score is missing, and it comes last.
        warnings.simplefilter("ignore", FitFailedWarning)
        warnings.filterwarnings("ignore", message="One or more of the", category=UserWarning)
        for activation in grid["activation"]:  # one part after another, to show progress
            part = grid | {"activation": [activation]}
            searched = GridSearchCV(network, part, cv=FOLDS, return_train_score=True, refit=False).fit(pixels, labels)
            results.append(pd.DataFrame(searched.cv_results_))
            progress(sum(map(len, results)), count_tunings(name, settings))
    table = pd.concat(results, ignore_index=True)
    parameters = sorted(column for column in table if column.startswith("param_"))
    table = table[["mean_test_score", "mean_train_score", *parameters]]
    table = table.sort_values("mean_test_score", ascending=False, kind="stable", ignore_index=True)
    return table.assign(param_hidden_layer_sizes=[list(sizes) for sizes in table["param_hidden_layer_sizes"]])


def count_tunings(name: str, settings: StudySettings) -> int:
    """Number of tunings that a search tries."""
    return len(ParameterGrid(_grid(name, settings)))


def _grid(name: str, settings: StudySettings) -> dict[str, list]:
    grid = published.GRIDS[name] | (QUICK if settings.quick else {})
    return {key: list(values) for key, values in grid.items()}


def best_tuning(table: pd.DataFrame) -> dict[str, Any]:
    """The parameters in a search's first row, as the network takes them."""
    first = table.iloc[0]
    return {
        "activation": str(first["param_activation"]),
        "solver": str(first["param_solver"]),
        "hidden_layer_sizes": tuple(int(size) for size in first["param_hidden_layer_sizes"]),
        "learning_rate_init": float(first["param_learning_rate_init"]),
        "tol": float(first["param_tol"]),
    }


def count_best(table: pd.DataFrame) -> int:
    """Number of tunings that have the highest validation score."""
    return int(np.isclose(table["mean_test_score"], table["mean_test_score"].iloc[0]).sum())


def share_of(solver: str, table: pd.DataFrame, best: int) -> float:
    """Share of a solver among the `best` first tunings and all with the same score, so that the order of ties does not count."""
    lowest = table["mean_test_score"].iloc[min(best, len(table)) - 1]
    return float((table.loc[table["mean_test_score"] >= lowest - 1e-9, "param_solver"] == solver).mean())
