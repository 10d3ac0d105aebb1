"""What the studies are done with, where the thesis leaves a choice."""

from dataclasses import dataclass

from ...encoding import Encoding

EVERY = 6  # one route view in so many is learned (4.3.3)
FACTOR = 6  # of resizing (4.3.4)
SMOOTHING = 1.1  # standard deviation of the Gaussian (pixels of the view), that of OpenCV's 5 x 5 kernel; the thesis does not say
ENCODING = Encoding.parse(f"grey | blur {SMOOTHING:g} | sample {FACTOR}")  # sampled as cv2.resize does (4.4.1)


@dataclass(frozen=True, kw_only=True)
class Settings:
    """Choices of the whole replication; `quick` is for tests and first looks.

    seed: of the networks. starts: networks trained from different random starts for each number, of which the median counts.
    iterations: short and long training (4.4.7.1). search_iterations: of the grid search, scikit-learn's default at the time.
    """

    seed: int = 0
    quick: bool = False

    @property
    def starts(self) -> int:
        return 1 if self.quick else 3

    @property
    def iterations(self) -> tuple[int, int]:
        return (100, 500) if self.quick else (600, 3000)

    @property
    def search_iterations(self) -> int:
        return 40 if self.quick else 200

    @property
    def seeds(self) -> range:
        """One for each start; those of two seeds are different."""
        return range(self.seed * self.starts, (self.seed + 1) * self.starts)
