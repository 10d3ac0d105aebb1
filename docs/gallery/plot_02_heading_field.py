"""
Where would an agent head?
==========================

The most familiar heading at the points of a grid around a route that perfect memory has learned.
"""

import matplotlib.pyplot as plt
import numpy as np

from tussock import Experiment, draw_world, grid_positions, heading_field

experiment = Experiment(world="tussock-field", seed=7, model="perfect-memory", route_length=4.0)
with experiment.opened() as trained:
    world, route = trained.renderer.world, trained.route
    positions = grid_positions(route, grid=0.25, within=0.7, field=world.field)
    field = heading_field(trained.model.model, experiment.encoding, trained.renderer, positions)

axes = plt.figure(figsize=(7, 7)).add_subplot()
draw_world(axes, world)
axes.plot(*route.xy.T, color="white", lw=3)
axes.quiver(*field[:, :2].T, np.cos(field[:, 2]), np.sin(field[:, 2]), color="crimson", scale=35, zorder=3)
axes.set(
    xlim=(positions[:, 0].min() - 0.2, positions[:, 0].max() + 0.2),
    ylim=(positions[:, 1].min() - 0.2, positions[:, 1].max() + 0.2),
)
