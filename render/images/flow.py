"""Whether the views of a grid stand where their labels say: in which direction a step from one to the next looks to lead.

A whole square grid that is transposed keeps its neighbours, so their likeness tells nothing. What is seen moves, though: after
a step of length d in direction phi everything at distance r and azimuth a is seen d / r sin(a - phi) farther left. All
things taken to be equally far, a view can be warped as a step would change it (Franz et al. 1998), and the step whose warped
view is most like the next one is the step that was taken.
"""

import cv2
import numpy as np
from jaxtyping import Float, Float32, Int

from .database import Database, read_image

COLUMNS, ROWS = 90, 12  # of the reduced views that are compared
RATIOS = (0.05, 0.1, 0.2, 0.3)  # of the length of a step to the distance of what is seen
DIRECTIONS = np.radians([0, 90, 180, 270])  # +x, +y, -x, -y
NAMES = ("+x", "+y", "-x", "-y")
LABELS = ("+x", "+y")
MOST_PAIRS = 100  # looked at along each axis
FEWEST_PAIRS = 24  # on fewer nothing is said
# An accusation needs this share of the pairs, and so much more than the labels have. In right grids of 8 seeds of every preset
# (8 x 8 views of 24 x 6 pixels 0.2 m apart, or 26 x 26 of 90 x 25, 0.1 to 0.4 m apart) at least 0.48 of the pairs of either
# axis see its own direction, and at most 0.27 any other one.
MAJORITY, MARGIN = 0.45, 0.2

# What it comes to that steps labelled so look like steps in two other directions.
MEANINGS = {
    ("+y", "+x"): "x and y are exchanged (the grid is transposed)",
    ("-x", "+y"): "x is mirrored",
    ("+x", "-y"): "y is mirrored",
    ("-x", "-y"): "both axes are mirrored, or the views face backwards",
    ("-y", "+x"): "the views face 90 degrees to the left of their headings",
    ("+y", "-x"): "the views face 90 degrees to the right of their headings",
    ("-y", "-x"): "x and y are exchanged and mirrored",
}


def misplaced(database: Database, rows: Int[np.ndarray, " m"], seed: int = 0) -> str | None:
    """A sentence on how the axes of a grid are exchanged, mirrored or turned, or None where they are not, or nobody can tell.

    rows: those whose images can be read; they are unwrapped panoramas.
    """
    rng = np.random.default_rng(seed)
    votes = []
    for axis, pairs in enumerate(_neighbours(database.poses, rows)):
        if len(pairs) < FEWEST_PAIRS:
            return None
        pairs = pairs[rng.permutation(len(pairs))[:MOST_PAIRS]]
        before, after = (np.stack([_reduced(database, row) for row in column]) for column in pairs.T.tolist())
        costs = _costs(before, after, database.poses[pairs[:, 0], 2], database.poses[pairs[:, 1], 2])
        costs[:, axis] -= 1e-3  # grey levels: where all are alike, nothing speaks against the label
        votes.append(np.bincount(costs.argmin(axis=1), minlength=4) / len(pairs))
    shares = {(a, b): (votes[0][NAMES.index(a)] + votes[1][NAMES.index(b)]) / 2 for a, b in [LABELS, *MEANINGS]}
    best = max(shares, key=lambda seen: shares[seen])
    if shares[best] < MAJORITY or shares[best] < shares[LABELS] + MARGIN:
        return None
    return f"steps along +x look like steps along {best[0]}, those along +y like {best[1]}: {MEANINGS[best]}"


def _neighbours(poses: Float[np.ndarray, "n 3"], rows: Int[np.ndarray, " m"]) -> list[Int[np.ndarray, "pairs 2"]]:
    """Pairs of the rows that stand side by side in the grid, along +x and along +y."""
    rows = rows[np.isfinite(poses[rows]).all(axis=1)]
    places = np.rint(poses[rows, :2] * 1e3).astype(int)
    x, y = (np.unique(column, return_inverse=True)[1].ravel() for column in places.T)
    at = dict(zip(zip(x.tolist(), y.tolist(), strict=True), rows.tolist(), strict=True))
    found = []
    for right, up in ((1, 0), (0, 1)):
        pairs = [(row, at[i + right, j + up]) for (i, j), row in at.items() if (i + right, j + up) in at]
        found.append(np.array(pairs, dtype=int).reshape(-1, 2))
    return found


def _reduced(database: Database, row: int) -> Float32[np.ndarray, "height width"]:
    view = read_image(database.folder / (database.names[row] or ""))
    grey = cv2.cvtColor(np.ascontiguousarray(view[..., :3]), cv2.COLOR_RGB2GRAY).astype(np.float32)
    size = min(COLUMNS, grey.shape[1]), min(ROWS, grey.shape[0])
    return cv2.resize(grey, size, interpolation=cv2.INTER_AREA)


def _costs(
    before: Float32[np.ndarray, "n height width"], after: Float32[np.ndarray, "n height width"],
    heading_before: Float[np.ndarray, " n"], heading_after: Float[np.ndarray, " n"],
) -> Float[np.ndarray, "n 4"]:  # fmt: skip
    """Least RMS difference between the views after a step and those before, warped as steps in each of DIRECTIONS would."""
    width = before.shape[2]
    azimuths = np.pi - (np.arange(width) + 0.5) * 2 * np.pi / width  # in the world
    after = _seen_at(after, azimuths, heading_after)
    costs = np.full((len(DIRECTIONS), len(before)), np.inf)
    for direction, phi in enumerate(DIRECTIONS):
        for ratio in RATIOS:
            warped = _seen_at(before, azimuths - ratio * np.sin(azimuths - phi), heading_before)
            costs[direction] = np.minimum(costs[direction], np.sqrt(((warped - after) ** 2).mean(axis=(1, 2))))
    return costs.T


def _seen_at(
    views: Float32[np.ndarray, "n height width"],
    azimuths: Float[np.ndarray, " width"],
    heading: Float[np.ndarray, " n"],
) -> Float32[np.ndarray, "n height width"]:
    """What views show at azimuths of the world, between columns by linear interpolation."""
    width = views.shape[2]
    column = (np.pi - (azimuths - heading[:, None])) * width / (2 * np.pi) - 0.5  # (n, width)
    left = np.floor(column).astype(int)
    share = (column - left).astype(np.float32)[:, None]
    each = np.arange(len(views))[:, None]
    a, b = (np.swapaxes(views[each, :, at % width], 1, 2) for at in (left, left + 1))
    return a * (1 - share) + b * share
