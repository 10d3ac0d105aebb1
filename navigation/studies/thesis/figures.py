"""All figures of the thesis's report, in the order of the thesis."""

from . import figures_confidence, figures_memory, figures_networks, figures_views

FIGURES = (*figures_views.FIGURES, *figures_memory.FIGURES, *figures_networks.FIGURES, *figures_confidence.FIGURES)
