"""
A model of your own
===================

A class with ``fit(views)`` and ``scan(views)`` is a familiarity model. This one keeps the mean of all views of the route, and nothing
else. It works in every command as ``--model yourfile:MeanView``.
"""

import matplotlib.pyplot as plt
import torch

from tussock import Experiment


class MeanView:
    """Familiarity is minus the mean difference from the mean of all views."""

    def fit(self, views):
        self.mean = views.mean(dim=0)

    def scan(self, views):
        turned = [views.roll(column, dims=2) for column in range(views.shape[2])]
        return torch.stack([-(view - self.mean).abs().mean(dim=(1, 2)) for view in turned], dim=1)


for model in (MeanView, "perfect-memory"):
    walk = Experiment(world="tussock-field", seed=7, model=model, route_length=4.0, start_offset=0.1).run()
    plt.plot(
        walk.column("along_m"), walk.column("deviation_m"), label=f"{model if isinstance(model, str) else 'mean view'}"
    )
plt.xlabel("distance along the route (m)")
plt.ylabel("distance from the route (m)")
plt.legend()
