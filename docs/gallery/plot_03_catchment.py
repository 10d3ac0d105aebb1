"""
From where does the image difference lead home?
===============================================

Each point of a lattice about one stored view: how much the best rotation of the view there differs from the stored one, and the points
from which a descent of this landscape ends at the stored view: its catchment.
"""

import matplotlib.pyplot as plt

from tussock import (
    Encoding,
    PerfectMemory,
    Pose,
    World,
    catchment,
    generate_route,
    landscape,
    open_renderer,
    positions_around,
    train,
)

world = World.generate("tussock-field", seed=7)
home = Pose(*generate_route(world, seed=7).poses[100])
encoding = Encoding.named("grey", resize=6)
with open_renderer(world) as renderer:
    trained = train(PerfectMemory(), encoding, renderer, [home])
    poses, spacing = positions_around(renderer, home, grid=0.1, within=1.0)
    ground = landscape(renderer, encoding, trained.model, home, poses, spacing)
found = catchment(ground)

plt.scatter(*poses[:, :2].T, c=ground.difference, marker="s", s=90)
plt.colorbar(label="image difference (RMS)")
plt.plot(*poses[found.inside, :2].T, "w.", label=f"catchment: {found.area:.2f} m²")
plt.plot(home.x, home.y, "r*", ms=14, label="stored view")
plt.legend(loc="upper left", bbox_to_anchor=(0, 1.12), ncol=2)
plt.axis("equal")
