"""Familiarity-modulated, and cast and surge: made views whose familiarity is known, turns by hand, and walks in a small world."""

import numpy as np
import pytest
import torch

from tussock.navigation.experiment import Experiment
from tussock.navigation.models.base import Model, model
from tussock.navigation.steering import CastAndSurge, FamiliarityModulated, Look
from tussock.world.errors import SettingError

COLUMNS = 72  # of 5 degrees
CAST, STEP = 75.0, 0.1  # degrees, m


def view(way_deg, unfamiliarity, columns=COLUMNS):
    """A view that is familiar, but for some unfamiliarity, after turning left by an angle, and unfamiliar at all other headings."""
    image = torch.zeros(2, columns)
    image[0, (columns // 2 - round(way_deg / 360 * columns)) % columns] = 1
    image[1] = unfamiliarity
    return image


@model
class Bump(Model):
    """Reads from a view of `view` how familiar it is."""

    name = "bump"

    def _learn(self, views):
        return {"views": views}

    def _shapes(self, height, width):
        return {"views": (None, height, width)}

    def _scan(self, views):
        ahead = torch.stack([views[:, 0].roll(k, dims=1)[:, views.shape[2] // 2] for k in range(views.shape[2])], dim=1)
        return -torch.where(ahead > 0, views[:, 1], views[:, 1].clamp(min=1))


def learned(navigator_class, **parameters):
    navigator = navigator_class(model=Bump(), **parameters)
    navigator.learn(torch.stack([view(0, 0)] * 3))
    return navigator


def look(*views, compass_deg=0.0, walked=0.0):
    n = len(views)
    return Look(views=torch.stack(views), compass=np.full(n, np.radians(compass_deg)), odometry=np.full(n, walked))


@pytest.mark.parametrize(
    ("way_deg", "unfamiliarity", "width_deg", "turn_deg", "step"),
    [
        (0, 0.0, 40, 0, 1.0),
        (0, 0.5, 100, 0, 0.75),
        (60, 0.2, 160, 60, 0.9),
        (-75, 0.0, 160, -75, 1.0),
        (0, 1.0, 160, None, 0.5),
    ],
)
def test_a_scan_is_as_wide_as_the_view_ahead_is_unfamiliar(way_deg, unfamiliarity, width_deg, turn_deg, step):
    navigator = learned(FamiliarityModulated, slowing=0.5)
    motion = navigator.decide(look(view(way_deg, unfamiliarity)), [navigator.begin()])
    assert motion.looks_of(0) == width_deg / 5 + 1
    assert motion.step == pytest.approx([step])
    assert np.degrees(motion.signals["scan_width"]) == pytest.approx([width_deg])
    if turn_deg is not None:
        assert np.degrees(motion.turn) == pytest.approx([turn_deg])


def test_a_way_outside_of_the_scan_is_not_seen():
    navigator = learned(FamiliarityModulated, wide=np.radians(100))
    motion = navigator.decide(look(view(60, 0.0)), [navigator.begin()])
    assert motion.signals["unfamiliarity"] == pytest.approx([1.0])


class Caster:
    """One agent that casts and surges, as it is shown views of a way in a fixed direction of the world."""

    def __init__(self, navigator, mirror=1.0):
        self.navigator, self.memory, self.mirror = navigator, navigator.begin(), mirror
        self.heading, self.walked = 0.0, 0.0  # degrees, m

    def go(self, unfamiliarity, way_deg=0.0):
        """The heading (degrees) that it takes, after a step to where the best view has an unfamiliarity."""
        seen = look(
            view(self.mirror * way_deg - self.heading, unfamiliarity), compass_deg=self.heading, walked=self.walked
        )
        motion = self.navigator.decide(seen, [self.memory])
        self.heading += float(np.degrees(motion.turn[0]))
        self.walked = STEP
        return pytest.approx(self.mirror * self.heading, abs=1e-6)


def test_casts_alternate_and_grow():
    agent = Caster(learned(CastAndSurge, leg=0.3, growth=2.0))
    assert agent.go(0.1, way_deg=20) == 20  # surge
    sides = [20 + CAST] * 3 + [20 - CAST] * 6 + [20 + CAST] * 12 + [20 - CAST]
    assert [agent.go(1.0, way_deg=20) for _ in sides] == sides
    assert agent.go(0.5, way_deg=30) == 30  # surge again ..
    assert [agent.go(1.0) for _ in range(4)] == [30 - CAST] * 3 + [30 + CAST]  # .. and a short leg first


def test_a_first_cast_may_go_right():
    left, right = (learned(CastAndSurge, leg=0.2, first=first) for first in ("left", "right"))
    plain, mirrored = Caster(left), Caster(right, mirror=-1.0)
    for unfamiliarity, way in [(0.2, 20), (1, 20), (1, 0), (1, 0), (0.9, 0), (0.3, -40), (1, 0), (1, 0), (1, 0)]:
        assert mirrored.go(unfamiliarity, way) == plain.go(unfamiliarity, way).expected


def test_a_cast_goes_on_while_familiarity_rises():
    agent = Caster(learned(CastAndSurge, leg=0.2, known=0.3))
    agent.go(1.0)
    assert [agent.go(1.0 - 0.05 * k) for k in range(1, 9)] == [CAST] * 8
    assert agent.go(0.6) == CAST
    assert agent.go(0.9) == -CAST


def test_a_scan_is_centred_on_the_way():
    agent = Caster(learned(CastAndSurge, width=np.radians(60.0)))
    agent.go(0.1)
    assert agent.go(1.0) == CAST
    assert agent.go(0.1, way_deg=25) == 25  # 50 degrees to the right of where it faces


def test_familiarity_between_shows_no_way():
    agent = Caster(learned(CastAndSurge))
    assert agent.go(0.79, way_deg=15) == 15
    assert agent.go(0.81, way_deg=15) == 15 + CAST


def test_what_is_familiar_depends_on_the_most_unfamiliar_view():
    agent = Caster(learned(CastAndSurge, leg=9.0))
    assert [agent.go(unfamiliarity) for unfamiliarity in (0.95, 1.5, 1.25)] == [CAST] * 3
    assert agent.go(0.95, way_deg=15) == 15


@pytest.mark.parametrize("navigator_class", [CastAndSurge, FamiliarityModulated])
def test_agents_side_by_side_go_as_alone(navigator_class):
    navigator = learned(navigator_class)
    shown = [[view(10, 0.2), view(-30, 1.0), view(5, 0.7)], [view(0, 1.0), view(20, 0.1), view(50, 1.0)]]
    together, alone = ([navigator.begin() for _ in range(3)] for _ in range(2))
    for views in shown:
        both = navigator.decide(look(*views, walked=STEP), together)
        for row, (one, memory) in enumerate(zip(views, alone, strict=True)):
            single = navigator.decide(look(one, walked=STEP), [memory])
            assert single.turn[0] == both.turn[row]
            assert {name: each[0] for name, each in single.signals.items()} == {
                name: each[row] for name, each in both.signals.items()
            }


@pytest.mark.parametrize("navigator_class", [CastAndSurge, FamiliarityModulated])
def test_a_navigator_that_has_not_learned_says_so(navigator_class):
    navigator = navigator_class(model=Bump().fit(torch.stack([view(0, 0)])))  # as from a file
    with pytest.raises(SettingError, match="model's name in place of a file"):
        navigator.decide(look(view(0, 0)), [navigator.begin()])


def test_casts_need_an_odometer():
    navigator = learned(CastAndSurge)
    with pytest.raises(SettingError, match="odometer"):
        navigator.decide(Look(views=torch.stack([view(0, 0)]), compass=np.zeros(1)), [navigator.begin()])


@pytest.mark.parametrize(
    ("navigator", "model_name"), [("cast-and-surge", "chain"), ("familiarity-modulated", "perfect-memory")]
)
def test_it_follows_a_route(navigator, model_name):
    trajectory = Experiment(world="tiny", seed=3, navigator=navigator, model=model_name, start_offset=0.05).run()
    assert trajectory.summary()["arrived"]
