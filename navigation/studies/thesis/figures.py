"""The figures of the thesis, in its order."""

from . import figures_confidence, figures_memory, figures_networks, figures_views
from .pictures import PICTURES as _DRAWN
from .pictures import Picture

__all__ = ["PICTURES", "Picture"]

_FILES = [each.__name__ for each in (figures_views, figures_memory, figures_networks, figures_confidence)]
PICTURES = sorted(_DRAWN, key=lambda picture: _FILES.index(picture.draw.__module__))
