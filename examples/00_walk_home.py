"""Generate a world, learn a route through it, and walk it home from 0.1 m off its start."""

from tussock import Agent, Encoding, PerfectMemory, World, generate_route, open_renderer, train, training_poses

world = World.generate("tussock-field", seed=7)
route = generate_route(world, seed=7)
with open_renderer(world) as renderer:
    poses = training_poses(route, spacing=0.04, learning_walk=0.2)
    trained = train(PerfectMemory(), Encoding.named("edges", resize=6), renderer, poses)
    agent = Agent(renderer=renderer, trained=trained, route=route)
    for step in agent.walk(agent.start(offset=0.1)):
        print(f"step {step.index}: {step.deviation:.3f} m off the route {step.reason or ''}")
