"""The familiarity models by name."""

from collections.abc import Callable

from world.errors import InputError

from ..familiarity import FamiliarityModel
from .mlp import MLP
from .perfect_memory import PerfectMemory
from .visual_compass import VisualCompass

# Each takes a seed, which those that draw nothing ignore.
MODELS: dict[str, Callable[[int], FamiliarityModel]] = {
    "visual-compass": lambda seed: VisualCompass(),
    "perfect-memory": lambda seed: PerfectMemory(),
    "mlp": lambda seed: MLP(seed=seed),
}


def make_model(name: str, seed: int = 0) -> FamiliarityModel:
    """An untrained model by its name. Raises InputError that lists the known ones."""
    if name not in MODELS:
        raise InputError(f"unknown model {name!r}; known: {', '.join(MODELS)}")
    return MODELS[name](seed)


__all__ = ["MLP", "MODELS", "PerfectMemory", "VisualCompass", "make_model"]
