"""A learner in the Gymnasium environment: perfect memory is shown a route, then follows it home from a decimetre beside its start."""

import gymnasium
import numpy as np
import torch

from tussock.navigation import PerfectMemory
from tussock.navigation.scan import best_turn, scan_window

env = gymnasium.make("tussock.navigation.rl.environment:tussock/RouteFollowing-v0", world_seed=7, encoding="edges")
observation, info = env.reset(seed=0)
views, _ = env.unwrapped.training_views(learning_walk=0.2)
memory = PerfectMemory().fit(torch.from_numpy(views))
earned, over = 0.0, False
while not over:
    familiarity = memory.scan(torch.from_numpy(observation)[None]).numpy()
    (turn,) = best_turn(familiarity, scan_window(familiarity.shape[1], np.pi))
    observation, reward, terminated, truncated, info = env.step(np.array([turn / np.pi, 1.0]))
    earned, over = earned + reward, terminated or truncated
print(f"{info['reason']} {info['along_m']:.2f} m along the route; earned {earned:.2f}")
env.close()
