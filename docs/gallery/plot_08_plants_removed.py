"""
Plants removed
==============

The route is learned, then 30 and 60 % of all plants of the world are taken away: does the agent still find home?
"""

import matplotlib.pyplot as plt

from tussock import Encoding, PerfectMemory, Scan, Walk, World, generate_route, open_renderer, train, training_poses

world = World.generate("tussock-field", seed=7)
route = generate_route(world, seed=7, length=4.0)
encoding = Encoding.named("edges", resize=6)
with open_renderer(world) as renderer:
    trained = train(PerfectMemory(), encoding, renderer, training_poses(route, spacing=0.04, learning_walk=0.2))
for share in (0.0, 0.3, 0.6):
    thinned = world.changed(f"removed amount={share}", seed=0)
    with open_renderer(thinned) as renderer:
        walk = Walk(renderer=renderer, encoding=encoding, route=route, starts=[route.start.moved(0.0, 0.1)])
        steps = [step for (step,) in walk.steps(Scan(model=trained.model))]
    plt.plot([step.deviation for step in steps], label=f"{share:.0%} removed: {steps[-1].reason}")
plt.xlabel("step")
plt.ylabel("distance from the route (m)")
plt.legend()
