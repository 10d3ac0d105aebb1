"""What an agent keeps of a view: a chain of named steps from a panorama to a feature image.

`Encoding.parse("sky-mask | vertical-edges | resize 3 | normalise")` and `str(encoding)` are each other's inverse. Every step
treats the panorama as the ring it is, so that turning the eye rolls the feature image (exactly, where the resize
factor divides the turn and the width; see `Clahe` for the one step whose tiles turn with the eye).
"""

from dataclasses import dataclass, fields
from typing import ClassVar

import cv2
import numpy as np
import torch
from jaxtyping import Float32, UInt8

from tussock.world.errors import InputError

Views = UInt8[np.ndarray, "n height width channels"]
Images = Float32[np.ndarray, "n h w"]


@dataclass(frozen=True)
class Grey:
    """Brightness, 0..1 (ITU-R BT.601 weights, as OpenCV converts)."""

    word: ClassVar[str] = "grey"

    def __call__(self, views: Views) -> Images:
        red, green, blue = np.array([0.299, 0.587, 0.114], dtype=np.float32) / np.float32(255)
        return views[..., 0] * red + views[..., 1] * green + views[..., 2] * blue  # faster than a product of matrices


@dataclass(frozen=True)
class SkyMask:
    """Share of each pixel that is not open sky, 0..1: exact where views carry alpha, else estimated from their colours.

    The estimate takes the median colour of the top rows for the sky, and Otsu's threshold on the distance from it.
    """

    word: ClassVar[str] = "sky-mask"

    def __call__(self, views: Views) -> Images:
        if views.shape[-1] == 4:
            return views[..., 3] * np.float32(1 / 255)
        masks = np.empty(views.shape[:3], dtype=np.float32)
        for view, mask in zip(views, masks, strict=True):
            top = view[: max(1, len(view) // 10)].reshape(-1, view.shape[-1])
            away = np.abs(view.astype(np.int16) - np.median(top, axis=0).astype(np.int16)).max(axis=-1).astype(np.uint8)
            threshold, _ = cv2.threshold(away, 0, 1, cv2.THRESH_BINARY + cv2.THRESH_OTSU)
            mask[:] = away > threshold
        return masks


@dataclass(frozen=True)
class Blur:
    """Gaussian smoothing with a standard deviation of `sigma` pixels; around the ring, mirrored at top and bottom."""

    sigma: float
    word: ClassVar[str] = "blur"

    def __post_init__(self):
        if not 0 < self.sigma <= 100:
            raise InputError(f"blur {self.sigma:g}: give a standard deviation over 0 and up to 100 pixels")

    def __call__(self, images: Images) -> Images:
        margin = int(np.ceil(4 * self.sigma))
        wrapped = np.pad(images, ((0, 0), (0, 0), (margin, margin)), mode="wrap")
        size = 2 * margin + 1
        blurred = [
            cv2.GaussianBlur(image, (size, size), self.sigma, borderType=cv2.BORDER_REFLECT) for image in wrapped
        ]
        return np.stack(blurred)[:, :, margin:-margin] if len(images) else images


@dataclass(frozen=True)
class Resize:
    """Area average down to 1 / `factor` of the width and height (rounded, at least 4 x 1)."""

    factor: float
    word: ClassVar[str] = "resize"

    def __post_init__(self):
        if not 1 <= self.factor <= 1000:
            raise InputError(f"resize {self.factor:g}: give a factor from 1 (as it is) up to 1000")

    def __call__(self, images: Images) -> Float32[np.ndarray, "n rows columns"]:
        n, height, width = images.shape
        h, w = reduced(height, width, self.factor)
        if (h, w) == (height, width) or n == 0:
            return images[:, :h, :w]
        if height % h == 0 and width % w == 0:
            return images.reshape(n, h, height // h, w, width // w).mean(axis=(2, 4), dtype=np.float32)
        return np.stack([cv2.resize(image, (w, h), interpolation=cv2.INTER_AREA) for image in images])


@dataclass(frozen=True)
class Sample:
    """Bilinear samples `factor` pixels apart, nothing averaged before: fine things alias, as in cv2.resize by default.

    The thesis resized its views so. Width and height as `Resize` makes them.
    """

    factor: float
    word: ClassVar[str] = "sample"

    def __post_init__(self):
        if not 1 <= self.factor <= 1000:
            raise InputError(f"sample {self.factor:g}: give a factor from 1 (as it is) up to 1000")

    def __call__(self, images: Images) -> Float32[np.ndarray, "n rows columns"]:
        h, w = reduced(images.shape[1], images.shape[2], self.factor)
        if (h, w) == images.shape[1:] or len(images) == 0:
            return images[:, :h, :w]
        return np.stack([cv2.resize(image, (w, h), interpolation=cv2.INTER_LINEAR) for image in images])


@dataclass(frozen=True)
class Invert:
    """Bright becomes dark: 1 less each value."""

    word: ClassVar[str] = "invert"

    def __call__(self, images: Images) -> Images:
        return np.float32(1) - images


@dataclass(frozen=True)
class Clahe:
    """Contrast limited adaptive histogram equalisation, as cv2.createCLAHE does it in 256 levels.

    clip: its clip limit. tiles: how many across, and down. Those on both sides of the seam are neighbours as all others are. Tiles turn
    with the eye: a turn by whole tiles rolls the image, but for a level in one pixel of some 30,000, by rounding; a turn by half a
    tile rolls it to a level on average and 24 at most (measured on generated views of 720 x 150, clip 2, 8 tiles).
    Raises InputError where `tiles` does not divide the width.
    """

    clip: float
    tiles: float
    word: ClassVar[str] = "clahe"

    def __post_init__(self):
        if not 0 < self.clip <= 256:
            raise InputError(f"clahe {self.clip:g} {self.tiles:g}: give a clip limit over 0 and up to 256 (no limit)")
        if not (1 <= self.tiles <= 256 and self.tiles == round(self.tiles)):
            raise InputError(f"clahe {self.clip:g} {self.tiles:g}: give a whole number of tiles from 1 to 256")

    def __call__(self, images: Images) -> Images:
        height, width = images.shape[1:]
        tiles = int(self.tiles)
        if width % tiles:
            raise InputError(
                f"clahe {self.clip:g} {tiles}: {width} columns are no {tiles} equal tiles; give a divisor of {width}"
            )
        levels = np.rint(images * 255).clip(0, 255).astype(np.uint8)
        # OpenCV would pad the columns too where only the rows are no whole tiles.
        levels = np.pad(levels, ((0, 0), (0, -height % tiles), (0, 0)), mode="reflect")
        margin = width // tiles  # a tile
        wrapped = np.pad(levels, ((0, 0), (0, 0), (margin, margin)), mode="wrap")
        equaliser = cv2.createCLAHE(self.clip, (tiles + 2, tiles))
        equalised = [equaliser.apply(image)[:height, margin:-margin] for image in wrapped]
        return np.stack(equalised) * np.float32(1 / 255) if len(images) else images


@dataclass(frozen=True)
class Widen:
    """Each pixel averaged with its neighbours to the right, `columns` in all: pixels that much wider, and still one a column.

    So a view of coarse pixels can be turned by less than one of them, as an eye is that turns and looks again.
    """

    columns: float
    word: ClassVar[str] = "widen"

    def __post_init__(self):
        if not (1 <= self.columns <= 1000 and self.columns == round(self.columns)):
            raise InputError(f"widen {self.columns:g}: give a whole number of columns from 1 to 1000")

    def __call__(self, images: Images) -> Images:
        total = images.copy()
        for shift in range(1, int(self.columns)):
            total += np.roll(images, -shift, axis=-1)
        return total / np.float32(self.columns)


@dataclass(frozen=True)
class Scale:
    """Each value times `factor`: less contrast, for models whose learning rate is meant for it."""

    factor: float
    word: ClassVar[str] = "scale"

    def __post_init__(self):
        if not 0 < self.factor <= 1:
            raise InputError(f"scale {self.factor:g}: give a factor over 0 and up to 1")

    def __call__(self, images: Images) -> Images:
        return images * np.float32(self.factor)


@dataclass(frozen=True)
class VerticalEdges:
    """Strength of vertical edges: the absolute difference between each pixel and its neighbour to the right."""

    word: ClassVar[str] = "vertical-edges"

    def __call__(self, images: Images) -> Images:
        return np.abs(np.roll(images, -1, axis=-1) - images)


@dataclass(frozen=True)
class Normalise:
    """Each image shifted to mean 0 and scaled to unit variance (an image without contrast becomes 0)."""

    word: ClassVar[str] = "normalise"

    def __call__(self, images: Images) -> Images:
        centred = images - images.mean(axis=(1, 2), keepdims=True)
        deviation = centred.std(axis=(1, 2), keepdims=True)
        return centred / np.where(deviation > 1e-6, deviation, np.inf)


def reduced(height: int, width: int, factor: float) -> tuple[int, int]:
    """Rows and columns of an image reduced by `factor`."""
    return max(1, round(height / factor)), max(4, round(width / factor))


Filter = Grey | SkyMask | Invert | Clahe | Blur | Resize | Sample | Widen | Scale | VerticalEdges | Normalise
SOURCES: dict[str, type[Filter]] = {step.word: step for step in (Grey, SkyMask)}
FILTERS: dict[str, type[Filter]] = {
    step.word: step for step in (Blur, Resize, Sample, Widen, Scale, Invert, Clahe, VerticalEdges, Normalise)
}
PRESETS = {
    "grey": "grey | {blur}{resize}",
    "sky": "sky-mask | {blur}{resize}normalise",
    "edges": "sky-mask | {blur}vertical-edges | {resize}normalise",
}


@dataclass(frozen=True)
class Encoding:
    """A chain of steps, applied in order: one source (grey or sky-mask), then any number of filters."""

    steps: tuple[Filter, ...]

    def __post_init__(self):
        normalised = False
        for step in self.steps:
            if normalised and isinstance(step, Invert | Clahe):
                raise InputError(
                    f"encoding {str(self)!r}: {step.word} takes values from 0 to 1; put it before normalise"
                )
            normalised = normalised or isinstance(step, Normalise)

    def __call__(self, views: Views) -> Float32[torch.Tensor, "n h w"]:
        """Feature images of views (n, height, width, 3 or 4) uint8."""
        if views.ndim != 4 or views.shape[-1] not in (3, 4) or views.dtype != np.uint8:
            raise InputError(f"views are (n, height, width, 3 or 4) uint8, got {views.shape} {views.dtype}")
        # A few views at a time stay in the processor's cache through all the steps.
        parts = [self._encode(views[start : start + 4]) for start in range(0, max(1, len(views)), 4)]
        return torch.from_numpy(np.concatenate(parts))

    def _encode(self, views: Views) -> Images:
        images = views
        for step in self.steps:
            images = step(images)
        return images.astype(np.float32, copy=False)

    def bounds(self, height: int, width: int) -> tuple[tuple[int, int], float, float]:
        """Shape (h, w) of the feature image of a view of height x width, and between what numbers it lies, but for rounding."""
        images, low, high = np.zeros((1, height, width, 4), np.uint8), 0.0, 1.0
        for step in self.steps:
            images = step(images)
            if isinstance(step, VerticalEdges):
                low, high = 0.0, high - low
            elif isinstance(step, Normalise):
                high = float(np.sqrt(images.size - 1))  # of one pixel that differs from all others
                low = -high
            elif isinstance(step, Scale):
                low, high = step.factor * low, step.factor * high
        return (images.shape[1], images.shape[2]), low, high

    def __str__(self) -> str:
        return " | ".join(
            " ".join([step.word, *(f"{getattr(step, f.name):.15g}" for f in fields(step))]) for step in self.steps
        )

    @classmethod
    def parse(cls, text: str) -> "Encoding":
        """The encoding that `text` spells: steps separated by `|`, each a word and its numbers if it takes any."""
        steps = []
        for place, part in enumerate(text.split("|")):
            word, *numbers = part.split() or [""]
            known = SOURCES if place == 0 else FILTERS
            if word not in known:
                kind = "start" if place == 0 else "go on"
                raise InputError(f"encoding {text!r}: it cannot {kind} with {word!r}; known here: {', '.join(known)}")
            takes = len(fields(known[word]))
            try:
                values = [float(number) for number in numbers]
            except ValueError:
                values = []
            if len(values) != takes or len(numbers) != takes:
                raise InputError(
                    f"encoding {text!r}: {word} takes {takes or 'no'} number{'s' * (takes != 1)}, got {part.strip()!r}"
                )
            steps.append(known[word](*values))
        return cls(tuple(steps))

    @classmethod
    def named(cls, name: str, resize: float = 1.0, blur: float = 0.0) -> "Encoding":
        """A preset (grey, sky, edges) with its blur (pixels of the view) and resize factor, or a chain spelled out in full."""
        if "|" in name:
            if resize != 1 or blur != 0:
                raise InputError(f"encoding {name!r} is spelled out: put resize and blur into it instead of beside it")
            return cls.parse(name)
        if name not in PRESETS:
            raise InputError(
                f"unknown encoding {name!r}; known: {', '.join(PRESETS)}, or a chain such as '{PRESETS['grey'][:7]}resize 6'"
            )
        text = PRESETS[name].format(
            blur=f"blur {blur:.15g} | " if blur else "", resize=f"resize {resize:.15g} | " if resize != 1 else ""
        )
        return cls.parse(text.rstrip(" |"))
