"""A small network for each segment of the route; the one to which a view is most familiar is the active expert."""

import torch
from jaxtyping import Float32, Int64

from tussock.world.errors import SettingError
from tussock.world.settings import whole

from .base import Images, Learned, model
from .mlp_rotation import MLPRotation


@model
class MLPMixture(MLPRotation):
    """Several `mlp-rotation`: the route is cut where the views have changed equally much, and each segment has its own network.

    Segments are short where views change fast, as in corners (thesis, section 4.4.6, and its future work). All networks are trained
    together to tell the right segment and rotation from every other. Familiarity is the log of the summed odds of all networks, so
    the network to which a view is most familiar decides. Constant memory.

    Attributes:
        segments: Number of segments.
        units: Hidden units of each network.
    """

    name = "mlp-mixture"
    paper = "the thesis, future work; Jacobs et al. 1991"
    renamed = {**MLPRotation.renamed, "stretches": "segments"}  # noqa: RUF012

    segments: int = whole(8, high=200)
    units: int = whole(20)

    def check_learned(self, shape: tuple[int, int], learned: Learned) -> None:
        """As for all models; and there are no more networks than segments."""
        super().check_learned(shape, learned)
        if len(learned["output"]) > self.segments:
            raise SettingError(f"{self.name}: {len(learned['output'])} networks for {self.segments} segments")

    def segment_of(self, views: Images) -> Int64[torch.Tensor, " n"]:
        """Segment of each training view, so that successive views change by the same sum in each."""
        change = (views[1:] - views[:-1]).square().mean(dim=(1, 2)).sqrt()
        along = torch.cat([torch.zeros(1), change.cpu().double().cumsum(dim=0)])
        share = along / along[-1].clamp(min=1e-12)
        _, segment = torch.unique((share * self.segments).long().clamp(max=self.segments - 1), return_inverse=True)
        return segment

    def active_expert(self, views: Images) -> Int64[torch.Tensor, "n w"]:
        """The segment to whose network each rotation is most familiar."""
        return self._outputs(self._on_device(views)).argmax(dim=2)

    def _familiarity(self, outputs: Float32[torch.Tensor, "*views networks"]) -> Float32[torch.Tensor, "*views"]:
        return outputs.logsumexp(dim=-1)
