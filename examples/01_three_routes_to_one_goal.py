"""Infomax learns three routes to one goal, one after the other, and walks home from the start of each. Its memory does not grow."""

from tussock import (
    Agent,
    Encoding,
    Infomax,
    StoppingRules,
    TrainedModel,
    World,
    generate_route,
    open_renderer,
    training_poses,
)
from tussock.navigation.training import training_views

world = World.generate("tussock-field", seed=5)
routes = [generate_route(world, seed, length=4.0, goal=(4.9, 4.9)) for seed in (1, 2, 3)]
encoding, model = Encoding.named("edges", resize=6), Infomax(seed=0)
with open_renderer(world) as renderer:
    for route in routes:
        poses = training_poses(route, spacing=0.04, learning_walk=0.2, field=world.field)
        views, _ = training_views(encoding, renderer, poses)
        model.partial_fit(views)
        print(f"learned {len(views)} views; {model.memory_bytes:,} bytes")
    trained = TrainedModel(model=model, encoding=encoding, eye=renderer.eye, poses=None)
    # Where two routes meet, an agent may go on along the other one, which leads to the same goal: that is not lost.
    stopping = StoppingRules(max_deviation=10.0, patience=20.0)
    for route in routes:
        agent = Agent(renderer=renderer, trained=trained, route=route, stopping=stopping)
        *_, last = agent.walk(agent.start(offset=0.1))
        print(f"from ({route.start.x:.1f}, {route.start.y:.1f}) m: {last.reason} after {last.index} steps")
