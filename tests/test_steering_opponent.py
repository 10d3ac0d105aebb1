"""Opponent and oscillator: turns by hand from known familiarities, and walks that come home."""

import math

import numpy as np
import pytest
import torch

from tussock.navigation.experiment import Experiment
from tussock.navigation.steering import Look, Opponent, Oscillator
from tussock.navigation.stopping import StoppingRules
from tussock.navigation.training_setup import TrainingSetup
from tussock.render.eye import Eye
from tussock.world.errors import SettingError

WIDTH = 8
DEGREES = np.degrees
VIEWS = torch.eye(WIDTH)[None, 0][:, None].repeat(3, 1, 1)  # of a mark behind on the left; facing along the way


class Mark:
    """Familiarity falls by 1 with each column between a view's mark and the learned one, at most by WIDTH / 2."""

    def fit(self, views):
        self.column = int(views[0, 0].argmax())
        return self

    def scan(self, views):
        turned = torch.stack([views.roll(k, dims=2)[:, 0].argmax(dim=1) for k in range(WIDTH)], dim=1)
        away = (turned - self.column) % WIDTH
        return -torch.minimum(away, WIDTH - away).float()


def trained(kind, **parameters):
    navigator = kind(model=Mark(), **parameters)
    navigator.learn(VIEWS)
    return navigator


def look(*columns):
    """What agents see that have turned left by some columns from the way."""
    return Look(views=torch.stack([VIEWS[0].roll(k, dims=1) for k in columns]), compass=np.zeros(len(columns)))


def turns(navigator, *looks):
    """Turns (degrees) of one agent at successive looks."""
    memory = navigator.begin()
    return [float(DEGREES(navigator.decide(look(k), [memory]).turn[0])) for k in looks]


def test_both_memories_by_hand():
    motion = (navigator := trained(Opponent)).decide(look(0, 2, 4, 1), [navigator.begin() for _ in range(4)])
    assert motion.signals["attractive"] == pytest.approx([0, 0.5, 1, 0.25])  # in columns: 0, 2, 4, 1 of 4
    assert motion.signals["repulsive"] == pytest.approx([1, 0.5, 0, 0.75])
    assert pytest.approx([0, 90, 180, 0]) == DEGREES(motion.turn)
    assert turns(trained(Opponent, gain=math.radians(60)), 1, 1, 3) == pytest.approx([60, -60, 120])


@pytest.mark.parametrize(("memories", "expected"), [("attractive", [20, -45, 70]), ("repulsive", [-30, 55, -80])])
def test_one_memory_by_hand(memories, expected):
    baseline = 20 if memories == "attractive" else 130
    first = "left" if memories == "attractive" else "right"
    navigator = trained(
        Opponent, memories=memories, baseline=math.radians(baseline), gain=math.radians(50), first=first, unit=2.0
    )
    (other,) = {"attractive", "repulsive"} - {memories}
    assert getattr(navigator, other) is None
    assert turns(navigator, 0, 1, 2) == pytest.approx(expected)


def test_a_unit_is_a_difference_of_familiarity():
    assert turns(trained(Opponent, unit=4.0, gain=0.5), 1) == pytest.approx(turns(trained(Opponent, gain=0.5), 1))
    motion = (navigator := trained(Opponent, unit=0.5)).decide(look(1), [navigator.begin()])
    assert motion.signals["attractive"] == pytest.approx([2])


@pytest.mark.parametrize("gain", [0.0, 1e5])
def test_turns_are_at_most_half_a_turn(gain):
    found = np.abs(turns(trained(Opponent, gain=gain, baseline=math.pi / 2), 0, 1, 2, 3, 4))
    assert (found <= 180).all()
    assert pytest.approx([90] * 5 if gain == 0 else [0, 0, 90, 180, 180]) == found


def test_an_oscillation_by_hand():
    settings = {"base": math.radians(10), "gain": math.radians(40)}
    assert turns(trained(Oscillator, period=2.0, **settings), 0, 4, 2) == pytest.approx([10, -50, 30])
    quarter = math.sqrt(0.5)
    slow = turns(trained(Oscillator, period=4.0, **settings), 0, 0, 0, 0, 4)
    assert slow == pytest.approx([10 * quarter, 10 * quarter, -10 * quarter, -10 * quarter, 50 * quarter])
    assert turns(trained(Oscillator, period=2.0, max_turn=0.1, **settings), 4) == pytest.approx([np.degrees(0.1)])


@pytest.mark.parametrize("period", [2.0, 3.0, 4.5, 7.0])
def test_an_oscillation_keeps_its_heading_where_nothing_changes(period):
    found = np.cumsum(turns(trained(Oscillator, period=period), *[0] * 18 * 7 * 2))
    assert np.abs(found).max() <= np.radians(20) * 180 / np.pi * period  # it swings and does not drift
    assert found[-1] == pytest.approx(0, abs=1e-6)


@pytest.mark.parametrize(("kind", "parameters"), [(Opponent, {}), (Oscillator, {}), (Oscillator, {"period": 2.0})])
def test_the_other_first_side_turns_the_other_way(kind, parameters):
    looks = [0, 3, 1, 4, 2, 2, 0]
    left, right = (turns(trained(kind, first=first, **parameters), *looks) for first in ("left", "right"))
    assert np.array(left) == pytest.approx(-np.array(right))
    assert np.any(left)


def test_agents_keep_their_own_side():
    navigator = trained(Opponent)
    first, second = navigator.begin(), navigator.begin()
    navigator.decide(look(2), [first])
    assert DEGREES(navigator.decide(look(2, 2), [first, second]).turn) == pytest.approx([-90, 90])


def test_what_cannot_be_is_refused():
    for parameters in ({"memories": "none"}, {"unit": 0.0}, {"first": "up"}, {"gain": -1.0}):
        with pytest.raises(SettingError, match="Opponent"):
            Opponent(model=Mark(), **parameters)
    with pytest.raises(SettingError, match="period"):
        Oscillator(model=Mark(), period=1.0)


SMALL = Experiment(
    world="tiny",
    route_length=2.0,
    eye=Eye(width=90, height=19, samples=2),
    encoding="foreground-mask | blur 1",
    threads=1,
    stopping=StoppingRules(max_deviation=1.0, patience=20.0, max_steps=400),
)
SIGNALS = {"opponent": {"attractive", "repulsive"}, "oscillator": {"unfamiliarity", "phase"}}


@pytest.mark.parametrize("seed", [101, 103])
@pytest.mark.parametrize(
    ("navigator", "views"), [("opponent", {"eye": Eye(width=360, height=75), "encoding": "edges"}), ("oscillator", {})]
)
def test_walks_arrive(navigator, views, seed):
    walk = SMALL.replace(navigator=navigator, seed=seed, **views).run()
    assert walk.summary()["arrived"]
    assert set(walk.signals[0]) == SIGNALS[navigator]


def test_agents_stay_about_the_nest():
    """With both memories the agent searches where it has learned; one that turns by the baseline alone walks away."""
    base = SMALL.replace(
        seed=103,
        training=TrainingSetup(goal_walk=0.5, goal_only=True),
        stopping=StoppingRules(arrival_radius=1e-6, max_deviation=100.0, patience=1e4, max_steps=150),
        release=0.5,
    )
    home, away = (base.replace(navigator=each).run().column("goal_m") for each in ("opponent", "opponent gain=0"))
    assert max(home[-50:]) < 0.6
    assert away[-1] > 0.9
