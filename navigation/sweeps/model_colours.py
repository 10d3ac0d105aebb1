"""The colours and markers of models in figures: a model has the same colour in all of them."""

from collections import Counter
from collections.abc import Iterable
from zlib import crc32

from ..models import MODELS

MODEL_COLOURS = (  # told apart by most people; models of tussock have them in turn
    "#2f6bff", "#e6352b", "#2b8a6f", "#8a6100", "#7b4fb5", "#00a3c4", "#e07b00", "#c2338f", "#5a6b1f", "#333333", "#7fa7ff", "#f2918b",
    "#7cc9b0", "#cfa34a", "#b99be0", "#7fd6e8", "#9aa3ad", "#efb3d7", "#b5c46f",
)  # fmt: skip
MARKERS = "osD^vPX"


def model_colour(model: str) -> str:
    """The colour of a model, by its name or spec: the same in all reports."""
    name = model.split(" ")[0]
    known = list(MODELS.builtin)
    return MODEL_COLOURS[(known.index(name) if name in known else crc32(name.encode())) % len(MODEL_COLOURS)]


def model_markers(models: Iterable[str]) -> list[str]:
    """A marker for each of several models, by which those of one colour differ."""
    had: Counter[str] = Counter()
    markers = []
    for colour in map(model_colour, models):
        markers.append(MARKERS[had[colour] % len(MARKERS)])
        had[colour] += 1
    return markers
