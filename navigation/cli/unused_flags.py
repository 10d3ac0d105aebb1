"""Flags of a run that change nothing, because another flag, or the navigator, makes no use of them."""

import logging

from tussock.world.specs import takes

from ..encoding_steps import ForegroundMask
from ..encoding_steps_colour import GreenBlue
from ..encoding_steps_ultraviolet import GreenChannel
from ..experiment import Experiment
from ..models.random import RandomHeadings
from ..settings_table import read_settings

log = logging.getLogger(__name__)

# What each of these flags needs: another that is not as by default.
_NEEDED = {
    "release_deg": "release_m",
    "displace_at": "displace_m",
    "body_radius_m": "collisions",
    "goal_turns": "goal_walk_m",
    "goal_views": "goal_walk_m",
    "goal_spread_deg": "goal_walk_m",
    "waypoint_m": "on_lost",
    "put_back_ahead_m": "on_lost",
    "body_length_m": "gaze",
    "overlap_deg": "side",
    "change_seed": "test_change",
}
_OF_THE_ROUTE = ("spacing_m", "every", "parallel_views", "learning_walk_m")  # what --goal-only makes useless


def warn_of_unused_flags(experiment: Experiment) -> None:
    """Name, in one warning each, the settings of a run that are not as by default and change nothing."""
    for flag, reason in unused_flags(experiment).items():
        log.warning("%s changes nothing %s", flag, reason)


def unused_flags(experiment: Experiment) -> dict[str, str]:
    """The flags that change nothing in a run, and why."""
    default = read_settings(Experiment())
    given = {name for name, value in read_settings(experiment).items() if value != default[name]}
    if experiment.stopping.put_back:
        given.add("on_lost")
    unused = {
        name: f"without {_flag(needed)}" for name, needed in _NEEDED.items() if name in given and needed not in given
    }
    eye = experiment.eye
    if "overlap_deg" in given and eye.compound is not None and eye.compound.ommatidia().side.all():
        unused["overlap_deg"] = "with an eye whose ommatidia belong to a side"
    if "spectrum" in given and isinstance(experiment.encoding.steps[0], ForegroundMask | GreenChannel | GreenBlue):
        unused["spectrum"] = f"with the encoding {str(experiment.encoding)!r}, which sees neither red nor ultraviolet"
    if experiment.training.goal_only:
        unused |= {name: "with --goal-only" for name in _OF_THE_ROUTE if name in given}
    navigator, name = experiment.navigator, str(experiment.navigator)
    if "model" in given and not takes(navigator.target, "model"):
        unused["model"] = f"with the navigator {name!r}, which takes no model"
    if "senses" in given and not getattr(
        navigator.make(model=RandomHeadings(), seed=experiment.seed), "reads_senses", True
    ):
        unused["senses"] = f"with the navigator {name!r}, which reads neither compass nor odometer"
    return {_flag(name): reason for name, reason in unused.items()}


def _flag(name: str) -> str:
    return f"--{name.replace('_', '-')}"
