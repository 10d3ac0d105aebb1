"""The measurement of docs/eyes.md: what blanking columns of the view does, in place of a field of view."""

import math
from itertools import product
from pathlib import Path

import attrs
import numpy as np
from measurement import Measurement, Values, markdown, of

from tussock import Encoding, Experiment, Eye
from tussock.navigation.encoding_steps import PixelStep
from tussock.world.settings import number

EYE = Eye(width=180, height=40)
EDGES = Encoding.named("edges", resize=3)
FIELDS, WORLDS, SEEDS = (270, 180, 90), ("tussock-field", "meadow"), range(5)


@attrs.frozen
class Blank(PixelStep):
    """Sets the columns outside a field to 0: what docs/eyes.md warns of."""

    field_deg: float = number(above=0, high=360)

    def __call__(self, images):
        width = images.shape[2]
        hidden = math.ceil(width * (1 - self.field_deg / 360) / 2)  # on each side
        images[:, :, :hidden] = images[:, :, width - hidden :] = 0.0
        return images

    def bounds(self, low, high, pixels):
        return min(low, 0.0), max(high, 0.0)


def measure(folder: Path) -> Values:
    """Walks with each field, by the eye and by blanking in ten worlds."""
    return {
        str(field): {
            way: [deviation(world, seed, field, way) for world, seed in product(WORLDS, SEEDS)]
            for way in ("eye", "blank")
        }
        for field in FIELDS
    }


def deviation(world: str, seed: int, field: int, way: str) -> float | None:
    """The mean deviation (m) of a walk of perfect memory; None where it does not arrive."""
    if way == "blank":
        eye, encoding = EYE, Encoding((*EDGES.steps, Blank(field)))
    else:
        eye, encoding = attrs.evolve(EYE, field=math.radians(field)), EDGES
    experiment = Experiment(world=world, seed=seed, route_length=4.0, start_offset=0.1, eye=eye, encoding=encoding)
    summary = experiment.run().summary()
    return summary["mean_deviation_m"] if summary["reason"] == "arrived" else None


def table(values: Values) -> str:
    """One line for each field."""

    def cell(deviations: list[float | None]) -> str:
        arrived = [each for each in deviations if each is not None]
        return f"{of([len(arrived), len(deviations)])}, {100 * np.mean(arrived):.1f} cm" if arrived else "0"

    rows = ([field, cell(ways["eye"]), cell(ways["blank"])] for field, ways in values.items())
    return markdown(["field", "`Eye(field=...)`: arrived, off the route", "columns blanked in the encoding"], rows)


MEASUREMENTS: dict[str, Measurement] = {
    "fields": Measurement("`docs/numbers/eyes.py`", measure, {"table": table}, slow=True),
}
