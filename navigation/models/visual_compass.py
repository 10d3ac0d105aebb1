"""The visual compass: one snapshot and the rotation that brings it back (Zeil, Hofmann and Chahl 2003; thesis 4.2)."""

from ..familiarity import Images, check_training
from .perfect_memory import PerfectMemory


class VisualCompass(PerfectMemory):
    """Perfect memory of a single view: the last one it is given, which is the view at the goal."""

    def fit(self, views: Images) -> "VisualCompass":
        """Store the last view."""
        check_training(views)
        return super().fit(views[-1:])
