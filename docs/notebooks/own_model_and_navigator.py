# ---
# jupyter:
#   kernelspec:
#     display_name: Python 3
#     language: python
#     name: python3
# ---

# %% [markdown]
# # Your own model and navigator
#
# A *familiarity model* learns views, and tells how familiar other views are. A *navigator* turns what an agent sees into
# motion. In this notebook you write one of each, test them, and compare them with those of `tussock`. Neither needs a change
# in `tussock` itself.

# %%
import copy
from math import radians

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import torch

from tussock import (
    Experiment,
    Eye,
    Motion,
    TrainingSetup,
    draw_world,
    grid_positions,
    heading_errors,
    register,
)

# %% [markdown]
# ## A model
#
# Any class with two methods is a model:
#
# - `fit(views)` learns views. These are encoded: a tensor (n, h, w) of n images with h rows and w columns.
# - `scan(views)` gives the familiarity of each view at **every** rotation: a tensor (n, w). Column k is for the view turned
#   to the left by k columns. Turning to the left rolls a panorama to the right. Higher is more familiar.
#
# The first model keeps only the mean of all views of the route: one picture for the whole way.


# %%
class MeanView:
    """Familiarity is minus the mean difference from the mean of all views."""

    def fit(self, views):
        self.mean = views.mean(dim=0)

    def scan(self, views):
        turned = [views.roll(k, dims=2) for k in range(views.shape[2])]
        differences = [(each - self.mean).abs().mean(dim=(1, 2)) for each in turned]
        return -torch.stack(differences, dim=1)


# %% [markdown]
# The second keeps every view, as perfect memory does, but compares by another measure: the correlation of the pixels. Two
# views that differ in brightness and contrast alone have a correlation of 1.


# %%
class Correlation:
    """Familiarity is the largest correlation with a stored view, -1 to 1."""

    def fit(self, views):
        self.stored = self.standardised(views)

    def scan(self, views):
        views, stored = self.standardised(views), self.stored.flatten(1)
        turned = [views.roll(k, dims=2).flatten(1) for k in range(views.shape[2])]
        return torch.stack([(each @ stored.T).amax(dim=1) for each in turned], dim=1)

    @staticmethod
    def standardised(views):
        """Views with a mean of 0 and a length of 1."""
        centred = views - views.mean(dim=(1, 2), keepdim=True)
        return centred / centred.norm(dim=(1, 2), keepdim=True).clamp(min=1e-6)


# %% [markdown]
# ## Three tests for any model
#
# Test a model before you trust its results. These laws hold for every model of this kind, and find most mistakes:
#
# 1. A learned view is most familiar as it is: not turned.
# 2. If the view is turned, its familiarity is turned with it.
# 3. The familiarity of a view does not depend on the other views that are scanned together with it.
#
# The mean view need not obey the first law for every view. Why not?


# %%
def check_laws(model, seed=0):
    """What of the laws a model obeys, on random images."""
    random = np.random.default_rng(seed)
    views = torch.from_numpy(random.random((6, 10, 36), dtype=np.float32))
    model.fit(views[:3])
    scan, turned, alone = (model.scan(each) for each in (views, views.roll(5, dims=2), views[:1]))
    return {
        "a learned view is most familiar as it is": bool((scan[:3].argmax(dim=1) == 0).all()),
        "familiarity turns with the view": torch.allclose(turned, scan.roll(-5, dims=1), atol=1e-5),
        "views do not depend on each other": torch.allclose(alone, scan[:1], atol=1e-5),
    }


pd.DataFrame({model.__name__: check_laws(model()) for model in (MeanView, Correlation)})

# %% [markdown]
# ## How good is it as a compass?
#
# The agent learns a route, and recovers its heading at the points of a grid around it. An experiment takes a class in place of
# a model's name. The same route, eye and encoding for all: then only the model differs.

# %%
base = Experiment(
    world="tussock-field",
    seed=7,
    eye=Eye(width=120, height=25),
    encoding="grey | resize 2",  # 6 degrees a pixel
    route_length=4.0,
)
compass = base.replace(training=TrainingSetup(learning_walk=0.0))
world, route = compass.open_world_and_route()
compass = compass.replace(world=world, route=route)  # generated once
positions = grid_positions(route, grid=0.1, within=0.4, field=world.field)

models = {
    "perfect memory": "perfect-memory",
    "infomax": "infomax",
    "mean view": MeanView,
    "correlation": Correlation,
}
errors = {}
for name, model in models.items():
    with compass.replace(model=model).opened() as trained:
        learned, renderer = trained.model.model, trained.renderer
        errors[name] = heading_errors(learned, compass.encoding, renderer, route, positions)

for name, found in errors.items():
    bands = found.by_distance()
    plt.plot(list(bands), [each.median_error_deg for each in bands.values()], "o-", label=name)
plt.axhline(90, color="grey", ls="--", label="guessing")
plt.xticks(rotation=45)
plt.xlabel("distance from the route")
plt.ylabel("error of the heading, median (degrees)")
plt.legend()
plt.show()

# %% [markdown]
# The models that keep all views have the smallest errors, and are nearly equal: on these views it matters little by which
# measure they are compared. One mean picture knows less, but much more than nothing. It shows what all views of the route
# share: far and high plants. On a crooked route it would be worse.
#
# ## Walk it
#
# A name makes a model usable everywhere in this process: in experiments, and in their specs with parameters.

# %%
register("models", "correlation", Correlation)
walk = base.replace(model="correlation", start_offset=0.1).run()
print(walk.summary()["reason"])

# %% [markdown]
# On the command line, no registration is needed. If the class is in a file `my_models.py` in the current folder:
#
# ```sh
# tussock run --model my_models:Correlation --offset-m 0.1 --out walk
# tussock compare --models perfect-memory,my_models:Correlation
# ```
#
# Derived from `tussock.navigation.models.base.Model`, a class has parameters that are checked (`--model "nearest power=2"`), and is
# saved in files. [Extending](../extending.md) has an example, and how a package offers its classes to everyone who
# installs it.
#
# ## A navigator
#
# A scan compares the view at many headings for each step. Insects do not seem to: they walk without stopping to look around.
# A navigator with **one look a step** is a class with three methods:
#
# - `learn(views)`: the views of the route, in their order.
# - `begin()`: what one agent remembers when a walk begins; here nothing, so None.
# - `decide(look, memories)`: how the agents move. `look.views` are their encoded views (n, h, w), and the answer is a
#   `Motion` with a turn for each (rad, left is positive).
#
# A navigator steers any number of agents at once. It never gets to know where they are.
#
# Ours has two memories: of views turned to the left of the way, and of views turned to its right. If the present view is
# more familiar to the left memory, the agent faces too far to the left, and turns right.


# %%
class TwoSides:
    """Turns away from the side whose memory knows the view better."""

    def __init__(self, model):
        self.left, self.right = copy.deepcopy(model), copy.deepcopy(model)

    def learn(self, views):
        columns = views.shape[2] // 8  # of 45 degrees
        self.left.fit(views.roll(columns, dims=2))  # turned to the left: rolled to the right
        self.right.fit(views.roll(-columns, dims=2))

    def begin(self):
        return None

    def decide(self, look, memories):
        left = -self.left.scan(look.views)[:, 0].numpy()  # difference from the left memory
        right = -self.right.scan(look.views)[:, 0].numpy()
        turn = np.clip(4 * (left - right) / (left + right), -1, 1)
        return Motion(turn=turn, signals={"left": left, "right": right})


register("navigators", "two-sides", TwoSides)

# %% [markdown]
# Where both memories find the view equally strange, the agent faces along the way, and walks straight on. Compare it with the scan:

# %%
learned = base.replace(start_offset=0.2, training=TrainingSetup(learning_walk=0.2))
figure, (above, below) = plt.subplots(2, figsize=(7, 9), height_ratios=(2, 1))
draw_world(above, world)
above.plot(*route.xy.T, color="white", lw=4, label="route")
for navigator, colour in {"scan": "navy", "two-sides": "crimson"}.items():
    walk = learned.replace(navigator=navigator).run()
    summary = walk.summary()
    label = f"{navigator}: {summary['reason']}, {summary['looks_per_m']:.0f} looks a metre"
    above.plot(*walk.xy.T, color=colour)
    centimetres = 100 * np.array(walk.column("deviation_m"))
    below.plot(walk.column("along_m"), centimetres, color=colour, label=label)
low, high = route.xy.min(axis=0) - 0.7, route.xy.max(axis=0) + 0.7
above.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]))
below.set(xlabel="distance along the route (m)", ylabel="distance from the route (cm)")
below.legend()
figure.tight_layout()
plt.show()

# %% [markdown]
# Both come back to the route, and follow it. The new one does so with one look a step, where the scan takes dozens.
# Its `signals` are not needed for that. They are kept in `walk.signals`, in the recording and in `trajectory.csv`, and show
# what the navigator decided by: the agent turns to and fro, and looks a little to the left of the way, and a little to the
# right.

# %%
left, right = (np.array([each[side] for each in walk.signals]) for side in ("left", "right"))
plt.plot(walk.column("along_m"), left, label="difference from the left memory")
plt.plot(walk.column("along_m"), right, label="difference from the right memory")
plt.xlabel("distance along the route (m)")
plt.ylabel("image difference (RMS)")
plt.legend()
plt.show()

# %% [markdown]
# ## A navigator that remembers
#
# What an agent remembers between two looks is made by `begin`, and changed by `decide`. The next agent turns to the left and to
# the right in turn, far where the view is strange, and little where it is familiar: a zigzag, as ants walk that are not sure.


# %%
class Zigzag:
    """Turns to either side in turn, the farther the less familiar the view is."""

    def __init__(self, model):
        self.model = model

    def learn(self, views):
        self.model.fit(views)
        across = views.roll(views.shape[2] // 4, dims=2)
        self.strange = -self.model.scan(across)[:, 0].numpy().mean()  # across the way

    def begin(self):
        return {"side": 1.0}

    def decide(self, look, memories):
        difference = -self.model.scan(look.views)[:, 0].numpy()
        sides = np.array([memory["side"] for memory in memories])
        for memory in memories:
            memory["side"] *= -1
        return Motion(turn=sides * radians(60) * np.clip(difference / self.strange, 0, 1))


register("navigators", "zigzag", Zigzag)
walk = learned.replace(navigator="zigzag", start_offset=0.0).run()
axes = plt.figure(figsize=(7, 6)).add_subplot()
axes.plot(*route.xy.T, color="lightgrey", lw=6, label="route")
axes.plot(*walk.xy.T, color="crimson", label=f"zigzag: {walk.summary()['reason']}")
axes.set(xlabel="x (m)", ylabel="y (m)", aspect="equal")
axes.legend()
plt.show()

# %% [markdown]
# It finds part of the way, or all of it, and is not a good navigator yet. Make it better:
#
# - Let it turn less at each step, and keep its side for several steps.
# - Let it remember the difference of the look before, and change sides only where that has become larger.
# - Let it make shorter steps where the view is strange: `Motion(turn=..., step=...)`, with shares of a step from 0 to 1.
#
# Judge each change in several worlds (`seed=1`, `seed=2`, ..), not in the one that you looked at. The navigators of `tussock`
# are in [steering](../steering.md). Its `lateral` and `oscillator` work as the two that you have just written, with more care.
