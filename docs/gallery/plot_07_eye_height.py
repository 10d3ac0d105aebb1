"""
An eye that is mounted higher
=============================

The same place, seen 1, 10 and 30 cm above the ground. What stands near disappears below the horizon, and the views grow alike.
"""

import matplotlib.pyplot as plt

from tussock import Eye, World, draw_panorama, generate_route, open_renderer

world = World.generate("tussock-field", seed=7)
pose = generate_route(world, seed=7).start
figure, rows = plt.subplots(3, figsize=(8, 6), layout="constrained")
for axes, height in zip(rows, (0.01, 0.1, 0.3), strict=True):
    with open_renderer(world, Eye(z=height)) as renderer:
        draw_panorama(axes, renderer.render([pose])[0], title=f"{100 * height:g} cm above the ground")
