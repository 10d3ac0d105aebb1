from .navigator import Look as Look
from .navigator import Motion as Motion
from .navigator import Navigator as Navigator
from .navigator import ScanRecord as ScanRecord
from .registry import NAVIGATORS as NAVIGATORS
from .scan import Scan as Scan
from .stepped_scan import SteppedScan as SteppedScan
