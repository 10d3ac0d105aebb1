"""Knight et al. 2019: headings recovered from published images of six outdoor routes, by perfect memory and Infomax."""

from pathlib import Path

import numpy as np
import pandas as pd
import torch
from jaxtyping import Float, Int

from tussock.world.progress import Progress, no_progress

from ...models.infomax import Infomax
from ...reports.claims import Decision, claim
from ...reports.results import StudyResults
from ...threads import in_threads
from .absolute_differences import least_differences
from .figures_published import agreement
from .knight2019_published import PUBLISHED
from .library_square import IMAGES, ROUTES, Recorded, nearest_segment, present_sets, read_set, simplified, tolerance_of
from .protocol import DatabaseProtocol, Item, Parameter

NEAR = 4.0  # m from the route: the positions of the grid that are tested
WITHIN = 90.0  # degrees from the route: what a constrained scan compares
SAMPLES, CONFIDENCE = 4000, 0.95
SAME = 0.5  # degrees
PERFECT, INFOMAX = "perfect memory", "Infomax"
FULL, CONSTRAINED = "full scan", "within 90°"
MEMORIES = {  # in the published file
    (PERFECT, FULL): "PerfectMemory",
    (PERFECT, CONSTRAINED): "PerfectMemoryConstrained",
    (INFOMAX, FULL): "InfoMax",
    (INFOMAX, CONSTRAINED): "InfoMaxConstrained",
}
Differences = tuple[Float[np.ndarray, "n w"], Int[np.ndarray, "n w"]]


def measure(folder: Path, seed: int = 0, progress: Progress = no_progress) -> StudyResults:
    """Root-mean-square errors of both memories, both scans and all images that a folder has, next to those published."""
    present, rows = present_sets(folder), []
    for done, (route, kind) in enumerate(present):
        progress(done, len(present))
        learned, grid = read_set(folder, route, kind)
        corners = simplified(learned.xy, tolerance_of(folder, route))
        distance, _, direction = nearest_segment(grid.xy, corners)
        near = distance < NEAR
        tested = Recorded(images=grid.images[near], xy=grid.xy[near], facing=grid.facing[near])
        for memory, compare in ((PERFECT, perfect_memory), (INFOMAX, infomax)):
            differences = compare(learned, tested, seed)
            for scan in (FULL, CONSTRAINED):
                within = None if scan == FULL else WITHIN
                headings = best_headings(*differences, tested.facing, direction[near], within)
                rows.append((route, memory, scan, kind, *_rmse(turn_between(headings, direction[near]))))
    progress(len(present), len(present))
    return _results(
        pd.DataFrame(rows, columns=["route", "memory", "scan", "images", "positions", "obtained", "low", "high"])
    )


def perfect_memory(learned: Recorded, tested: Recorded, seed: int) -> Differences:
    """Least sum of absolute differences from any learned image, at each rotation, and which image that is."""
    doubled = np.concatenate([tested.images, tested.images], axis=2).astype(np.int16)
    snapshots = learned.images.astype(np.int16)
    differences = np.empty((len(doubled), snapshots.shape[2]), dtype=np.int32)
    which = np.zeros_like(differences)

    def compare(begin: int, end: int) -> None:
        least_differences(doubled[begin:end], snapshots, differences[begin:end], which[begin:end])

    in_threads(compare, len(doubled), max(1, min(torch.get_num_threads(), len(doubled))))
    return differences.astype(float), which


def infomax(learned: Recorded, tested: Recorded, seed: int) -> Differences:
    """Sum of the absolute activity of a network that learned each image once, at each rotation."""
    model = Infomax(rate="unit-range", seed=seed)
    model.fit(torch.from_numpy(learned.images.astype(np.float32) / 255))
    turned_left = model.scan(torch.from_numpy(tested.images.astype(np.float32) / 255)).cpu().numpy()
    moved_left = np.roll(turned_left[:, ::-1], 1, axis=1)  # an image moved left is one seen after a turn to the right
    return -moved_left.astype(float), np.zeros(moved_left.shape, dtype=int)


def best_headings(
    differences: Float[np.ndarray, "n w"],
    which: Int[np.ndarray, "n w"],
    facing: Float[np.ndarray, " n"],
    direction: Float[np.ndarray, " n"],
    within: float | None = None,
) -> Float[np.ndarray, " n"]:
    """The heading of the least difference at each position; of equal ones that of the first image, then of the first rotation.

    Moving an image left by a column adds 360 / w degrees to its heading. So the axes of the published positions must be x to the
    right and y downwards, or their images mirrored; the original reckons so.

    Args:
        differences: At each rotation, moved left by 0, 1, .. columns.
        which: Image that has the least difference there.
        facing: Heading of each image as it was taken (degrees).
        direction: Of the route next to it (degrees).
        within: Only headings nearer than this to the route's direction (degrees); None is all.

    Returns:
        Headings (degrees).
    """
    width = differences.shape[1]
    moved = np.arange(width)
    turns = np.where(moved > width // 2, moved - width, moved) * (360 / width)
    best = np.empty(len(differences))
    for row, (values, images) in enumerate(zip(differences, which, strict=True)):
        headings = facing[row] + turns
        allowed = moved if within is None else moved[np.abs(turn_between(headings, direction[row])) < within]
        order = np.lexsort((allowed, images[allowed], values[allowed]))
        best[row] = headings[allowed[order[0]]]
    return best


def turn_between(headings: Float[np.ndarray, " n"], others: Float[np.ndarray, " n"] | float) -> Float[np.ndarray, " n"]:
    """Headings less others (degrees, from -180 to under 180)."""
    return (headings - others + 180) % 360 - 180


def _rmse(errors: Float[np.ndarray, " n"]) -> tuple[int, float, float, float]:
    """Number of errors, their root mean square, and the ends of its bootstrap interval, for which positions are drawn."""
    count = len(errors)
    if count == 0:
        return 0, np.nan, np.nan, np.nan
    squares = errors**2
    drawn = np.random.default_rng(0).multinomial(count, np.full(count, 1 / count), size=SAMPLES) / count
    low, high = np.quantile(np.sqrt(drawn @ squares), [(1 - CONFIDENCE) / 2, (1 + CONFIDENCE) / 2])
    return count, float(np.sqrt(squares.mean())), float(low), float(high)


def _results(obtained: pd.DataFrame) -> StudyResults:
    keys = ["route", "memory", "scan", "images"]
    published = pd.DataFrame(
        [
            (route, *memory, kind, PUBLISHED[route, name, kind])
            for memory, name in MEMORIES.items()
            for route in ROUTES
            for kind in IMAGES
        ],
        columns=[*keys, "published"],
    )
    table = published.merge(obtained, on=keys, how="left")
    table["difference"] = table["obtained"] - table["published"]
    means = table.dropna(subset=["obtained"]).groupby(["memory", "scan", "images"], sort=False)
    summary = means[["published", "obtained", "difference"]].mean().reset_index()
    return StudyResults(
        tables={"errors": table, "summary": summary},
        numbers={"errors obtained": int(table["obtained"].notna().sum()), "errors published": len(table)},
    )


def _of(results: StudyResults, **chosen: str) -> pd.DataFrame:
    """The errors that were obtained, of some memory, scan or images."""
    table = results.tables["errors"].dropna(subset=["obtained"])
    for column, value in chosen.items():
        table = table[table[column] == value]
    return table


@claim(
    "perfect-memory-repeats",
    "errors",
    f"each error that could be obtained differs by less than {SAME:g} degrees",
    note="It draws nothing, so on the same images it can be the same to the digit.",
)
def _perfect_memory_repeats(results: StudyResults) -> Decision:
    """Perfect memory makes the published errors."""
    apart = _of(results, memory=PERFECT)["difference"].abs()
    if apart.empty:
        return Decision({"errors obtained": 0.0}, None)
    obtained = {"errors obtained": float(len(apart)), "largest difference (deg)": float(apart.max())}
    return Decision(
        obtained | {f"differ by less than {SAME:g} degrees": float((apart < SAME).sum())}, bool((apart < SAME).all())
    )


@claim(
    "infomax-repeats",
    "agreement",
    "nine in ten published errors lie in the 95 % interval obtained",
    note="Its first weights are random, and the original's are not known.",
)
def _infomax_repeats(results: StudyResults) -> Decision:
    """Infomax makes the published errors, but for its random weights."""
    table = _of(results, memory=INFOMAX)
    if table.empty:
        return Decision({"errors obtained": 0.0}, None)
    inside = table["published"].between(table["low"], table["high"])
    obtained = {"errors obtained": float(len(table)), "share of the published ones inside": float(inside.mean())}
    return Decision(obtained, bool(inside.mean() >= 0.9))


def _lower(results: StudyResults, column: str, better: str, worse: str, **chosen: str) -> tuple[int, int]:
    """In how many pairs, of how many, the error is lower, or equal, with one value of a column than with another."""
    rest = [each for each in ("route", "memory", "scan", "images") if each != column]
    table = _of(results, **chosen)
    pairs = table[table[column] == better].merge(table[table[column] == worse], on=rest, suffixes=("", "_worse"))
    return int((pairs["obtained"] <= pairs["obtained_worse"]).sum()), len(pairs)


@claim(
    "constrained-lower",
    "summary",
    "the error is not higher in any pair of scans of the same images by the same memory",
    published={"pairs": 48.0, "not higher within 90 degrees": 48.0},
)
def _constrained_lower(results: StudyResults) -> Decision:
    """Ignoring headings that are more than 90 degrees away from the route solves visual aliasing."""
    lower, pairs = _lower(results, "scan", CONSTRAINED, FULL)
    return Decision(
        {"pairs": float(pairs), "not higher within 90 degrees": float(lower)}, lower == pairs if pairs else None
    )


@claim(
    "segmentation-helps",
    "summary",
    "perfect memory within 90 degrees makes lower errors with mask than with unwrapped on most routes",
    published={"routes": 6.0, "lower with mask": 5.0},
)
def _segmentation_helps(results: StudyResults) -> Decision:
    """Segmenting the sky improves perfect memory on almost all routes."""
    lower, routes = _lower(results, "images", "mask", "unwrapped", memory=PERFECT, scan=CONSTRAINED)
    return Decision({"routes": float(routes), "lower with mask": float(lower)}, lower > routes / 2 if routes else None)


CLAIMS = (_perfect_memory_repeats, _infomax_repeats, _constrained_lower, _segmentation_helps)

PARAMETERS = (
    Parameter("Images", "six routes by robot, and a grid of 15 x 13 positions 1.2 m apart", "the published ones"),
    Parameter("View", "120 x 25, grey", "120 x 25, grey"),
    Parameter("Tested", "grid positions within 4 m of the route", "the same"),
    Parameter("Right heading", "that of the nearest segment of the simplified route", "the same"),
    Parameter("Perfect memory", "mean absolute difference, columns of 3 degrees", "the same, in whole numbers"),
    Parameter(
        "Infomax", "as many units as pixels, one pass", "the same; eta / N = 0.97 / (inputs x units), views in 0..1"
    ),
    Parameter("Measured", "root-mean-square error (degrees)", "the same; and its bootstrap interval over positions"),
)

DIFFERENCES = (
    "The first weights of Infomax, and the order of its rounding, are not those of the original.",
    "Where the folder has no images of the horizon, they are the means of the columns of `mask`, one row; how the original makes them is "
    "unknown to us.",
    "Routes are simplified as the file decimate.sh of each says, else to 15 cm, the original's default.",
    "Where a position is nearest to a corner of the route, the segment before it counts; in the original rounding decides.",
    "Intervals draw positions as if they were independent; neighbouring ones are not, so they are rather too narrow.",
)

ITEMS = (
    Item(
        "summary",
        "Errors by memory, scan and images",
        "summary",
        "Root-mean-square errors (degrees), mean over the routes that could be obtained.",
    ),
    Item(
        "agreement",
        "Obtained against published",
        "errors",
        "Root-mean-square errors; bars are 95 % bootstrap intervals over positions. On the dotted line both are equal.",
        lambda table: agreement(table, "memory", "degrees"),
    ),
    Item(
        "errors",
        "All 96 errors",
        "errors",
        "Root-mean-square errors (degrees); low and high are the ends of the 95 % interval.",
    ),
)

KNIGHT2019 = DatabaseProtocol(
    name="knight2019",
    title="Outdoor routes from published images: perfect memory and Infomax",
    paper="Knight JC, Sakhapov D, Domcsek N, Dewar ADM, Graham P, Nowotny T, Philippides A (2019). Insect-inspired visual "
    "navigation on-board an autonomous robot: real-world routes encoded in a single layer network. Artificial Life "
    "Conference Proceedings 31, 60-67.",
    question="How well are headings recovered around real routes, from the published images?",
    parameters=PARAMETERS,
    differences=DIFFERENCES,
    claims=CLAIMS,
    items=ITEMS,
    measure=measure,
)
