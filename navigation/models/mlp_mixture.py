"""A small network for each stretch of the route, gated by familiarity."""

from dataclasses import dataclass

import torch
from jaxtyping import Int64

from tussock.world.errors import InputError

from .base import Images, Learned, Scans
from .mlp_rotation import MLPRotation


@dataclass(kw_only=True, eq=False)
class MLPMixture(MLPRotation):
    """`mlp-rotation` in parts: the route is cut where the views have changed equally much, and each stretch has its own network.

    Stretches are short where views change fast, as in corners (thesis, section 4.4.6, and its future work). All networks are trained
    together to tell the right stretch and rotation from every other. Familiarity is the log of the summed odds of all networks:
    the one that finds a view most familiar speaks. Constant memory.

    stretches: how many. units: hidden ones of each network.
    """

    name = "mlp-mixture"
    paper = "the thesis, future work; Jacobs et al. 1991"

    LIMITS = MLPRotation.LIMITS | {"stretches": (1, 200)}
    stretches: int = 8
    units: int = 20

    def check_learned(self, shape: tuple[int, int], learned: Learned) -> None:
        """As for all models; and there are no more networks than stretches."""
        super().check_learned(shape, learned)
        if len(learned["output"]) > self.stretches:
            raise InputError(f"{self.name}: {len(learned['output'])} networks for {self.stretches} stretches")

    def stretch_of(self, views: Images) -> Int64[torch.Tensor, " n"]:
        """Stretch of each training view, so that successive views change by the same sum in each."""
        change = (views[1:] - views[:-1]).square().mean(dim=(1, 2)).sqrt()
        along = torch.cat([torch.zeros(1), change.cpu().double().cumsum(dim=0)])
        share = along / along[-1].clamp(min=1e-12)
        _, stretch = torch.unique((share * self.stretches).long().clamp(max=self.stretches - 1), return_inverse=True)
        return stretch

    def speaking(self, views: Images) -> Int64[torch.Tensor, "n w"]:
        """Which stretch's network finds each rotation most familiar."""
        return self._outputs(self._here(views)).argmax(dim=2)

    def _scan(self, views: Images) -> Scans:
        return self._outputs(views).logsumexp(dim=2)
