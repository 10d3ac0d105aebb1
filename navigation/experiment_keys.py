"""Keys of experiments: digests of everything that decides a run, or a part of it. By them a sweep finds the runs that it has done."""

import hashlib
import json
from collections.abc import Collection
from pathlib import Path
from typing import Any

from tussock.world.params import is_generated
from tussock.world.registry import Registry
from tussock.world.specs import Spec, format_spec

from .content import content_of
from .experiment import Experiment
from .experiment_settings import TYPES, settings_of
from .models.registry import MODELS
from .steering.registry import NAVIGATORS

VERSION = 4  # of what a run does: a change that alters results raises it, and runs that were kept are done again
ROUTE_SETTINGS = (
    "world",
    "world_seed",
    "up",
    "unit",
    "scale",
    "strict",
    "ground",
    "max_slope_deg",
    "cull_back_faces",
    "route",
    "route_seed",
    "route_length_m",
    "headings",
    "columns",
    "smooth_m",
    "route_database",
    "grid_database",
)  # decide world and route
VIEW_SETTINGS = (  # decide with these the views that are learned
    "size", "renderer", "samples", "eye_height_m", "top_deg", "bottom_deg", "field_deg", "mask", "threads",
    "encoding", "resize", "blur", "spacing_m", "every", "learning_walk_m",
)  # fmt: skip
WALK_SETTINGS = (  # decide the walk alone, not what is learned before
    "step_m", "offset_m", "heading_noise_deg", "on_lost", "waypoint_m", "arrive_m", "lost_m", "patience_m", "max_steps",
)  # fmt: skip


def key_of(experiment: Experiment) -> str:
    """A digest of everything that decides a run, the contents of its files included."""
    return _digest(experiment, TYPES)


def route_key(experiment: Experiment) -> str:
    """A digest of what decides the world and the route of a run."""
    return "path-" + _digest(experiment, ROUTE_SETTINGS)


def views_key(experiment: Experiment) -> str:
    """A digest of what decides the training views of a run; a model from a file learns none."""
    learned = "views-" if isinstance(experiment.model, Spec) else "no-views-"
    return learned + _digest(experiment, (*ROUTE_SETTINGS, *VIEW_SETTINGS))


def training_key(experiment: Experiment) -> str:
    """A digest of what decides the training of a run."""
    return "training-" + _digest(experiment, [name for name in TYPES if name not in WALK_SETTINGS])


def _digest(experiment: Experiment, names: Collection[str]) -> str:
    settings = settings_of(experiment)
    kept: dict[str, Any] = {name: settings[name] for name in sorted(names)}
    kept |= {name: experiment.seed if kept[name] is None else kept[name] for name in ("world_seed", "route_seed")}
    if "encoding" in names:  # of what is learned: classes by what they are, whatever their names in this process
        kept["encoding"] = experiment.encoding.text_in_files()
    if "model" in names:
        model = experiment.model
        kept["model"] = content_of(model) if isinstance(model, Path) else _in_files(model, MODELS)
        kept["navigator"] = _in_files(experiment.navigator, NAVIGATORS)
    if "mask" in names and experiment.eye.mask is not None:
        kept["mask"] = str(experiment.eye.mask)  # its pixels, wherever they were read from
    if experiment.route is not None:
        kept |= {"route": content_of(experiment.route), "route_seed": None, "route_length_m": None}
    databases = {name: getattr(experiment, name) for name in ("route_database", "grid_database")}
    if experiment.route_database is not None:
        kept |= {name: content_of(folder) for name, folder in databases.items() if folder is not None}
        kept |= {"world": None, "world_seed": None, "route_seed": None}
    elif not (isinstance(experiment.world, str) and is_generated(experiment.world)):
        kept |= {"world": content_of(experiment.world), "world_seed": None}
    return hashlib.sha256(json.dumps([VERSION, kept], default=str).encode()).hexdigest()[:16]


def _in_files(spec: Spec, registry: Registry) -> str:
    return format_spec(registry.name_in_files(spec.target), spec.parameters)
