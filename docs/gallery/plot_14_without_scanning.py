"""
Steering without scanning
=========================

A scan looks in sixty directions at each step. The navigator ``lateral`` looks in one: two memories, of views to the left and to the
right of the way, are compared, and their difference steers.
"""

import matplotlib.pyplot as plt

from tussock import Experiment

for navigator in ("scan", "lateral"):
    walk = Experiment(world="tussock-field", seed=7, navigator=navigator, start_offset=0.2).run()
    looks = walk.summary()["looks_per_m"]
    plt.plot(walk.column("along_m"), walk.column("deviation_m"), label=f"{navigator}: {looks:.0f} looks a metre")
plt.xlabel("distance along the route (m)")
plt.ylabel("distance from the route (m)")
plt.legend()
