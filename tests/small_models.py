"""Models that train in milliseconds, for tests that ask nothing of their quality."""

from typing import Any

from tussock.navigation.models import make_model
from tussock.navigation.models.registry import split_prefix

SMALL = {
    "mlp": {"hidden_layer_sizes": (8,), "max_iter": 10},
    "mlp-rotation": {"units": 10, "steps": 10},
    "mlp-mixture": {"units": 5, "steps": 10, "segments": 3},
    "adaboost": {"pool": 60, "features": 8, "passes": 2},
    "rbm": {"units": 20, "epochs": 5},
    "autoencoder": {"units": 20, "epochs": 5},
    "mushroom-body": {
        "columns": 12,
        "rows": 4,
        "cells": 300,
        "inputs": 6,
        "active": 0.03,
        "outputs": 3,
        "traversals": 1,
    },
    "spiking-mushroom-body": {"cells": 300, "inputs": 6, "kenyon_weight": 0.1},
    "spike-overlap": {"columns": 12, "rows": 4, "cells": 300, "inputs": 6},
}


def small(name: str, **parameters: Any) -> Any:
    """An untrained model, small unless the parameters say otherwise."""
    return make_model(name, **(SMALL.get(split_prefix(name)[1], {}) | parameters))
