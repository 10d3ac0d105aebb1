"""
Several routes to one nest
==========================

One memory learns three routes that end at the same place. The agent walks home from the start of each,
and may change from one route to another on its way.
"""

import matplotlib.pyplot as plt
import numpy as np

from tussock import (
    Encoding,
    PerfectMemory,
    Scan,
    StoppingRules,
    Walk,
    World,
    draw_world,
    generate_route,
    open_renderer,
    train,
    training_poses,
)

world, goal = World.generate("tussock-field", seed=7), (5.0, 5.0)
routes = [generate_route(world, seed=seed, length=3.5, goal=goal) for seed in (1, 2, 3)]
encoding = Encoding.named("edges", resize=6)
axes = plt.figure(figsize=(7, 7)).add_subplot()
draw_world(axes, world)
with open_renderer(world) as renderer:
    poses = np.concatenate([training_poses(route, spacing=0.04, learning_walk=0.2) for route in routes])
    trained = train(PerfectMemory(), encoding, renderer, poses)
    for route in routes:
        walk = Walk(
            renderer=renderer,
            encoding=encoding,
            route=route,
            starts=[route.start],
            stopping=StoppingRules(max_deviation=2.0),
        )
        path = np.array([step.pose[:2] for (step,) in walk.steps(Scan(model=trained.model))])
        axes.plot(*route.xy.T, color="white", lw=4)
        axes.plot(*path.T, color="crimson")
axes.plot(*goal, "*", color="white", ms=18, mec="black")
axes.set(xlim=(2.5, 8), ylim=(1.5, 8))
