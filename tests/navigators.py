"""Navigators without a model, for tests of what moves an agent."""

import numpy as np

from tussock.navigation.steering.navigator import Motion


class Ahead:
    """A navigator that walks straight on."""

    def learn(self, views):
        pass

    def begin(self):
        return None

    def decide(self, look, memories):
        return Motion(turn=np.zeros(len(look)))


AHEAD = f"{__name__}:Ahead"
