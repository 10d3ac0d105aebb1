"""The ring in the pictures of a panoramic lens, found by its even surround: its outer circle, and its centre that shows nothing."""

from collections.abc import Sequence

import attrs
import cv2
import numpy as np
from jaxtyping import Bool, Float

from tussock.world.errors import FileError

from .lenses import Ring
from .pictures import Picture

CORNER = 0.04  # side of the squares in the corners that show the surround, as a share of the picture's shorter side
MIN_CONTRAST = (
    16  # grey levels by which the ring differs from its surround; JPEG artefacts of strong edges are about as large
)
MAX_CORNER_SPREAD = 30  # grey levels between the corners, which show an even surround
TRIPLES = 3000  # circles that are tried, through three random points each
MIN_INLIERS = 0.35  # of the outermost points of the ring that must lie on its circle
MIN_SECTORS = 15  # of 36 sectors in which the circle must be seen
ANGLES = 720


@attrs.frozen
class FoundRing:
    """A ring in pictures.

    Attributes:
        centre: x and y (pixels).
        inner: Radius of the inner circle (pixels); 0 where the centre is not dark.
        outer: Radius of the outer circle (pixels).
        seen: Share of the outer circle along which its edge was seen.
    """

    centre: tuple[float, float]
    inner: float
    outer: float
    seen: float


def find_ring(pictures: Sequence[Picture]) -> FoundRing:
    """Find the ring in one picture, or what is common to several of one camera, which is safer where parts of it are dark.

    Raises:
        FileError: There is no ring with an even surround.
    """
    lit = _lit(pictures)
    points = _outermost(lit)
    if len(points) < 12:
        raise FileError(
            "no ring was found: nothing in the picture differs from its corners; give its centre and both radii"
        )
    centre, outer = _circle_around(points)
    distance = np.hypot(*(points - centre).T)
    on_it = np.abs(distance - outer) <= _tolerance(outer)
    angles = np.arctan2(points[on_it, 1] - centre[1], points[on_it, 0] - centre[0])
    seen = len(np.unique(np.floor(angles / (2 * np.pi) * 36) % 36)) / 36
    if on_it.mean() < MIN_INLIERS or seen * 36 < MIN_SECTORS:
        raise FileError(
            f"no ring was found: the best circle fits {on_it.mean():.0%} of what borders on the surround; give its centre and both radii"
        )
    # The centres of the outermost pixels lie from 0 to 1 pixel inside the circle, on average by a half.
    return FoundRing((float(centre[0]), float(centre[1])), _inner_radius(lit, centre, outer), float(outer) + 0.5, seen)


def draw_ring(picture: Picture, ring: Ring) -> Picture:
    """A picture with its ring: both circles in red, the centre, and a green line to where ahead is."""
    drawn = np.ascontiguousarray(picture[..., :3])
    centre = (round(ring.centre[0]), round(ring.centre[1]))
    thick = max(1, round(max(picture.shape) / 400))
    for radius in (ring.inner, ring.outer):
        cv2.circle(drawn, centre, max(1, round(radius)), (255, 0, 0), thick, cv2.LINE_AA)
    cv2.drawMarker(drawn, centre, (255, 0, 0), cv2.MARKER_CROSS, 8 * thick, thick)
    away = np.array([np.sin(ring.offset), -np.cos(ring.offset)])
    begin, end = (
        np.rint(np.array(ring.centre) + radius * away).astype(int).tolist() for radius in (ring.inner, ring.outer)
    )
    cv2.arrowedLine(drawn, begin, end, (0, 255, 0), thick, cv2.LINE_AA, tipLength=0.1)
    return drawn


def _lit(pictures: Sequence[Picture]) -> Bool[np.ndarray, "height width"]:
    """Which pixels differ from the surround, in any of the pictures."""
    shape = pictures[0].shape[:2]
    side = max(2, round(CORNER * min(shape)))
    most = np.zeros(shape, dtype=np.float32)
    for picture in pictures:
        if picture.shape[:2] != shape:
            raise FileError("the pictures have different sizes; give pictures of one camera")
        colours = picture[..., :3].astype(np.float32)
        corners = [
            colours[y, x].reshape(-1, 3)
            for y in (slice(side), slice(-side, None))
            for x in (slice(side), slice(-side, None))
        ]
        levels = np.array([np.median(corner, axis=0) for corner in corners])
        if np.ptp(levels, axis=0).max() > MAX_CORNER_SPREAD:
            raise FileError(
                "no ring was found: the corners of the picture are not an even surround; give its centre and both radii"
            )
        np.maximum(most, np.abs(colours - np.median(levels, axis=0)).max(axis=2), out=most)
    return cv2.medianBlur((most > MIN_CONTRAST).astype(np.uint8), 3).astype(bool)


def _outermost(lit: Bool[np.ndarray, "height width"]) -> Float[np.ndarray, "n 2"]:
    """x and y of the first and last lit pixel of each row and column, but those at the picture's border."""
    height, width = lit.shape
    points = []
    for mask, flip in ((lit, False), (lit.T, True)):
        lines = np.flatnonzero(mask.any(axis=1))
        first, last = mask[lines].argmax(axis=1), mask.shape[1] - 1 - mask[lines, ::-1].argmax(axis=1)
        for ends in (first, last):
            found = np.column_stack([ends, lines])
            points.append(found[:, ::-1] if flip else found)
    points = np.unique(np.concatenate(points), axis=0).astype(float)
    inside = (points > 0).all(axis=1) & (points[:, 0] < width - 1) & (points[:, 1] < height - 1)
    return points[inside]


def _tolerance(radius: float) -> float:
    return max(1.0, 0.006 * radius)


def _circle_around(points: Float[np.ndarray, "n 2"]) -> tuple[Float[np.ndarray, " 2"], float]:
    """Centre and radius of the circle that has the most points on it, and few outside (points inside: the ring is dark there)."""
    rng = np.random.default_rng(0)
    some = points[rng.permutation(len(points))[:800]]
    centres, radii = _through(some[rng.integers(len(some), size=(TRIPLES, 3))])
    extent = np.hypot(*np.ptp(points, axis=0))
    usable = np.isfinite(radii) & (radii < extent) & (radii > 4)
    best, score = (points.mean(axis=0), extent / 2), -np.inf
    for centre, radius in zip(centres[usable], radii[usable], strict=True):
        off = np.hypot(*(some - centre).T) - radius
        tolerance = _tolerance(radius)
        found = np.count_nonzero(np.abs(off) <= tolerance) - 2 * np.count_nonzero(off > 2 * tolerance)
        if found > score:
            best, score = (centre, float(radius)), found
    centre, radius = best
    for _ in range(5):
        off = np.hypot(*(points - centre).T) - radius
        near = points[np.abs(off) <= _tolerance(radius)]
        if len(near) < 3:
            break
        # The circle x^2 + y^2 = 2 a x + 2 b y + c with the least squares of this equation (Kasa 1976).
        a, b, c = np.linalg.lstsq(np.column_stack([2 * near, np.ones(len(near))]), (near**2).sum(axis=1), rcond=None)[0]
        centre, radius = np.array([a, b]), float(np.sqrt(max(c + a * a + b * b, 0.0)))
    return centre, radius


def _through(triples: Float[np.ndarray, "n 3 2"]) -> tuple[Float[np.ndarray, "n 2"], Float[np.ndarray, " n"]]:
    """Centre and radius of the circles through three points each; not finite where these are on a line."""
    first, second, third = (triples[:, i] for i in range(3))
    a, b = second - first, third - first
    with np.errstate(all="ignore"):
        cross = 2 * (a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])
        aa, bb = (a**2).sum(axis=1), (b**2).sum(axis=1)
        x = (b[:, 1] * aa - a[:, 1] * bb) / cross
        y = (a[:, 0] * bb - b[:, 0] * aa) / cross
        return first + np.column_stack([x, y]), np.hypot(x, y)


def _inner_radius(lit: Bool[np.ndarray, "height width"], centre: Float[np.ndarray, " 2"], outer: float) -> float:
    """Radius up to which the ring shows nothing, 0 if its centre shows something."""
    radius = np.arange(0, outer, 0.5)
    angle = np.linspace(0, 2 * np.pi, ANGLES, endpoint=False)
    x = np.rint(centre[0] + np.outer(radius, np.cos(angle))).astype(int)
    y = np.rint(centre[1] + np.outer(radius, np.sin(angle))).astype(int)
    inside = (x >= 0) & (x < lit.shape[1]) & (y >= 0) & (y < lit.shape[0])
    share = np.where(inside, lit[np.clip(y, 0, lit.shape[0] - 1), np.clip(x, 0, lit.shape[1] - 1)], False).sum(axis=1)
    share = share / np.maximum(inside.sum(axis=1), 1)
    usual = np.median(share[len(share) // 2 : -2]) if len(share) > 6 else 1.0
    dark = share < 0.5 * usual
    if not dark[: min(4, len(dark))].all():
        return 0.0
    return float(radius[np.argmin(dark)]) if not dark.all() else 0.0
