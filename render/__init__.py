"""Panoramas of a world at any pose, by three independent renderers."""

from .eye import Eye
from .renderer import Renderer, open_renderer

__all__ = ["Eye", "Renderer", "open_renderer"]
