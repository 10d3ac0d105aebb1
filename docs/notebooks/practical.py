# ---
# jupyter:
#   kernelspec:
#     display_name: Python 3
#     language: python
#     name: python3
# ---

# %% [markdown]
# # A two-hour practical
#
# Desert ants find their way home along a route that they have walked before, by what they see. In this practical you
# look through the eye of a simulated ant, let it learn a route, watch it get lost, find out why, and repair it.
#
# You need Python, and no earlier knowledge of insects. The computing takes a few minutes in all: the rest of the two
# hours is for you to think, to change numbers, and to talk.
#
# | part | minutes |
# |---|---|
# | 1. What an ant sees | 20 |
# | 2. How different are two views? | 25 |
# | 3. A walk along a route | 20 |
# | 4. Why it gets lost | 30 |
# | 5. Learning walks | 25 |
#
# Each part ends with an exercise. Write down what you expect **before** you run your code: a wrong guess teaches more
# than a right one. The solutions are at the end, unless your teacher has kept them back.
#
# Run the cells from top to bottom, each with Shift + Enter. The first one loads the library, which may take ten
# seconds. Red text that tells how far it is, or that some views are not learned, is a remark and not an error.

# %%
import time
from collections import Counter
from math import radians

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd

from tussock import (
    Encoding,
    Experiment,
    Eye,
    TrainingSetup,
    draw_panorama,
    draw_world,
    grid_positions,
    heading_field,
    open_renderer,
    rotational,
    translational,
    turn_of_columns,
)

# %% [markdown]
# ## 1. What an ant sees
#
# The world is a field of grass tussocks, ten metres wide. It is generated from a number, the *seed*: the same seed
# gives the same world, and the same route through it. All lengths are in metres.
#
# An `Experiment` holds everything that decides a walk: world, eye, route, what is learned and how. Here we only take
# its world and its route.

# %%
EYE = Eye(width=120, height=25)  # 3 degrees a pixel
experiment = Experiment(world="tussock-field", seed=7, eye=EYE, route_length=4.0)
world, route = experiment.open_world_and_route()


def draw_map(axes, world, route):
    """The part of the world around a route, from above."""
    draw_world(axes, world)
    axes.plot(*route.xy.T, color="white", lw=4, label="route")
    axes.plot(*route.goal[:2], "*", color="white", ms=16, mec="black", label="end of the route")
    low, high = route.xy.min(axis=0) - 0.7, route.xy.max(axis=0) + 0.7
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]))
    axes.set(xlabel="x, to the east (m)", ylabel="y, to the north (m)")


axes = plt.figure(figsize=(7, 6)).add_subplot()
draw_map(axes, world, route)
axes.legend()
plt.show()

# %% [markdown]
# An ant sees almost all around. Its view is drawn as a *panorama*: straight ahead is in the middle, left is on the
# left, and behind is at both edges. The eye is 1 cm above the ground, and sees from 15 degrees below the horizon to
# 60 degrees above it.
#
# A human eye has about 60 pixels in each degree. An ant of the genus *Cataglyphis* has one pixel in about 3 degrees. Below
# is one view at three resolutions.


# %%
def draw_view(axes, view, title):
    """A panorama with its angles."""
    draw_panorama(axes, view, title=title)
    axes.set(yticks=[0, 15, 75], yticklabels=["-15", "0", "60"])
    axes.set(ylabel="elevation (degrees)")


figure, rows = plt.subplots(3, figsize=(8, 8), layout="constrained")
for axes, (width, height) in zip(rows, [(720, 150), (120, 25), (72, 15)], strict=True):
    with open_renderer(world, Eye(width=width, height=height)) as renderer:
        view = renderer.render([route.start])[0]
    draw_view(axes, view, f"{360 / width:g} degrees a pixel")

# %% [markdown]
# The details are gone at 5 degrees a pixel, but the *skyline* is still there: the border between plants and sky.
#
# Before two views are compared, each is *encoded*: some of it is kept, the rest is thrown away. Three encodings are
# used often:
#
# - `grey`: the brightness of each pixel;
# - `sky`: which pixels are sky, and which are not. Ants see this border well, because the sky is bright in ultraviolet
#   light and plants are dark;
# - `edges`: only the vertical edges of the skyline.

# %%
figure, rows = plt.subplots(3, figsize=(8, 8), layout="constrained")
with open_renderer(world, EYE) as renderer:
    view = renderer.render([route.start])
for axes, name in zip(rows, ["grey", "sky", "edges"], strict=True):
    draw_view(axes, Encoding.named(name)(view)[0], name)

# %% [markdown]
# What happens to the panorama when the ant turns? We look from the same point, first along the route, then 90 degrees
# farther to the left. A *pose* is a position and a heading: `(x, y, heading)`. Angles in the code are in radians, and
# count to the left (counter-clockwise).

# %%
x, y, heading = route.start
figure, rows = plt.subplots(2, figsize=(8, 5.5), layout="constrained")
with open_renderer(world, EYE) as renderer:
    ahead, left = renderer.render([(x, y, heading), (x, y, heading + radians(90))])
draw_view(rows[0], ahead, "facing along the route")
draw_view(rows[1], left, "after a turn of 90 degrees to the left")

quarter = EYE.width // 4
rolled = np.roll(ahead, quarter, axis=1)
print("largest difference of a pixel, of 255:", np.abs(rolled.astype(int) - left).max())

# %% [markdown]
# Turning to the left rolls the whole panorama to the right, by 90 of 360 degrees: by a quarter of its columns. So a
# model can find out how a place looks in **every** direction from one single view. Everything below rests on this.
#
# ### Exercise 1: a higher eye
#
# The eye of an ant is 1 cm above the ground. A robot's camera is often 10 or 30 cm above it. Draw the view from the
# start of the route at these three heights. What do you lose when the eye is higher? Would it be easier or harder to
# tell two places apart?
#
# <details style="margin-bottom: 1em"><summary>Hint</summary>
#
# `Eye(z=0.3)` is an eye 30 cm above the ground. Copy the cell with the three resolutions, and change the eye.
#
# </details>

# %%
# Exercise 1: your code

# %% [markdown]
# ## 2. How different are two views?
#
# The *image difference* of two encoded views is the root mean square (RMS) of the differences of their pixels. It is 0
# for two equal views.
#
# Take a stored view. Stand at the same place, turn, and compare at every heading. This is the *rotational image difference
# function* (Zeil, Hofmann and Chahl 2003). Then do the same a little to the side of the place. We do so at twenty places of
# the route, and draw the mean of the curves.

# %%
stored = route.poses[::20]  # every 20 cm of the route: x, y, heading
grey = Encoding.named("grey")
with open_renderer(world, EYE) as renderer:
    curves = rotational(renderer, grey, stored, displacements=[0.0, 0.1, 0.4])


def over_turns(values):
    """Turns from -180 to 180 degrees to the left, and the values at these turns."""
    turns = np.degrees(turn_of_columns(np.arange(len(values)), len(values)))
    order = turns.argsort()
    return turns[order], values[order]


for each in curves:
    label = f"{100 * each.displacement:g} cm to the side"
    plt.plot(*over_turns(each.curve), label=label)
plt.xticks(range(-180, 181, 45))
plt.xlabel("turn to the left of the stored heading (degrees)")
plt.ylabel("image difference (RMS)")
plt.legend()
plt.show()

# %% [markdown]
# At the place of the stored view, the curve falls to 0 where the eye faces as it did. This tells a heading: *turn until
# the difference is least*. This is a **visual compass**. Farther to the side the valley is less deep, so it is easier to
# take another rotation for the right one.
#
# Now keep the heading, and move. This is the *translational* image difference function.

# %%
with open_renderer(world, EYE) as renderer:
    moved = translational(renderer, grey, stored, reach=1.0, steps=20)
for direction, each in moved.items():
    plt.plot(each.distances, each.curve, label=f"moved {direction}")
plt.xlabel("distance from the stored view (m); negative: behind, or to the right")
plt.ylabel("image difference (RMS)")
plt.legend()
plt.show()

# %% [markdown]
# There is a valley again, with the stored view at its lowest point. An agent that moves so that the difference gets less
# finds the stored view, if it begins inside the valley. Farther away the curve goes up and down, and tells little about
# where the stored view is.
#
# ### Exercise 2: how far does a stored view reach?
#
# How many degrees off is the visual compass if the agent stands 10, 20, 40, 80 and 160 cm to the side of the stored view?
# Draw the median error over the distance, and the error that one in ten headings exceeds. Guess first: is the compass
# useless at 80 cm? What error would you get by guessing?
#
# <details style="margin-bottom: 1em"><summary>Hint</summary>
#
# Each result of `rotational` has `errors`, in radians, one for each stored view and side. `np.percentile(errors, 90)` is
# what one in ten exceeds.
#
# </details>

# %%
# Exercise 2: your code

# %% [markdown]
# ## 3. A walk along a route
#
# A route is many stored views. The simplest model keeps them all: *perfect memory*. Its *familiarity* of a view is minus
# the image difference from the most similar stored view. At each step the agent *scans*: it compares the views at many
# headings with its memory, turns to the most familiar heading, and walks 5 cm.
#
# The agent learns a view every 4 cm along the route, each facing along it. Then it starts where the route starts.

# %%
on_the_route = TrainingSetup(spacing=0.04, learning_walk=0.0)  # only views on the route
first = experiment.replace(model="perfect-memory", training=on_the_route)
walk = first.run()

axes = plt.figure(figsize=(7, 6)).add_subplot()
draw_map(axes, world, route)
axes.plot(*walk.xy.T, color="crimson", lw=1.5, label=f"walk: {walk.summary()['reason']}")
axes.legend()
plt.show()

# %% [markdown]
# The agent never knows where it is. It only compares views. Still it walks to the end of the route, and ends within
# 15 cm of it: that counts as *arrived*. It is *lost* where it is more than 50 cm away from the route.
#
# What does one decision look like? `opened` lets the agent learn, and `steps` walks step by step.

# %%
with first.opened() as trained:
    steps = [step for step, _ in first.steps(trained)]

turns, familiarity = over_turns(steps[30].familiarity)
_, scanned = over_turns(steps[30].scanned)
plt.plot(turns, familiarity, color="lightgrey", label="all headings")
plt.plot(turns[scanned], familiarity[scanned], color="navy", label="compared")
plt.axvline(np.degrees(steps[30].aim), color="crimson", label="turn that it makes")
plt.xticks(range(-180, 181, 45))
plt.xlabel("turn to the left (degrees)")
plt.ylabel("familiarity (minus image difference)")
plt.legend()
plt.show()

# %% [markdown]
# It is the curve of part 2, upside down. Familiarity has no unit: only more and less mean something. The agent looks at
# the 180 degrees in front of it.
#
# ### Exercise 3: a start beside the route
#
# Let the agent start 10, 20 and 30 cm to the left of the route, and draw the three paths on one map. Before you run it,
# draw by hand what you expect. Does the agent come back to the route? Does it know the direction?
#
# <details style="margin-bottom: 1em"><summary>Hint</summary>
#
# `first.replace(start_offset=0.1)` is the same experiment, with a start 0.1 m to the left.
#
# </details>

# %%
# Exercise 3: your code

# %% [markdown]
# ## 4. Why it gets lost
#
# The walk above was easy: many views, no errors, a start on the route. Now we make it harder in three ways: fewer
# views, a start beside the route, and noise on every turn. One route proves nothing, so we take six worlds, each with its
# own route.


# %%
six = []  # the first experiment, in six other worlds
for seed in range(1, 7):
    other = first.replace(seed=seed)
    its_world, its_route = other.open_world_and_route()
    six.append(other.replace(world=its_world, route=its_route))  # generated once


def walks(**changes):
    """The walks of the six, with something changed."""
    return [each.replace(**changes).run() for each in six]


def summary_of(walks):
    """How many walks arrived, how far from the route they were, and why they failed."""
    summaries = [walk.summary() for walk in walks]
    causes = Counter(each["cause"] for each in summaries if each["cause"])
    distance = 100 * np.mean([each["mean_deviation_m"] for each in summaries])
    return {
        "arrived": f"{sum(each['arrived'] for each in summaries)} of {len(summaries)}",
        "mean distance from the route (cm)": f"{distance:.1f}",
        "causes of the failures": ", ".join(f"{cause}: {n}" for cause, n in causes.items()),
    }


results = {
    "a view every 4 cm": walks(),
    "a view every 32 cm": walks(training__every=8),
    "a view every 64 cm": walks(training__every=16),
    "start 20 cm to the right": walks(start_offset=-0.2),
    "noise of 20 degrees": walks(body__heading_noise=radians(20)),
    "noise of 40 degrees": walks(body__heading_noise=radians(40)),
}
pd.DataFrame({name: summary_of(each) for name, each in results.items()}).T

# %% [markdown]
# With many views and no noise all agents arrive, or nearly all. With a view every 64 cm hardly any does. A start beside the
# route, or noise, makes some of the others fail. After noise the agent looks again, and corrects its *heading* at the next
# step. But it does not correct its *position*: small displacements add up, and views on the route do not bring it back.
#
# For each failed walk `tussock` gives a *cause*. It measures each step at which the agent heads more than 45 degrees off
# the route, and not back to it either, and takes the first that applies:
#
# | cause | what was measured |
# |---|---|
# | occlusion | a plant within 5 cm covers over a quarter of the view |
# | off the catchment | no view was learned within 25 cm |
# | aliasing | the recognised view was learned over 50 cm away: another place looks the same |
# | unlearned direction | the agent heads back along the route |
# | corner | the route turns by over 45 degrees here |
# | unexplained | none of these |
#
# [Failures](../failures.md) has the details. We look at the walks with few views: where are the poor steps, and what
# are their causes?

# %%
COLOURS = {
    "occlusion": "orange",
    "off the catchment": "crimson",
    "aliasing": "gold",
    "unlearned direction": "violet",
    "corner": "deepskyblue",
    "unexplained": "grey",
}
figure, panels = plt.subplots(2, 3, figsize=(9, 7), layout="constrained")
for axes, each, walk in zip(panels.flat, six, results["a view every 64 cm"], strict=True):
    axes.plot(*each.route.xy.T, color="lightgrey", lw=5)
    axes.plot(*each.route.goal[:2], "*", color="grey", ms=12)
    axes.plot(*walk.xy.T, color="black", lw=1)
    causes = np.array(walk.column("cause"))
    for cause, colour in COLOURS.items():
        axes.plot(*walk.xy[causes == cause].T, "o", color=colour, ms=5, label=cause)
    axes.set(title=f"world {each.seed}: {walk.summary()['reason']}")
    axes.set(aspect="equal", xlabel="x (m)", ylabel="y (m)")
handles, labels = panels[0, 0].get_legend_handles_labels()
figure.legend(handles, labels, loc="outside lower center", ncols=3)
plt.show()

# %% [markdown]
# Most poor steps are *off the catchment*. The catchment of a stored view is the area around it from where the view leads to
# the right heading. With a view every 64 cm there are gaps between the catchments; in a corner the next view faces
# another way. An agent that has left the catchments has nothing to follow. So look not at its last step, but at the first
# coloured one: there the trouble began.
#
# ### Exercise 4: a doctor for agents
#
# With a view every 48 cm, some agents arrive and others do not. Change **one** other thing that the agent has or does. What
# helps, what harms, and what makes no difference? Do the causes change? Try at least two of these, and guess first:
#
# - another encoding: `encoding="sky"` or `encoding="grey"`;
# - shorter steps: `body__step_length=0.02`;
# - a narrower scan: `navigator="scan width_deg=60"`; the usual one is 180 degrees wide;
# - a wider scan: `navigator="scan width_deg=360"`.
#
# <details style="margin-bottom: 1em"><summary>Hint</summary>
#
# `walks(training__every=12, encoding="sky")` gives the six walks, and `summary_of` their summary.
#
# </details>

# %%
# Exercise 4: your code

# %% [markdown]
# ## 5. Learning walks
#
# Before ants leave the nest for the first time to find food, they walk in loops around it, turn, and look back to the
# nest. These *learning walks* give them views from places **beside** their way, which face back to it.
#
# Perfect memory can have such views, too: with `learning_walk=0.2` it learns views up to 20 cm to both sides of the
# route. Each faces the point of the route 30 cm ahead. To see the difference, we ask at many points around the route:
# where would the agent head?

# %%
figure, panels = plt.subplots(1, 2, figsize=(9, 5), layout="constrained", sharey=True)
for axes, reach in zip(panels, (0.0, 0.2), strict=True):
    with first.replace(training__learning_walk=reach).opened() as trained:
        positions = grid_positions(route, grid=0.1, within=0.3, field=world.field)
        model, renderer = trained.model.model, trained.renderer
        field = heading_field(model, first.encoding, renderer, positions)
    axes.plot(*route.xy.T, color="lightgrey", lw=6)
    axes.plot(*route.goal[:2], "*", color="grey", ms=14)
    x, y, heading = field.T
    axes.quiver(x, y, np.cos(heading), np.sin(heading), color="crimson", scale=25, width=0.004)
    axes.set(title=f"learning walk of {100 * reach:g} cm")
    axes.set(aspect="equal", xlabel="x (m)", ylabel="y (m)")

# %% [markdown]
# Without a learning walk the arrows beside the route are parallel to it. The agent knows the *direction* of the route,
# but not on which side of it it stands. With a learning walk the arrows lead back to the route.
#
# Now the walks again, in the six worlds.

# %%
cases = {
    "a view every 4 cm": {},
    "start 20 cm to the right": {"start_offset": -0.2},
    "noise of 20 degrees": {"body__heading_noise": radians(20)},
}
rows = {}
for name, changes in cases.items():
    rows[name, "0 cm"] = summary_of(results[name])  # of part 4
    rows[name, "20 cm"] = summary_of(walks(training__learning_walk=0.2, **changes))
table = pd.DataFrame(rows).T
table.index.names = ["case", "learning walk"]
table

# %% [markdown]
# With a learning walk practically all agents arrive, and stay much nearer to the route. Noise does less harm, too: a
# displacement is corrected at the next steps, before others add to it.
#
# ### Exercise 5: how far must a learning walk reach?
#
# Let agents start 30 cm to the left of the route, with 10 degrees of noise. Compare learning walks of 0, 5, 10
# and 20 cm. Draw how many agents arrive, and how far from the route they are, over the reach. What does a learning walk
# cost?
#
# <details style="margin-bottom: 1em"><summary>Hint</summary>
#
# `walks(start_offset=0.3, body__heading_noise=radians(10), training__learning_walk=0.05)`, and of each walk
# `walk.summary()["arrived"]` and `["mean_deviation_m"]`. `first.replace(...).training_poses(world, route)` are the poses at
# which views are learned.
#
# </details>

# %%
# Exercise 5: your code

# %% [markdown]
# ## What to take home
#
# - From one panorama an agent knows its view at every heading.
# - The image difference has a valley around a stored view, in heading and in position. The heading it tells from farther away.
# - A familiarity model alone is a compass. It leads *along* a route, not *back to* it.
# - Most walks fail because small errors add up until no stored view is near.
# - Views that face the route from the sides make a compass into a guide.
#
# To go on: [learning walks](../learning-walks.md) has more measurements, [models](../models.md) what can take the place
# of perfect memory, and [steering](../steering.md) what can take the place of the scan. *Your own data* and *Your own
# model and navigator* are notebooks like this one.

# %% [markdown]
# ## Solutions
#
# Numbers may differ a little between computers. The answers in words should not.
#
# ### Solution 1: a higher eye

# %%
figure, rows = plt.subplots(3, figsize=(8, 8), layout="constrained")
for axes, z in zip(rows, (0.01, 0.1, 0.3), strict=True):
    with open_renderer(world, Eye(width=120, height=25, z=z)) as renderer:
        view = renderer.render([route.start])[0]
    draw_view(axes, view, f"{100 * z:g} cm above the ground")

# %% [markdown]
# The higher the eye, the less of the near plants is above the horizon: what an ant sees against the sky, the robot sees
# against the ground. What is left of the skyline are far and high plants, which look the same from many places. So places are
# harder to tell apart. On the other hand, views change less as the eye moves: the image difference of part 2 grows more
# slowly with the distance, and each stored view is of use from farther away.

# %% [markdown]
# ### Solution 2: how far does a stored view reach?

# %%
displacements = [0.0, 0.1, 0.2, 0.4, 0.8, 1.6]
with open_renderer(world, EYE) as renderer:
    curves = rotational(renderer, grey, stored, displacements)
off = [np.degrees(np.abs(each.errors)) for each in curves]
centimetres = np.multiply(100, displacements)
plt.plot(centimetres, [np.median(each) for each in off], "o-", label="median")
plt.plot(centimetres, [np.percentile(each, 90) for each in off], "o:", label="one in ten is worse")
plt.axhline(90, color="grey", ls="--", label="median of guessing")
plt.xlabel("distance to the side of the stored view (cm)")
plt.ylabel("error of the heading (degrees)")
plt.legend()
plt.show()

# %% [markdown]
# The error is 0 at the place itself, and grows with the distance. But it is only a few degrees at 80 cm: far plants look the
# same from there, and they set the heading. At 160 cm most headings are still useful, and some may be quite wrong, where a
# near plant has come into view. A compass that guesses is 90 degrees off, as a median: its errors are spread evenly from 0 to
# 180.
#
# So one stored view tells the heading over a much larger distance than it can guide an agent to its place. Remember this for
# exercise 3.

# %% [markdown]
# ### Solution 3: a start beside the route

# %%
axes = plt.figure(figsize=(7, 6)).add_subplot()
draw_map(axes, world, route)
for offset, colour in {0.1: "gold", 0.2: "orange", 0.3: "crimson"}.items():
    walk = first.replace(start_offset=offset).run()
    label = f"{100 * offset:g} cm to the left: {walk.summary()['reason']}"
    axes.plot(*walk.xy.T, color=colour, label=label)
axes.legend(loc="lower right")
plt.show()

# %% [markdown]
# The agents walk about parallel to the route: they know the direction, and do not come back. In corners their errors add up,
# and they walk past the end of the route, or get lost. With luck one may arrive, if a corner leads it to the route.

# %% [markdown]
# ### Solution 4: a doctor for agents

# %%
remedies = {
    "none": {},
    "encoding sky": {"encoding": "sky"},
    "steps of 2 cm": {"body__step_length": 0.02},
    "scan of 60 degrees": {"navigator": "scan width_deg=60"},
    "scan of 360 degrees": {"navigator": "scan width_deg=360"},
}
rows = {}
for name, changes in remedies.items():
    rows[name] = summary_of(walks(training__every=12, **changes))
pd.DataFrame(rows).T

# %% [markdown]
# The narrow scan harms most. In a corner, the next stored view faces to the side, and the agent never looks there: the cause
# is *corner*, or what follows when it has walked on in a wrong direction. The wide scan does no harm here, and may help.
# Another encoding and shorter steps change little: it does not help to look more often at views that tell nothing. With six
# walks, a difference of one or two is chance. To see a small effect you need more worlds; [statistics](../statistics.md) says
# how many. The cure is in part 5.

# %% [markdown]
# ### Solution 5: how far must a learning walk reach?

# %%
reaches = [0.0, 0.05, 0.1, 0.2]
hard = {"start_offset": 0.3, "body__heading_noise": radians(10)}
arrived, distance, views = [], [], []
for reach in reaches:
    summaries = [walk.summary() for walk in walks(training__learning_walk=reach, **hard)]
    arrived.append(sum(each["arrived"] for each in summaries))
    distance.append(100 * np.mean([each["mean_deviation_m"] for each in summaries]))
    learner = first.replace(training__learning_walk=reach)
    views.append(len(learner.training_poses(world, route)))

figure, panels = plt.subplots(1, 3, figsize=(9, 3.2), layout="constrained")
names = ("agents that arrive, of 6", "mean distance from the route (cm)", "number of views")
for axes, values, name in zip(panels, (arrived, distance, views), names, strict=True):
    axes.plot(np.multiply(100, reaches), values, "o-")
    axes.set(xlabel="reach of the learning walk (cm)", ylabel=name, ylim=(0, None))
plt.show()

# %% [markdown]
# The longer the reach, the nearer the agents stay to the route, and from 10 cm on nearly all arrive, although they start
# outside of the learning walk: the views on their side of the route lead them back, and these need not be at their very place,
# as long as it is in the catchment. A reach of 5 cm may look useless in these six worlds. In others it helps: six walks are
# few. The price is memory. With any learning walk, the agent learns seven views for each view on the route. Most of them are
# not needed: add `training__every=12` to a learning walk of 20 cm, and see what becomes of the patients of exercise 4.

# %%
print(f"Processor time of all cores together: {time.process_time():.0f} s")
