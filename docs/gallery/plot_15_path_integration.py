"""
Home by path integration
========================

An agent knows how far and in which direction home is, by its compass and the distance that it walked, with the noise of an ant's senses.
It needs no view, and ends near home, where views can take over.
"""

import matplotlib.pyplot as plt

from tussock import Experiment, draw_world

base = Experiment(world="tiny", seed=3, navigator="path-integration", senses="ant")
world, route = base.open_world_and_route()
axes = plt.figure(figsize=(6, 6)).add_subplot()
draw_world(axes, world)
axes.plot(*route.xy.T, color="white", lw=4)
for seed in range(5):
    walk = base.replace(world=world, route=route, seed=seed).run()
    axes.plot(*walk.xy.T, label=f"{walk.summary()['goal_m']:.2f} m from home")
axes.legend()
