"""
A learner in the Gymnasium environment
======================================

The rewards that an agent gets which turns by chance, and one that turns to where perfect memory finds the view most familiar.
"""

import gymnasium
import matplotlib.pyplot as plt
import numpy as np
import torch

from tussock import PerfectMemory
from tussock.navigation.scan import best_turn

env = gymnasium.make("tussock.navigation.rl.environment:tussock/RouteFollowing-v0", world_seed=7, encoding="edges")
views, _ = env.unwrapped.training_views(learning_walk=0.2)
memory, random = PerfectMemory().fit(torch.from_numpy(views)), np.random.default_rng(0)
for name in ("by chance", "perfect memory"):
    (observation, _), rewards, ended = env.reset(seed=0), [], False
    while not ended and len(rewards) < 200:
        (turn,) = best_turn(memory.scan(torch.from_numpy(observation)[None]).numpy())
        share = random.uniform(-0.2, 0.2) if name == "by chance" else turn / np.pi
        observation, reward, terminated, truncated, _ = env.step(np.array([share, 1.0]))
        rewards.append(reward)
        ended = terminated or truncated
    plt.plot(np.cumsum(rewards), label=name)
plt.xlabel("step")
plt.ylabel("sum of rewards")
plt.legend()
