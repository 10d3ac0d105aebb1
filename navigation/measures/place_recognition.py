"""Place recognition: which reference view was taken nearest to where a query view was taken?

The best match of a query is the reference view of the least image difference. It is correct where the two were taken within a tolerance.
A query that has a reference within the tolerance can be recognised. As in VPR-Bench (Zaffar et al. 2021) and the tutorial of
Schubert et al. (2023):

- recall@N: of the queries that can be recognised, the share with a reference within the tolerance among their N best matches.
- precision and recall: accept the best matches whose difference is at most a threshold. Precision is the share of the accepted ones
  that are correct; recall is the number of these divided by the number of queries that can be recognised.
- The area under this curve is the average precision: the sum over the thresholds of precision times the increase of recall. Where all
  queries that can be recognised have a correct best match it is scikit-learn's `average_precision_score`; else that times recall@1.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int64

from tussock.world.errors import SettingError

RANKS = (1, 5, 10)


@dataclass(frozen=True, kw_only=True)
class PlaceRecognition:
    """How well places are recognised.

    Attributes:
        matches: (n,) Index of the best match of each query.
        correct: (n,) Whether it is within the tolerance.
        distance: (n,) From the query (m).
        recognisable: (n,) Whether a reference is within the tolerance.
        recall_at: Recall@N, by N.
        precision: (k,) At each threshold, from the strictest to that which accepts all.
        recall: (k,) Likewise.
        area: Under the curve of the two.
    """

    matches: Int64[np.ndarray, " n"]
    correct: Bool[np.ndarray, " n"]
    distance: Float[np.ndarray, " n"]
    recognisable: Bool[np.ndarray, " n"]
    recall_at: dict[int, float]
    precision: Float[np.ndarray, " k"]
    recall: Float[np.ndarray, " k"]
    area: float


def recognise(
    difference: Float[np.ndarray, "n m"],
    queries: Float[np.ndarray, "n 2"],
    references: Float[np.ndarray, "m 2"],
    tolerance: float,
    ranks: Sequence[int] = RANKS,
) -> PlaceRecognition:
    """Match queries with references, and count what is right.

    Args:
        difference: Image difference of each query from each reference; inf where they are not compared: never a match.
        queries: Where the query views were taken (m).
        references: Where the reference views were taken (m).
        tolerance: Greatest distance of a correct match (m).
        ranks: Numbers N of best matches for recall@N.

    Raises:
        SettingError: Where no query can be recognised.
    """
    if not (np.isfinite(tolerance) and tolerance > 0):
        raise SettingError(f"--tolerance-m {tolerance:g}: give a distance over 0")
    distance = np.hypot(*(queries[:, None] - references).transpose(2, 0, 1))
    near = distance <= tolerance
    recognisable = near.any(axis=1)
    if not recognisable.any():
        raise SettingError(f"no query has a reference within {tolerance:g} m; give a greater --tolerance-m")
    order = difference.argsort(axis=1, kind="stable")
    hits = np.take_along_axis(near & np.isfinite(difference), order, axis=1)
    rows, matches = np.arange(len(queries)), order[:, 0]
    precision, recall = precision_recall(difference[rows, matches], hits[:, 0], int(recognisable.sum()))
    return PlaceRecognition(
        matches=matches,
        correct=hits[:, 0],
        distance=distance[rows, matches],
        recognisable=recognisable,
        recall_at={n: float(hits[recognisable, :n].any(axis=1).mean()) for n in ranks},
        precision=precision,
        recall=recall,
        area=float((np.diff(recall, prepend=0.0) * precision).sum()),
    )


def precision_recall(
    difference: Float[np.ndarray, " n"], correct: Bool[np.ndarray, " n"], possible: int
) -> tuple[Float[np.ndarray, " k"], Float[np.ndarray, " k"]]:
    """Precision and recall of best matches, accepted up to each of their differences.

    Args:
        difference: Of each best match.
        correct: Whether it is correct.
        possible: Number of queries that can be recognised.
    """
    order = difference.argsort(kind="stable")
    ordered = difference[order]
    last = np.r_[np.flatnonzero(ordered[1:] != ordered[:-1]), len(order) - 1]  # equal differences are accepted together
    right = correct[order].cumsum()[last]
    return right / (last + 1), right / possible
