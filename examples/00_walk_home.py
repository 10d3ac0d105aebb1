"""Grow a world, learn a route through it, and walk it home from a decimetre beside its start."""

from tussock.navigation import Agent, Encoding, PerfectMemory, learn, training_poses
from tussock.render import open_renderer
from tussock.world import World
from tussock.world.routes import generate_route

world = World.generate("tussock-field", seed=7)
route = generate_route(world, seed=7)
encoding = Encoding.named("edges", resize=6)
with open_renderer(world) as renderer:
    memory = PerfectMemory()
    learn(memory, encoding, renderer, training_poses(route.resampled(0.04), learning_walk=0.2))
    agent = Agent(renderer=renderer, encoding=encoding, model=memory, route=route)
    for step in agent.walk(agent.start(offset=0.1)):
        print(f"step {step.index}: {step.deviation:.3f} m off the route {step.reason or ''}")
