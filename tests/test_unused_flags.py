"""Flags that change nothing in a run are named."""

import pytest

from tussock.navigation.cli.unused_flags import unused_flags
from tussock.navigation.experiment_settings import TYPES, experiment_of

DEFAULTS = {"world": "tiny"}


def unused(**given) -> dict[str, str]:
    assert set(given) <= set(TYPES)
    return unused_flags(experiment_of(DEFAULTS | given))


@pytest.mark.parametrize(
    ("given", "flag", "needed"),
    [
        ({"release_deg": 30.0}, "--release-deg", "--release-m"),
        ({"displace_at": 0.2}, "--displace-at", "--displace-m"),
        ({"body_radius_m": 0.01}, "--body-radius-m", "--collisions"),
        ({"goal_turns": 3.0}, "--goal-turns", "--goal-walk-m"),
        ({"waypoint_m": 0.2}, "--waypoint-m", "--on-lost"),
        ({"change_seed": 3}, "--change-seed", "--test-change"),
        ({"goal_walk_m": 0.5, "goal_only": True, "spacing_m": 0.1}, "--spacing-m", "--goal-only"),
        ({"spectrum": "insect"}, "--spectrum", "foreground-mask"),
        ({"spectrum": "insect", "encoding": "green"}, "--spectrum", "green-channel"),
        ({"senses": "ant"}, "--senses", "scan"),
        ({"senses": "ant", "navigator": "lateral"}, "--senses", "lateral"),
        ({"model": "infomax", "navigator": "path-integration"}, "--model", "path-integration"),
    ],
)
def test_a_flag_that_changes_nothing_is_named(given, flag, needed):
    ((named, reason),) = unused(**given).items()
    assert named == flag
    assert needed in reason


@pytest.mark.parametrize(
    "given",
    [
        {},
        {"release_deg": 30.0, "release_m": 0.5},
        {"displace_at": 0.2, "displace_m": 0.1},
        {"body_radius_m": 0.01, "collisions": "slide"},
        {"waypoint_m": 0.2, "on_lost": "reset"},
        {"change_seed": 3, "test_change": "mown amount=1"},
        {"spectrum": "insect", "encoding": "uv"},
        {"senses": "ant", "scan_about_deg": 40.0},
        {"senses": "ant", "navigator": "path-integration"},
        {"model": "infomax", "navigator": "lateral"},
    ],
)
def test_others_are_not(given):
    assert unused(**given) == {}
