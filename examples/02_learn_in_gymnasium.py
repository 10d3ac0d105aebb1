"""A learner in the Gymnasium environment: perfect memory learns a route, then follows it home from up to 0.1 m off its start."""

import gymnasium
import numpy as np
import torch

from tussock import PerfectMemory
from tussock.navigation.scan import best_turn, scan_window

env = gymnasium.make("tussock.navigation.rl.environment:tussock/RouteFollowing-v0", world_seed=7, encoding="edges")
observation, info = env.reset(seed=0)
views, _ = env.unwrapped.training_views(learning_walk=0.2)
memory = PerfectMemory().fit(torch.from_numpy(views))
earned, ended = 0.0, False
while not ended:
    familiarity = memory.scan(torch.from_numpy(observation)[None]).numpy()
    (turn,) = best_turn(familiarity, scan_window(familiarity.shape[1], np.pi))
    observation, reward, terminated, truncated, info = env.step(np.array([turn / np.pi, 1.0]))
    earned, ended = earned + reward, terminated or truncated
print(f"{info['reason']} {info['along_m']:.2f} m along the route; earned {earned:.2f}")
env.close()
