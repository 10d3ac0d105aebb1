"""What all studies have in common: the parameters that the thesis leaves open, and how deep a replication goes."""

from tussock.world.progress import Progress as Progress
from tussock.world.settings import settings, switch, whole

from ...encoding import Encoding

EVERY = 6  # learn every 6th route view (4.3.3)
FACTOR = 6  # of resizing (4.3.4)
SMOOTHING = 1.1  # standard deviation of the Gaussian (pixels of the view), that of OpenCV's 5 x 5 kernel; the thesis does not give it
ENCODING = Encoding.parse(f"grey | blur {SMOOTHING:g} | sample {FACTOR}")  # sampled as cv2.resize does (4.4.1)

# Why quick runs cannot test claims.
QUICK_NETWORKS = "--quick trains networks for a sixth of the iterations, from one start"
QUICK_SEARCHES = "--quick searches few tunings, with a fifth of the iterations"
QUICK_FACTORS = "--quick has four of the ten resize factors"


@settings
class StudySettings:
    """How deep a replication goes.

    Attributes:
        seed: Seed of the networks.
        quick: A first look: one start of each network, shorter training, smaller searches.
    """

    seed: int = whole(0, low=0)
    quick: bool = switch(False)

    @property
    def starts(self) -> int:
        """Number of networks that are trained from different random starts for each number; the median counts."""
        return 1 if self.quick else 3

    @property
    def iterations(self) -> tuple[int, int]:
        """Iterations of the short and of the long training (4.4.7.1)."""
        return (100, 500) if self.quick else (600, 3000)

    @property
    def search_iterations(self) -> int:
        """Iterations of the grid search: scikit-learn's default at the time of the thesis."""
        return 40 if self.quick else 200

    @property
    def seeds(self) -> range:
        """Seeds of the starts; two settings with different seeds share none."""
        return range(self.seed * self.starts, (self.seed + 1) * self.starts)
