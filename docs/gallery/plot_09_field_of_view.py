"""
An eye that does not see all around
===================================

The same walk with fields of view of 360, 180 and 60 degrees. What is outside the field is hidden from the model, exactly, at all
rotations.
"""

from math import radians

import matplotlib.pyplot as plt

from tussock import Experiment, Eye

for degrees in (360, 180, 60):
    eye = Eye(field=radians(degrees))
    walk = Experiment(world="tussock-field", seed=7, eye=eye, route_length=4.0, start_offset=0.1).run()
    plt.plot(walk.column("along_m"), walk.column("deviation_m"), label=f"{degrees}°: {walk.summary()['reason']}")
plt.xlabel("distance along the route (m)")
plt.ylabel("distance from the route (m)")
plt.legend()
