from .eye import Eye as Eye
from .posture import Posture as Posture
from .renderer import Renderer as Renderer
from .renderer import open_renderer as open_renderer
