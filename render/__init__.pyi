from .eye import Eye as Eye
from .eye import compound_eye as compound_eye
from .lighting import lit as lit
from .ommatidia import Ommatidia as Ommatidia
from .ommatidia_picture import draw_ommatidia as draw_ommatidia
from .posture import Posture as Posture
from .renderer import Renderer as Renderer
from .renderer import open_renderer as open_renderer
