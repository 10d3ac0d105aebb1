"""The thesis's grid search: scikit-learn's GridSearchCV over its own grids (appendices 7.4 to 7.6)."""

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
from .settings import Settings

FOLDS = 3  # scikit-learn's default at the time; the scores in 7.4 to 7.6 are multiples of one in all samples
QUICK = {"activation": ("identity", "relu"), "solver": ("adam", "lbfgs"), "learning_rate_init": (1e-3,), "tol": (1e-4,)}


def search(
    name: str, views: Float32[torch.Tensor, "n h w"], settings: Settings, progress=lambda done, total: None
) -> pd.DataFrame:
    """Every tuning of a grid of the thesis's, best first, with its mean scores over the folds; on all processor cores.

    name: which of `published.GRIDS`. views: along the route; negatives are made of them. progress(done, total) counts tunings.
    """
    grid = _grid(name, settings)
    images, labels = MLP().training_data(views)
    pixels, labels = images.flatten(start_dim=1).numpy(), labels.numpy().astype(int)
    results, done, total = [], 0, tunings(name, settings)
    workers = min(os.cpu_count() or 1, 8)
    with joblib.parallel_config("loky", n_jobs=workers, inner_max_num_threads=1), warnings.catch_warnings():
        # A tuning whose weights grow without bound fails; its score is missing, and it comes last.
        warnings.simplefilter("ignore", FitFailedWarning)
        warnings.filterwarnings("ignore", message="One or more of the", category=UserWarning)
        for activation in grid["activation"]:  # a part at a time, to show progress
            part = grid | {"activation": (activation,)}
            searched = GridSearchCV(
                MLP(max_iter=settings.search_iterations, seed=settings.seed), {key: list(values) for key, values in part.items()},
                cv=FOLDS, return_train_score=True, refit=False,
            ).fit(pixels, labels)  # fmt: skip
            results.append(pd.DataFrame(searched.cv_results_))
            done += len(results[-1])
            progress(done, total)
    table = pd.concat(results, ignore_index=True)
    columns = [
        "mean_test_score",
        "mean_train_score",
        *sorted(column for column in table if column.startswith("param_")),
    ]
    table = table[columns].sort_values("mean_test_score", ascending=False, kind="stable", ignore_index=True)
    table["param_hidden_layer_sizes"] = [list(sizes) for sizes in table["param_hidden_layer_sizes"]]
    return table


def tunings(name: str, settings: Settings) -> int:
    """How many tunings a search tries."""
    return len(ParameterGrid({key: list(values) for key, values in _grid(name, settings).items()}))


def _grid(name: str, settings: Settings) -> dict[str, tuple]:
    return published.GRIDS[name] | (QUICK if settings.quick else {})


def best_tuning(table: pd.DataFrame) -> dict[str, Any]:
    """The parameters of a search's first row, as the network takes them."""
    first = table.iloc[0]
    return {
        "activation": str(first["param_activation"]), "solver": str(first["param_solver"]),
        "hidden_layer_sizes": tuple(int(size) for size in first["param_hidden_layer_sizes"]),
        "learning_rate_init": float(first["param_learning_rate_init"]), "tol": float(first["param_tol"]),
    }  # fmt: skip


def same_score(table: pd.DataFrame) -> int:
    """How many tunings share the highest validation score."""
    return int(np.isclose(table["mean_test_score"], table["mean_test_score"].iloc[0]).sum())


def share_of(solver: str, table: pd.DataFrame, best: int) -> float:
    """Share of a solver in the `best` first tunings and all that score alike, so that ties are not decided by their order."""
    least = table["mean_test_score"].iloc[min(best, len(table)) - 1]
    return float((table.loc[table["mean_test_score"] >= least - 1e-9, "param_solver"] == solver).mean())
