"""
How much a view differs from itself as the eye turns
====================================================

The rotational image difference function (Zeil, Hofmann and Chahl 2003): a view is compared with a stored one at every rotation, here
where it was stored and 0.1 and 0.4 m to its sides. The minimum tells the heading; it gets shallower with the distance.
"""

import matplotlib.pyplot as plt
import numpy as np

from tussock import Encoding, World, generate_route, open_renderer, rotational, turn_of_columns

world = World.generate("tussock-field", seed=7)
stored = generate_route(world, seed=7).poses[[100]]
with open_renderer(world) as renderer:
    found = rotational(renderer, Encoding.named("grey", resize=6), stored, displacements=[0.0, 0.1, 0.4])

for each in found:
    degrees = np.degrees(turn_of_columns(np.arange(len(each.curve)), len(each.curve)))
    order = degrees.argsort()
    plt.plot(degrees[order], each.curve[order], label=f"{each.displacement:g} m beside it")
plt.xticks(range(-180, 181, 45))
plt.xlabel("turn to the left (degrees)")
plt.ylabel("image difference (RMS)")
plt.legend()
