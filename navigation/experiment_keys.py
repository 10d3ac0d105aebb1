"""Keys of experiments: digests of everything that decides a run, or a part of it. By them a sweep finds the runs that it has done."""

import hashlib
import json
from collections.abc import Callable, Collection
from operator import attrgetter
from pathlib import Path
from typing import Any

import attrs

from tussock.world.params import is_generated
from tussock.world.registry import Registry
from tussock.world.specs import Spec, format_spec

from .content import content_of
from .experiment import Experiment
from .experiment_settings import TYPES, settings_of
from .models.registry import MODELS
from .settings_table import FIELDS
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
    "altitude_m",
    "cull_back_faces",
    "light",
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
    "size", "renderer", "samples", "eye_height_m", "top_deg", "bottom_deg", "field_deg", "side", "overlap_deg", "mask", "eye", "spectrum",
    "threads", "gaze", "body_length_m", "pitch_noise_deg", "roll_noise_deg",
    "encoding", "resize", "blur", "spacing_m", "every", "learning_walk_m", "parallel_views",
    "goal_walk_m", "goal_turns", "goal_views", "goal_spread_deg", "goal_only",
)  # fmt: skip
WALK_SETTINGS = (  # decide the walk alone, not what is learned before
    "step_m", "offset_m", "heading_noise_deg", "collisions", "body_radius_m", "release_m", "release_deg",
    "displace_at", "displace_m", "test_change", "change_seed",
    "on_lost", "waypoint_m", "put_back_ahead_m", "arrive_m", "lost_m", "patience_m", "max_steps",
)  # fmt: skip

WALK_FIELDS = tuple(
    {FIELDS[name].partition(".")[0]: None for name in WALK_SETTINGS if name in FIELDS}
)  # of an experiment, likewise
_WALK = attrgetter(*WALK_FIELDS)
_REST = attrgetter(*(each.name for each in attrs.fields(Experiment) if each.name not in WALK_FIELDS))
MAX_KNOWN = 10_000  # parts that keys are made of in memory, of some kB each


def key_of(experiment: Experiment) -> str:
    """A digest of everything that decides a run, the contents of its files included."""
    return _digest(_deciding(experiment))


def route_key(experiment: Experiment) -> str:
    """A digest of what decides the world and the route of a run."""
    return _route_key(_deciding(experiment))


def views_key(experiment: Experiment) -> str:
    """A digest of what decides the training views of a run; a model from a file learns none."""
    return _views_key(experiment, _deciding(experiment))


def training_key(experiment: Experiment) -> str:
    """A digest of what decides the training of a run."""
    return _training_key(_deciding(experiment))


class Keys:
    """Keys of many experiments: what is equal in those that differ only in their walk, or only in the rest, is computed once."""

    def __init__(self) -> None:
        self._known: dict[tuple[int, ...], tuple[Any, Any]] = {}

    def run(self, experiment: Experiment) -> str:
        """As `key_of`."""
        rest, _ = self._once(_REST, experiment, _rest)
        return _digest(rest | self._once(_WALK, experiment, _walk))

    def shared(self, experiment: Experiment) -> tuple[str, str, str]:
        """As `route_key`, `views_key` and `training_key`."""
        return self._once(_REST, experiment, _rest)[1]

    def _once(self, fields: attrgetter, experiment: Experiment, compute: Callable[[Experiment], Any]) -> Any:
        """What is computed of some fields; those that are the same objects have the same."""
        values = fields(experiment)
        known = self._known.get(same := tuple(map(id, values)))
        if known is None:
            if len(self._known) >= MAX_KNOWN:
                self._known.clear()
            known = self._known[same] = values, compute(experiment)  # holds the values, so that no others get their ids
        return known[1]


def _rest(experiment: Experiment) -> tuple[dict[str, Any], tuple[str, str, str]]:
    deciding = _deciding(experiment)
    return deciding, (_route_key(deciding), _views_key(experiment, deciding), _training_key(deciding))


def _walk(experiment: Experiment) -> dict[str, Any]:
    deciding = _deciding(experiment)
    return {name: deciding[name] for name in WALK_SETTINGS}


def _route_key(deciding: dict[str, Any]) -> str:
    return "path-" + _digest(deciding, ROUTE_SETTINGS)


def _views_key(experiment: Experiment, deciding: dict[str, Any]) -> str:
    learned = "views-" if isinstance(experiment.model, Spec) else "no-views-"
    noisy = experiment.posture.pitch_noise or experiment.posture.roll_noise  # as the seed says
    return learned + _digest(deciding, (*ROUTE_SETTINGS, *VIEW_SETTINGS, *(["seed"] if noisy else [])))


def _training_key(deciding: dict[str, Any]) -> str:
    return "training-" + _digest(deciding, TYPES.keys() - WALK_SETTINGS)


def _deciding(experiment: Experiment) -> dict[str, Any]:
    """What decides a run, by the sorted names of the settings."""
    kept = dict(sorted(settings_of(experiment).items()))
    kept |= {name: experiment.seed if kept[name] is None else kept[name] for name in ("world_seed", "route_seed")}
    kept["encoding"] = (
        experiment.encoding.text_in_files()
    )  # classes by what they are, whatever their names in this process
    model = experiment.model
    kept["model"] = content_of(model) if isinstance(model, Path) else _in_files(model, MODELS)
    kept["navigator"] = _in_files(experiment.navigator, NAVIGATORS)
    if experiment.test_change is not None:
        kept["test_change"] = experiment.test_change.text_in_files()
    if experiment.eye.mask is not None:
        kept["mask"] = str(experiment.eye.mask)  # its pixels, wherever they were read from
    if experiment.eye.compound is not None:
        kept["eye"] = str(experiment.eye.compound)  # likewise
    if experiment.route is not None:
        kept |= {"route": content_of(experiment.route), "route_seed": None, "route_length_m": None}
    databases = {name: getattr(experiment, name) for name in ("route_database", "grid_database")}
    if experiment.route_database is not None:
        kept |= {name: content_of(folder) for name, folder in databases.items() if folder is not None}
        kept |= {"world": None, "world_seed": None, "route_seed": None}
    elif not (isinstance(experiment.world, str) and is_generated(experiment.world)):
        kept |= {"world": content_of(experiment.world), "world_seed": None}
    return kept


def _digest(deciding: dict[str, Any], names: Collection[str] = TYPES) -> str:
    """A digest of what decides a run, of some names."""
    kept = {name: value for name, value in deciding.items() if name in names}
    return hashlib.sha256(json.dumps([VERSION, kept], default=str).encode()).hexdigest()[:16]


def _in_files(spec: Spec, registry: Registry) -> str:
    return format_spec(registry.name_in_files(spec.target), spec.parameters)
