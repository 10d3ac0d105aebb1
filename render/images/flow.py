"""Whether the views of a grid are where their labels say: the direction of a step between neighbours, by its optic flow.

A square grid that is transposed as a whole keeps its neighbours, so their similarity shows nothing. But what is seen moves: after
a step of length d in direction phi, everything at distance r and azimuth a appears d / r sin(a - phi) farther to the left. If all
things are taken to be equally far, a view can be warped as a step would change it (Franz et al. 1998). The step whose warped view
is the most similar to the next view is the step that was taken.
"""

import cv2
import numpy as np
from jaxtyping import Float, Float32, Int

from tussock.world.geometry import column_azimuths

from .database import Database

COLUMNS, ROWS = 90, 12  # of the reduced views that are compared; 4 degrees a column, as in Baddeley et al. 2012
DIRECTIONS = np.radians([0, 90, 180, 270])
DIRECTION_NAMES = ("+x", "+y", "-x", "-y")
LABELS = ("+x", "+y")  # the steps between neighbours in the grid
# Length of a step by the distance of what is seen. Measured in 96 grids (4 presets, 8 seeds, positions 0.1, 0.2 and 0.4 m apart):
# with these, no correct grid is reported and no transposed one is missed; with 0.3 alone 13 are missed, with 0.5 alone 27.
RATIOS = (0.05, 0.1, 0.2, 0.3)
MAX_PAIRS = 100  # along each axis, for speed
MIN_PAIRS = 24  # so that random votes reach MIN_SHARE with a probability of under 1 %
# An error needs this share of the pairs, and this much more than the labels have. Measured in correct grids of 8 seeds of each
# preset (8 x 8 views of 24 x 6 pixels 0.2 m apart, or 26 x 26 of 90 x 25, 0.1 to 0.4 m apart): at least 0.48 of the pairs of either
# axis show its own direction, and at most 0.27 show any other.
MIN_SHARE, MIN_MARGIN = 0.45, 0.2

# What it means that steps with these labels look like steps in two other directions.
MEANINGS = {
    ("+y", "+x"): "x and y are exchanged (the grid is transposed)",
    ("-x", "+y"): "x is mirrored",
    ("+x", "-y"): "y is mirrored",
    ("-x", "-y"): "both axes are mirrored, or the views face backwards",
    ("-y", "+x"): "the views face 90 degrees to the left of their headings",
    ("+y", "-x"): "the views face 90 degrees to the right of their headings",
    ("-y", "-x"): "x and y are exchanged and mirrored",
}


def grid_axes_error(database: Database, rows: Int[np.ndarray, " m"]) -> str | None:
    """Find axes of a grid that are exchanged, mirrored or turned.

    Args:
        database: A grid.
        rows: Rows with readable images of one size, which are unwrapped panoramas.

    Returns:
        A sentence, or None if the axes are right or that is undetermined.
    """
    rng = np.random.default_rng(0)
    votes = []
    for axis, pairs in enumerate(_neighbours(database.poses, rows)):
        if len(pairs) < MIN_PAIRS:
            return None
        pairs = pairs[rng.permutation(len(pairs))[:MAX_PAIRS]]
        before, after = (_reduced(database, column) for column in pairs.T)
        costs = _costs(before, after, database.poses[pairs[:, 0], 2], database.poses[pairs[:, 1], 2])
        costs[:, axis] -= 1e-3  # grey levels, so that equal costs are votes for the label
        votes.append(np.bincount(costs.argmin(axis=1), minlength=4) / len(pairs))
    shares = {
        (x, y): (votes[0][DIRECTION_NAMES.index(x)] + votes[1][DIRECTION_NAMES.index(y)]) / 2
        for x, y in [LABELS, *MEANINGS]
    }
    best = max(shares, key=lambda directions: shares[directions])
    if shares[best] < MIN_SHARE or shares[best] < shares[LABELS] + MIN_MARGIN:
        return None
    return f"steps along +x look like steps along {best[0]}, those along +y like {best[1]}: {MEANINGS[best]}"


def _neighbours(poses: Float[np.ndarray, "n 3"], rows: Int[np.ndarray, " m"]) -> list[Int[np.ndarray, "pairs 2"]]:
    """Pairs of rows that are neighbours in the grid, along +x and along +y."""
    rows = rows[np.isfinite(poses[rows]).all(axis=1)]
    positions = np.rint(poses[rows, :2] * 1e3).astype(int)
    x, y = (np.unique(column, return_inverse=True)[1].ravel() for column in positions.T)
    row_at = dict(zip(zip(x.tolist(), y.tolist(), strict=True), rows.tolist(), strict=True))
    neighbours = []
    for right, up in ((1, 0), (0, 1)):
        pairs = [(row, row_at[i + right, j + up]) for (i, j), row in row_at.items() if (i + right, j + up) in row_at]
        neighbours.append(np.array(pairs, dtype=int).reshape(-1, 2))
    return neighbours


def _reduced(database: Database, rows: Int[np.ndarray, " n"]) -> Float32[np.ndarray, "n height width"]:
    """Grey views of rows in few pixels."""
    reduced = []
    for start in range(0, len(rows), 25):
        for view in database.views(rows[start : start + 25]):
            grey = cv2.cvtColor(np.ascontiguousarray(view[..., :3]), cv2.COLOR_RGB2GRAY).astype(np.float32)
            size = min(COLUMNS, grey.shape[1]), min(ROWS, grey.shape[0])
            reduced.append(cv2.resize(grey, size, interpolation=cv2.INTER_AREA))
    return np.stack(reduced)


def _costs(
    before: Float32[np.ndarray, "n height width"],
    after: Float32[np.ndarray, "n height width"],
    heading_before: Float[np.ndarray, " n"],
    heading_after: Float[np.ndarray, " n"],
) -> Float[np.ndarray, "n 4"]:
    """Least RMS difference between the views after a step and those before it, warped as steps in each direction would."""
    azimuths = column_azimuths(before.shape[2])  # in the world
    after = _resampled(after, azimuths, heading_after)
    costs = np.full((len(DIRECTIONS), len(before)), np.inf)
    for direction, phi in enumerate(DIRECTIONS):
        for ratio in RATIOS:
            warped = _resampled(before, azimuths - ratio * np.sin(azimuths - phi), heading_before)
            costs[direction] = np.minimum(costs[direction], np.sqrt(((warped - after) ** 2).mean(axis=(1, 2))))
    return costs.T


def _resampled(
    views: Float32[np.ndarray, "n height width"],
    azimuths: Float[np.ndarray, " width"],
    heading: Float[np.ndarray, " n"],
) -> Float32[np.ndarray, "n height width"]:
    """What views show at azimuths in the world, by linear interpolation between columns."""
    width = views.shape[2]
    column = (np.pi - (azimuths - heading[:, None])) * width / (2 * np.pi) - 0.5  # (n, width)
    left = np.floor(column).astype(int)
    share = (column - left).astype(np.float32)[:, None]
    each = np.arange(len(views))[:, None]
    a, b = (np.swapaxes(views[each, :, index % width], 1, 2) for index in (left, left + 1))
    return a * (1 - share) + b * share
