"""AdaBoost over Haar-like filters: the few of many random features that tell the route from turned views."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import NamedTuple

import numba
import numpy as np
import torch
from jaxtyping import Float32, Float64, UInt8

from tussock.render.compile import compiled
from tussock.world.geometry import columns_of_turn

from .base import Images, Learned, Model, Scans
from .filter_bank import FilterBank, in_parts

NEGLIGIBLE = 0.02  # share of the weight whose samples are left out while a threshold unit is sought
THRESHOLDS = 63  # tried for a filter: quantiles of its responses
SHAPES = (((1, -1),), ((1,), (-1,)), ((1, -2, 1),), ((1,), (-2,), (1,)), ((1, -1), (-1, 1)))  # of Haar-like filters


@dataclass(kw_only=True, eq=False)
class AdaBoost(Model):
    """Threshold units on Haar-like filters, boosted to tell views along the route from turned copies of them.

    Each round takes the filter and threshold with the least weighted error e, gives it the vote log((1 - e) / e) / 2, and weighs up what
    it got wrong. Familiarity is the sum of votes. Section 3.3.1 of the thesis. Constant memory.

    The first negatives are each view turned by `negatives_deg`. They leave most of the circle unseen, so, as in face detection, it
    looks around each view with what it has, adds the `mined` most familiar wrong rotations of each to the negatives, and boosts
    again: `passes` times in all. One pass is the study's recipe.

    pool: random filters to choose from. features: how many are chosen. apart_deg: rotations nearer than this are not wrong.
    """

    name = "adaboost"
    paper = "Freund and Schapire 1997; Viola and Jones 2001; Philippides et al. 2015"

    LIMITS = {"apart_deg": (0.0, 90.0)}  # noqa: RUF012
    pool: int = 5000
    features: int = 200
    negatives_deg: tuple[float, ...] = (45.0, -45.0)
    passes: int = 3
    mined: int = 2
    apart_deg: float = 12.0

    def _learn(self, views: Images) -> Learned:
        width = views.shape[2]
        pool = self._here(haar_filters(self.pool, views.shape[1], width, np.random.default_rng(self.seed)))
        turns = [round(columns_of_turn(degrees, width, full_turn=360)) for degrees in self.negatives_deg]
        negatives = torch.cat([torch.roll(views, turn, dims=-1) for turn in turns])
        learned = self._boost(pool, views, negatives)
        for _ in range(self.passes - 1):
            negatives = torch.cat([negatives, self._mistaken(views, learned)])
            learned = self._boost(pool, views, negatives)
        return learned

    def _boost(
        self, pool: Float32[torch.Tensor, "k h w"], positives: Images, negatives: Float32[torch.Tensor, "m h w"]
    ) -> Learned:
        """The chosen filters, their thresholds and their votes."""
        samples = torch.cat([positives, negatives]).flatten(start_dim=1)
        labels = np.repeat([1.0, -1.0], [len(positives), len(negatives)])
        responses = (pool.flatten(start_dim=1) @ samples.T).cpu().numpy()  # (pool, samples)
        thresholds = np.stack([thresholds_between(row) for row in responses])
        bins = np.stack([
            np.searchsorted(*pair).astype(np.uint8) for pair in zip(thresholds, responses, strict=True)
        ])  # fmt: skip
        weights = np.where(labels > 0, 0.5 / len(positives), 0.5 / len(negatives))
        chosen, cuts, cast = [], [], []
        for _ in range(self.features):
            stump = best_stump(bins, weights * labels)
            error = np.clip(stump.error, 1e-6, 1 - 1e-6)
            vote = 0.5 * np.log((1 - error) / error)
            says = np.where(bins[stump.filter] > stump.bin, 1.0, -1.0) * stump.sign
            weights *= np.exp(-vote * labels * says)
            weights /= weights.sum()
            chosen.append(stump.filter)
            cuts.append(thresholds[stump.filter, stump.bin])
            cast.append(vote * stump.sign)
        return {
            "filters": pool[chosen],
            "cuts": self._here(torch.tensor(np.array(cuts))),
            "votes": self._here(torch.tensor(cast, dtype=torch.float32)),
        }

    def _mistaken(self, views: Images, learned: Learned) -> Float32[torch.Tensor, "m h w"]:
        """The rotations of each view that look most familiar and are wrong."""
        width = views.shape[2]
        away = torch.arange(width, device=views.device)
        wrong = torch.minimum(away, width - away) * (360 / width) >= self.apart_deg
        bank = FilterBank(learned["filters"])
        scan = torch.cat([votes(bank, learned, part) for part in in_parts(views)]).where(wrong, -torch.inf)
        turns = scan.topk(min(self.mined, int(wrong.sum())), dim=1).indices.tolist()
        return torch.stack([view.roll(k, dims=-1) for view, ks in zip(views, turns, strict=True) for k in ks])

    def _shapes(self, height: int, width: int) -> dict[str, tuple[int | None, ...]]:
        return {"filters": (self.features, height, width), "cuts": (self.features,), "votes": (self.features,)}

    def _prepare(self) -> None:
        self._bank = FilterBank(self.learned["filters"])

    def _scan(self, views: Images) -> Scans:
        return votes(self._bank, self.learned, views)


def votes(bank: FilterBank, learned: Learned, views: Images) -> Scans:
    """Sum of the votes of all threshold units at each rotation."""
    says = (bank.responses(views) > learned["cuts"]).float() * 2 - 1
    return says @ learned["votes"]


class Stump(NamedTuple):
    """A threshold unit: it says `sign` where the filter's response lies above the bin, else -`sign`.

    error: weighted share of the samples that it gets wrong.
    """

    filter: int
    bin: int
    sign: float
    error: float


def thresholds_between(responses: Float32[np.ndarray, " samples"]) -> Float32[np.ndarray, " thresholds"]:
    """Quantiles, each moved midway to the next larger response.

    Views have flat patches, of which a filter makes 0 but for rounding: a threshold on a response would leave the answer to chance.
    """
    ordered = np.sort(responses)
    gap = 1e-5 * float(np.abs(ordered).max())
    below = ordered[(np.linspace(0, 1, THRESHOLDS + 2)[1:-1] * (len(ordered) - 1)).astype(int)]
    above = ordered[np.searchsorted(ordered, below + gap, side="right").clip(max=len(ordered) - 1)]
    return np.where(above > below + gap, (below + above) / 2, below + max(gap, 1e-6)).astype(np.float32)


def best_stump(bins: UInt8[np.ndarray, "pool samples"], signed: Float64[np.ndarray, " samples"]) -> Stump:
    """The threshold unit with the least weighted error. signed: weights (summing to 1) times labels (1 and -1).

    While it looks, it leaves out the lightest samples, which together weigh NEGLIGIBLE; the error it tells is that on all.
    """
    weights = np.abs(signed)
    order = weights.argsort()
    heavy = np.sort(order[np.searchsorted(weights[order].cumsum(), NEGLIGIBLE) :])
    parts = np.array_split(np.arange(len(bins)), numba.get_num_threads())
    with ThreadPoolExecutor(len(parts)) as threads:
        found = list(
            threads.map(
                lambda part: _edges(bins[part[0] : part[-1] + 1], heavy, signed[heavy]), [p for p in parts if len(p)]
            )
        )
    edges, cuts = (np.concatenate(arrays) for arrays in zip(*found, strict=True))
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
    """Haar-like filters of random shape, size and place: two, three or four boxes against each other, sum 0 and norm 1."""
    shapes = [np.array(shape, dtype=np.float32) for shape in SHAPES]
    fitting = [shape for shape in shapes if len(shape) <= height]
    filters = np.zeros((count, height, width), dtype=np.float32)
    for filter in filters:
        shape = fitting[random.integers(len(fitting))]
        tall = random.integers(1, height // shape.shape[0] + 1)
        wide = random.integers(1, max(1, width // 3 // shape.shape[1]) + 1)
        block = shape.repeat(tall, axis=0).repeat(wide, axis=1)
        row, column = random.integers(height - len(block) + 1), random.integers(width)
        filter[row : row + len(block), : block.shape[1]] = block
        filter[:] = np.roll(filter, column, axis=1)
        filter /= np.linalg.norm(filter)
    return torch.from_numpy(filters)
