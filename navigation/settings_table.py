"""The settings of an experiment: names with units, their types, and the fields that they are of. Light to import."""

import math
from collections.abc import Mapping
from operator import attrgetter
from pathlib import Path
from typing import Any

from tussock.world.change import Change
from tussock.world.specs import Spec

# Type of each setting, in the order of a table's columns, and the field of `Experiment` that it is: of itself, or, after a point, of
# one of its settings. Settings without a field are those that need more than that. To add one: a field of `Experiment` or of the
# settings that it consists of; a line here (and in WALK_SETTINGS of experiment_keys.py if it changes only the walk); and a flag of
# `RunOptions` in cli/options.py. It is part of the key of a run from then on, so no runs are added to earlier folders of sweeps.
_SETTINGS: dict[str, tuple[Any, str]] = {
    "world": (str | None, "world"),
    "world_seed": (int | None, "world_seed"),
    "up": (str, "reading.up"),
    "unit": (str, "reading.unit"),
    "scale": (float | None, "reading.scale"),
    "strict": (bool, "reading.strict"),
    "ground": (str, "ground"),
    "max_slope_deg": (float, "max_slope"),
    "altitude_m": (float | None, "altitude"),
    "seed": (int, "seed"),
    "size": (str | None, ""),
    "renderer": (str, "renderer"),
    "samples": (int | None, "eye.samples"),
    "eye_height_m": (float, "eye.z"),
    "top_deg": (float, "eye.top"),
    "bottom_deg": (float, "eye.bottom"),
    "field_deg": (float | None, "eye.field"),
    "side": (str, "eye.side"),
    "overlap_deg": (float, "eye.overlap"),
    "mask": (str | None, "eye.mask"),
    "eye": (str | None, "eye.compound"),
    "spectrum": (str, "eye.spectrum"),
    "cull_back_faces": (bool, "cull_back_faces"),
    "light": (str | None, "light"),
    "gaze": (str, "posture.gaze"),
    "body_length_m": (float, "posture.body_length"),
    "pitch_noise_deg": (float, "posture.pitch_noise"),
    "roll_noise_deg": (float, "posture.roll_noise"),
    "route": (Path | None, "route"),
    "route_seed": (int | None, "route_seed"),
    "route_length_m": (float, "route_length"),
    "headings": (str, "headings"),
    "columns": (str | None, "columns"),
    "smooth_m": (float, "smooth"),
    "encoding": (str | None, ""),
    "resize": (float | None, ""),
    "blur": (float, ""),
    "spacing_m": (float, "training.spacing"),
    "every": (int, "training.every"),
    "learning_walk_m": (float, "training.learning_walk"),
    "parallel_views": (int, "training.parallel_views"),
    "goal_walk_m": (float, "training.goal_walk"),
    "goal_turns": (float, "training.goal_turns"),
    "goal_views": (int, "training.goal_views"),
    "goal_spread_deg": (float, "training.goal_spread"),
    "goal_only": (bool, "training.goal_only"),
    "device": (str, "device"),
    "model": (str, "model"),
    "threads": (int | None, "threads"),
    "step_m": (float, "body.step_length"),
    "offset_m": (float, "start_offset"),
    "heading_noise_deg": (float, "body.heading_noise"),
    "collisions": (str, "body.collisions"),
    "body_radius_m": (float, "body.radius"),
    "senses": (str, "senses"),
    "release_m": (float, "release"),
    "release_deg": (float, "release_direction"),
    "displace_at": (float, "displacement.at"),
    "displace_m": (float, "displacement.left"),
    "scan_deg": (float | None, ""),
    "scan_about_deg": (float | None, ""),
    "test_change": (str | None, "test_change"),
    "change_seed": (int | None, "change_seed"),
    "on_lost": (str, ""),
    "waypoint_m": (float, "stopping.waypoint_spacing"),
    "put_back_ahead_m": (float | None, "stopping.put_back_ahead"),
    "arrive_m": (float, "stopping.arrival_radius"),
    "lost_m": (float, "stopping.max_deviation"),
    "patience_m": (float, "stopping.patience"),
    "max_steps": (int | None, "stopping.max_steps"),
    "navigator": (str, ""),
    "route_database": (Path | None, "route_database"),
    "grid_database": (Path | None, "grid_database"),
}
TYPES: dict[str, Any] = {name: kind for name, (kind, _) in _SETTINGS.items()}
FIELDS = {name: field for name, (_, field) in _SETTINGS.items() if field}


def fields_of(given: Mapping[str, Any], owner: str = "") -> dict[str, Any]:
    """Those of some settings that are fields of `Experiment`, or of the settings in its field `owner`, by these fields."""
    split = {name: FIELDS[name].rpartition(".") for name in given if name in FIELDS}
    return {field: as_field(name, given[name]) for name, (at, _, field) in split.items() if at == owner}


def read_settings(experiment: Any) -> dict[str, Any]:
    """All settings by name; those without a field are None."""
    return {name: as_setting(name, attrgetter(FIELDS[name])(experiment)) if name in FIELDS else None for name in TYPES}


def as_field(name: str, value: Any) -> Any:
    """A setting of this name as a field: an angle in radians."""
    return math.radians(value) if name.endswith("_deg") else value


def as_setting(name: str, value: Any) -> Any:
    """A field as a setting of this name: an angle in degrees, a path or a spec as text."""
    if isinstance(value, Path | Spec | Change):
        return str(value)
    return degrees(value) if name.endswith("_deg") and value is not None else value


def degrees(angle: float) -> float:
    """An angle (rad) in degrees: the number that was given, where it was given in degrees."""
    value = math.degrees(angle)
    candidates = (round(value, 9), value, math.nextafter(value, math.inf), math.nextafter(value, -math.inf))
    return next((each for each in candidates if math.radians(each) == angle), value)
