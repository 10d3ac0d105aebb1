"""
Home by path integration
========================

An agent knows how far and in which direction home is, by its compass and the distance that it walked. It needs no view, and takes the
straight way; how near it comes depends on its senses. An ant's are so noisy here that views must take over.
"""

import matplotlib.pyplot as plt

from tussock import Experiment, StoppingRules, draw_world

off_the_route = StoppingRules(max_deviation=3.0)  # the straight way is far from it
base = Experiment(world="tiny", seed=3, navigator="path-integration", stopping=off_the_route)
world, route = base.open_world_and_route()
axes = plt.figure(figsize=(6, 6)).add_subplot()
draw_world(axes, world)
axes.plot(*route.xy.T, color="white", lw=4)
axes.plot(*route.goal[:2], "*", color="white", ms=18)
for senses, colour in {"robot": "crimson", "ant": "navy"}.items():
    for seed in range(4):
        walk = base.replace(world=world, route=route, seed=seed, senses=senses).run()
        axes.plot(*walk.xy.T, color=colour, label=f"{senses}: {walk.summary()['goal_m']:.2f} m from home")
axes.legend(fontsize="small")
