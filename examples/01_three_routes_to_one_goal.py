"""Infomax learns three routes to one goal, one after the other, and walks home from the start of each: its memory does not grow."""

from tussock.navigation import Agent, Encoding, Infomax, training_poses
from tussock.navigation.training import training_views
from tussock.render import open_renderer
from tussock.world import World
from tussock.world.routes import generate_route

world = World.generate("tussock-field", seed=5)
routes = [generate_route(world, seed, length=4.0, goal=(4.9, 4.9)) for seed in (1, 2, 3)]
encoding = Encoding.named("edges", resize=6)
model = Infomax(seed=0)
with open_renderer(world) as renderer:
    for route in routes:
        poses = training_poses(route.resampled(0.04), learning_walk=0.2, field=world.field)
        views, _ = training_views(encoding, renderer, poses)
        model.partial_fit(views)
        print(f"learned {len(views)} views; {model.memory_bytes:,} bytes")
    for route in routes:
        # Where two routes meet, an agent may go on along the other one, which leads to the same goal: that is not lost.
        agent = Agent(renderer=renderer, encoding=encoding, model=model, route=route, lost=10.0, patience=20.0)
        *_, last = agent.walk(agent.start(offset=0.1))
        print(f"from ({route.start.x:.1f}, {route.start.y:.1f}) m: {last.reason} after {last.index} steps")
