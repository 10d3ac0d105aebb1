"""AdaBoost over Haar-like filters: the few of many random features that tell the route from turned views."""

from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple

import numpy as np
import torch
from jaxtyping import Float32, Float64, UInt8

from tussock.render.compile import compiled
from tussock.world.geometry import columns_of_turn
from tussock.world.settings import number, numbers, whole

from .base import Images, Learned, Model, Scans, Scores, Shapes, model
from .filter_bank import FilterBank
from .rotations import in_batches, linear_each, one_by_one

NEGLIGIBLE = 0.02  # share of the weight whose samples are left out while a stump is searched
THRESHOLDS = 63  # that are tried for a filter: quantiles of its responses
# Signs of the boxes of Haar-like filters.
SHAPES = (((1, -1),), ((1,), (-1,)), ((1, -2, 1),), ((1,), (-2,), (1,)), ((1, -1), (-1, 1)))


@model
class AdaBoost(Model):
    """Threshold units (stumps) on Haar-like filters, boosted to tell views along the route from turned copies of them.

    Each round takes the filter and threshold with the least weighted error e, gives it the vote log((1 - e) / e) / 2, and gives more
    weight to the samples that it got wrong. Familiarity is the sum of votes. Section 3.3.1 of the thesis. Constant memory.

    The first negatives are each view turned by `negatives_deg`. They cover little of the circle, so, as in face detection, the model
    scans its views with what it has learned, adds the most familiar wrong rotations of each to the negatives, and boosts again.

    Attributes:
        pool: Number of random filters to choose from.
        features: Number of filters that are chosen.
        negatives_deg: How far the views are turned to the left for the first negatives (deg).
        passes: How often it boosts; 1 is the study's recipe.
        hard_negatives: Wrong rotations of each view that are added to the negatives after each pass.
        tolerance_deg: Rotations nearer than this to the right one are not wrong (deg).
    """

    name = "adaboost"
    paper = "Freund and Schapire 1997; Viola and Jones 2001; Philippides et al. 2015"
    takes_mask = True
    renamed = {"mined": "hard_negatives", "apart_deg": "tolerance_deg"}  # noqa: RUF012

    pool: int = whole(5000)
    features: int = whole(200)
    negatives_deg: tuple[float, ...] = numbers((45.0, -45.0), unit="deg")
    passes: int = whole(3)
    hard_negatives: int = whole(2)
    tolerance_deg: float = number(12.0, low=0, high=90, unit="deg")

    def _learn(self, views: Images) -> Learned:
        width = views.shape[2]
        pool = self._on_device(haar_filters(self.pool, views.shape[1], width, np.random.default_rng(self.seed)))
        turns = [round(columns_of_turn(degrees, width, full_turn=360)) for degrees in self.negatives_deg]
        negatives = torch.cat([torch.roll(views, turn, dims=-1) for turn in turns])
        learned = self._boost(pool, views, negatives)
        for _ in range(self.passes - 1):
            negatives = torch.cat([negatives, self._hard_negatives(views, learned)])
            learned = self._boost(pool, views, negatives)
        return learned

    def _boost(
        self, pool: Float32[torch.Tensor, "k h w"], positives: Images, negatives: Float32[torch.Tensor, "m h w"]
    ) -> Learned:
        """The chosen filters, their thresholds and their votes."""
        samples = self._pixels(torch.cat([positives, negatives]))
        labels = np.repeat([1.0, -1.0], [len(positives), len(negatives)])
        filters = pool.flatten(start_dim=1) if self.mask is None else self.mask.select(pool)
        responses = (filters @ samples.T).cpu().numpy()  # (pool, samples)
        thresholds = np.stack([thresholds_between(row) for row in responses])
        rows = zip(thresholds, responses, strict=True)
        bins = np.stack([np.searchsorted(*row).astype(np.uint8) for row in rows])
        weights = np.where(labels > 0, 0.5 / len(positives), 0.5 / len(negatives))
        chosen, cuts, votes = [], [], []
        for _ in range(self.features):
            stump = best_stump(bins, weights * labels)
            error = np.clip(stump.error, 1e-6, 1 - 1e-6)
            vote = 0.5 * np.log((1 - error) / error)
            answers = np.where(bins[stump.filter] > stump.bin, 1.0, -1.0) * stump.sign
            weights *= np.exp(-vote * labels * answers)
            weights /= weights.sum()
            chosen.append(stump.filter)
            cuts.append(thresholds[stump.filter, stump.bin])
            votes.append(vote * stump.sign)
        return {
            "filters": self._as_filters(filters[chosen], pool.shape[1:]),
            "cuts": self._on_device(torch.tensor(np.array(cuts))),
            "votes": self._on_device(torch.tensor(votes, dtype=torch.float32)),
        }

    def _hard_negatives(self, views: Images, learned: Learned) -> Float32[torch.Tensor, "m h w"]:
        """The most familiar of the wrong rotations of each view."""
        width = views.shape[2]
        away = torch.arange(width, device=views.device)
        wrong = torch.minimum(away, width - away) * (360 / width) >= self.tolerance_deg
        bank = self._bank(learned["filters"])
        scan = torch.cat([sum_of_votes(bank, learned, batch) for batch in in_batches(views)]).where(wrong, -torch.inf)
        turns = scan.topk(min(self.hard_negatives, int(wrong.sum())), dim=1).indices.tolist()
        return torch.stack([view.roll(k, dims=-1) for view, ks in zip(views, turns, strict=True) for k in ks])

    def _shapes(self, height: int, width: int) -> Shapes:
        return {"filters": (self.features, height, width), "cuts": (self.features,), "votes": (self.features,)}

    def _prepare(self) -> None:
        self._chosen = self._bank(self.learned["filters"])

    def _scan(self, views: Images) -> Scans:
        return sum_of_votes(self._chosen, self.learned, views)

    def _score(self, views: Images) -> Scores:
        filters, cuts, votes = (self.learned[key] for key in ("filters", "cuts", "votes"))
        responses = linear_each(self._seen(views).flatten(start_dim=1), filters.flatten(start_dim=1))
        return linear_each((responses > cuts).float() * 2 - 1, votes[None])[:, 0]


def sum_of_votes(bank: FilterBank, learned: Learned, views: Images) -> Scans:
    """Sum of the votes of all stumps at each rotation."""
    answers = (bank.responses(views) > learned["cuts"]).float() * 2 - 1
    return one_by_one(lambda answers: answers @ learned["votes"], answers)


class Stump(NamedTuple):
    """A threshold unit.

    Attributes:
        filter: Index of its filter.
        bin: Index of its threshold.
        sign: Its answer where the response of the filter is above the threshold; the opposite below.
        error: Weighted share of the samples that it gets wrong.
    """

    filter: int
    bin: int
    sign: float
    error: float


def thresholds_between(responses: Float32[np.ndarray, " samples"]) -> Float32[np.ndarray, " thresholds"]:
    """Quantiles of a filter's responses, each moved midway to the next larger response.

    Views have flat patches, whose response is 0 but for rounding: a threshold equal to a response would leave the answer to chance.
    """
    ordered = np.sort(responses)
    gap = 1e-5 * float(np.abs(ordered).max())
    below = ordered[(np.linspace(0, 1, THRESHOLDS + 2)[1:-1] * (len(ordered) - 1)).astype(int)]
    above = ordered[np.searchsorted(ordered, below + gap, side="right").clip(max=len(ordered) - 1)]
    return np.where(above > below + gap, (below + above) / 2, below + max(gap, 1e-6)).astype(np.float32)


def best_stump(bins: UInt8[np.ndarray, "pool samples"], signed: Float64[np.ndarray, " samples"]) -> Stump:
    """The stump with the least weighted error.

    The search leaves out the lightest samples, which together weigh NEGLIGIBLE; the error is that on all.

    Args:
        bins: (pool, samples) Bin of each filter's response to each sample.
        signed: (samples,) Weights (of sum 1) times labels (1 and -1).
    """
    weights = np.abs(signed)
    order = weights.argsort()
    heavy = np.sort(order[np.searchsorted(weights[order].cumsum(), NEGLIGIBLE) :])
    parts = [part for part in np.array_split(np.arange(len(bins)), torch.get_num_threads()) if len(part)]
    with ThreadPoolExecutor(len(parts)) as threads:
        results = threads.map(lambda part: _edges(bins[part[0] : part[-1] + 1], heavy, signed[heavy]), parts)
    edges, cuts = (np.concatenate(arrays) for arrays in zip(*results, strict=True))
    best = int(np.abs(edges).argmax())
    sign = float(np.sign(edges[best]) or 1.0)
    edge = (signed * np.where(bins[best] > cuts[best], sign, -sign)).sum()
    return Stump(best, int(cuts[best]), sign, float((1 - edge) / 2))


@compiled
def _edges(bins, heavy, signed):
    """For each filter the threshold whose edge, sum of weight x label x answer, is the farthest from 0, and that edge."""
    pool, samples = len(bins), len(heavy)
    edges, cuts = np.zeros(pool), np.zeros(pool, np.int64)
    total = signed.sum()
    for f in range(pool):
        histogram = np.zeros(THRESHOLDS + 1)
        for i in range(samples):
            histogram[bins[f, heavy[i]]] += signed[i]
        below = 0.0
        for b in range(THRESHOLDS):
            below += histogram[b]
            edge = total - 2 * below
            if abs(edge) > abs(edges[f]):
                edges[f], cuts[f] = edge, b
    return edges, cuts


def haar_filters(
    count: int, height: int, width: int, random: np.random.Generator
) -> Float32[torch.Tensor, "count h w"]:
    """Haar-like filters of random shape, size and position: two, three or four boxes against each other, of sum 0 and norm 1."""
    shapes = [np.array(shape, dtype=np.float32) for shape in SHAPES]
    fitting = [shape for shape in shapes if len(shape) <= height]
    filters = np.zeros((count, height, width), dtype=np.float32)
    for filter in filters:
        shape = fitting[random.integers(len(fitting))]
        box_height = random.integers(1, height // shape.shape[0] + 1)
        box_width = random.integers(1, max(1, width // 3 // shape.shape[1]) + 1)
        block = shape.repeat(box_height, axis=0).repeat(box_width, axis=1)
        row, column = random.integers(height - len(block) + 1), random.integers(width)
        filter[row : row + len(block), : block.shape[1]] = block
        filter[:] = np.roll(filter, column, axis=1)
        filter /= np.linalg.norm(filter)
    return torch.from_numpy(filters)
