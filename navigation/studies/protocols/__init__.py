"""Published experiments, to be done again in any world: what `tussock replicate` knows beside the thesis."""

from .ardin2016 import ARDIN2016
from .azevedo2025 import AZEVEDO2025
from .baddeley2012 import BADDELEY2012
from .kagioulis2024 import KAGIOULIS2024
from .protocol import Exhibit, Parameter, Protocol, places

PROTOCOLS = {protocol.name: protocol for protocol in (ARDIN2016, BADDELEY2012, AZEVEDO2025, KAGIOULIS2024)}

__all__ = [
    "ARDIN2016",
    "AZEVEDO2025",
    "BADDELEY2012",
    "KAGIOULIS2024",
    "PROTOCOLS",
    "Exhibit",
    "Parameter",
    "Protocol",
    "places",
]
