"""All figures of the thesis's report, in the order of the thesis."""

from . import figures_confidence, figures_memory, figures_networks, figures_views
from .items import Item

MODULES = (figures_views, figures_memory, figures_networks, figures_confidence)
FIGURES = tuple(each for module in MODULES for each in vars(module).values() if isinstance(each, Item))
