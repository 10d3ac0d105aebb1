"""What the test bed asks of everyone: fixed, and known by its name. What is changed in it has a new name."""

import hashlib
import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import groupby
from typing import Any

import numpy as np

from ..cli.run_options import RunOptions
from ..sweeps.spec import Sweep

# Of every run. All settings of a run stand here, in Benchmark.sweep, or are what entries differ in: no default is relied on.
SETTINGS: Mapping[str, Any] = {
    "size": "360x75", "samples": 1, "renderer": "cpu", "eye_height_m": 0.01, "top_deg": 60.0, "bottom_deg": -15.0,
    "cull_back_faces": False, "world_seed": None, "route": None, "route_seed": None, "route_length_m": 8.0, "resize": None, "blur": 0.0,
    "spacing_m": 0.4, "every": 1, "learning_walk_m": 0.2, "device": "cpu", "threads": 1, "step_m": 0.05, "scan_deg": 180.0,
    "scan_about_deg": None, "on_lost": "stop", "waypoint_m": 0.1, "arrive_m": 0.15, "lost_m": 0.5, "patience_m": 3.0, "max_steps": None,
}  # fmt: skip
ENCODING = "edges"  # of entries that choose none


@dataclass(frozen=True, kw_only=True)
class Benchmark:
    """A run for each combination of a world, a noise and a displacement.

    name: by which results say what they are of. worlds: the preset and seed of each; the seed is also that of the route, the model and
    the noise. noises_deg: on every turn (standard deviations). displacements_m: of the start, to the left of the route (negative: right).
    settings: of every run, by the names of the flags of tussock run.
    """

    name: str
    worlds: tuple[tuple[str, int], ...]
    noises_deg: tuple[float, ...]
    displacements_m: tuple[float, ...]
    settings: Mapping[str, Any]

    def __len__(self) -> int:
        return len(self.worlds) * len(self.noises_deg) * len(self.displacements_m)

    def sweep(self, model: str, encoding: str = ENCODING) -> Sweep:
        """The runs of a model, as a sweep."""
        axes: dict[str, list[dict[str, Any]]] = {
            "world": [{"world": world, "seed": seed} for world, seed in self.worlds],
            "heading_noise_deg": [{"heading_noise_deg": noise} for noise in self.noises_deg],
            "offset_m": [{"offset_m": displacement} for displacement in self.displacements_m],
        }
        return Sweep(title=self.name, fixed={**self.settings, "model": model, "encoding": encoding}, axes=axes)

    def by_world(self, encoding: str = ENCODING) -> Iterator[list[RunOptions]]:
        """The runs, those of one world together. Their model is for the entry to bring."""
        runs = self.sweep(RunOptions.model, encoding).runs()
        for _, group in groupby(runs, key=lambda run: (run.world, run.seed)):
            yield list(group)

    def chain(self, encoding: str = ENCODING) -> str:
        """An encoding by all its steps."""
        return str(next(self.by_world(encoding))[0].chosen_encoding())

    def digest(self) -> str:
        """Of all that is asked, and of what the first world of each preset and its route grow to, to a tenth of a millimetre."""
        found, grown = hashlib.sha256(json.dumps([dict(self.settings), ENCODING], sort_keys=True).encode()), set()
        for runs in self.by_world():
            asked = [(run.world, run.seed, run.heading_noise_deg, run.offset_m) for run in runs]
            found.update(json.dumps(asked).encode())
            if runs[0].world in grown:
                continue
            grown.add(runs[0].world)
            world, route = runs[0].open_route()
            for metres in (world.triangles, route.xy):
                found.update(np.round(metres.astype(np.float64) * 1e4).astype(np.int64).tobytes())
            found.update(world.rgb.tobytes())
        return found.hexdigest()


def _worlds(count: int) -> tuple[tuple[str, int], ...]:
    """So many worlds of each preset, grown from seeds that nothing else in the project uses."""
    presets = {"tussock-field": 1000, "meadow": 1100, "scrub": 1200}
    return tuple((preset, first + k) for preset, first in presets.items() for k in range(count))


BENCHMARK = Benchmark(
    name="tussock-1", worlds=_worlds(4), noises_deg=(0.0, 20.0, 40.0), displacements_m=(-0.3, 0.0, 0.3),
    settings=SETTINGS,
)  # fmt: skip
# A first look, in a minute. What comes of it compares with nothing else, as its name says.
QUICK = Benchmark(
    name="tussock-1-quick", worlds=_worlds(1), noises_deg=(0.0, 40.0), displacements_m=(-0.3, 0.3), settings=SETTINGS
)
BENCHMARKS = {each.name: each for each in (BENCHMARK, QUICK)}
