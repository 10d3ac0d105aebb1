"""Familiarity models, the agent that follows them, and how well they do.

The names below are loaded when they are first used: some need torch, which takes a second to import.
"""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from .agent import Agent, Step
    from .encoding import Encoding
    from .evaluation import grid_positions, heading_errors
    from .failures import Witness
    from .familiarity import FamiliarityModel
    from .model_files import load_model, save_model
    from .models import (
        MLP,
        RBM,
        AdaBoost,
        Autoencoder,
        Chain,
        Infomax,
        MLPMixture,
        MLPRotation,
        MushroomBody,
        PerfectMemory,
        RandomHeadings,
        VisualCompass,
        make_model,
        opponent,
    )
    from .recording import Recording
    from .runs import record_walk
    from .training import learn, training_poses
    from .trajectory import Trajectory

__all__ = [
    "MLP",
    "RBM",
    "AdaBoost",
    "Agent",
    "Autoencoder",
    "Chain",
    "Encoding",
    "FamiliarityModel",
    "Infomax",
    "MLPMixture",
    "MLPRotation",
    "MushroomBody",
    "PerfectMemory",
    "RandomHeadings",
    "Recording",
    "Step",
    "Trajectory",
    "VisualCompass",
    "Witness",
    "grid_positions",
    "heading_errors",
    "learn",
    "load_model",
    "make_model",
    "opponent",
    "record_walk",
    "save_model",
    "training_poses",
]

_HOMES = {  # of all but the models
    "agent": ("Agent", "Step"),
    "encoding": ("Encoding",),
    "evaluation": ("grid_positions", "heading_errors"),
    "failures": ("Witness",),
    "familiarity": ("FamiliarityModel",),
    "model_files": ("load_model", "save_model"),
    "recording": ("Recording",),
    "runs": ("record_walk",),
    "training": ("learn", "training_poses"),
    "trajectory": ("Trajectory",),
}
_HOME = dict.fromkeys(__all__, "models") | {name: home for home, names in _HOMES.items() for name in names}


def __getattr__(name: str):
    if name in _HOME:
        return getattr(import_module(f".{_HOME[name]}", __name__), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
