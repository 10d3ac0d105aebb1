"""What a published experiment is that needs neither a world nor images, as of a circuit in flights."""

from collections.abc import Callable, Sequence

from tussock.world.progress import Progress
from tussock.world.settings import settings

from ...reports.claims import Claim
from ...reports.results import StudyResults
from .protocol import Item, Parameter


@settings
class WorldlessProtocol:
    """A published experiment without a world, in which nothing is seen.

    Attributes:
        name: Name of the command.
        title: Of the report.
        paper: Authors, year, title and journal.
        question: What the experiment asks.
        parameters: Of the original, and what they are here.
        differences: From the original, a sentence each.
        claims: What the paper claims.
        items: Figures and tables of the report.
        measure: Computes the results from a seed, whether it is a first look, and a function that is called with how much is done.
    """

    name: str
    title: str
    paper: str
    question: str
    parameters: Sequence[Parameter] = ()
    differences: Sequence[str] = ()
    claims: Sequence[Claim] = ()
    items: Sequence[Item]
    measure: Callable[[int, bool, Progress], StudyResults]
