"""The figures of the thesis, in its order."""

from . import figures_confidence, figures_memory, figures_networks, figures_views
from .pictures import PICTURES, Picture

__all__ = ["PICTURES", "Picture", "figures_confidence", "figures_memory", "figures_networks", "figures_views"]
