"""What the test bed asks of every entry: fixed, and known by its name. Whatever changes in it gets a new name."""

import hashlib
import json
import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import groupby, product

import numpy as np

from tussock.render.eye import Eye

from ..body import Body
from ..experiment import Experiment
from ..experiment_keys import ROUTE_SETTINGS
from ..experiment_settings import TYPES, settings_of
from ..stopping import StoppingRules
from ..sweeps.spec import Sweep
from ..training_setup import TrainingSetup

NAVIGATOR = "scan"  # of entries that choose none
# All settings of a run are given here, in `Benchmark.sweep`, or by the entry, so that no default is relied on.
BASE = Experiment(
    world_seed=None,
    cull_back_faces=False,
    route=None,
    route_seed=None,
    eye=Eye(width=360, height=75, samples=1, z=0.01, top=math.radians(60.0), bottom=math.radians(-15.0)),
    encoding="edges",
    navigator=NAVIGATOR,
    route_length=8.0,
    training=TrainingSetup(spacing=0.4, every=1, learning_walk=0.2),
    body=Body(step_length=0.05),
    stopping=StoppingRules(
        arrival_radius=0.15, max_deviation=0.5, patience=3.0, max_steps=None, put_back=False, waypoint_spacing=0.1
    ),
    device="cpu",
    renderer="cpu",
    threads=1,
)
ENCODING = "edges"  # of entries that choose none
EARLY = {"world", "world_seed", "cull_back_faces", "route", "route_seed", "route_length_m"}  # as old as the benchmarks
# Settings newer than the benchmarks: where they are as by default, the digest is as it was before them.
LATER = {
    *ROUTE_SETTINGS, "field_deg", "mask", "parallel_views", "put_back_ahead_m", "goal_walk_m", "goal_turns", "goal_views",
    "goal_spread_deg", "goal_only",
    "collisions", "body_radius_m", "senses", "release_m", "release_deg", "displace_at", "displace_m",
    "gaze", "body_length_m", "pitch_noise_deg", "roll_noise_deg",
    "side", "overlap_deg", "eye", "test_change", "change_seed",
} - EARLY  # fmt: skip
OF_ENTRY = ("world", "seed", "encoding", "model", "offset_m", "heading_noise_deg", "navigator")  # settings that differ


@dataclass(frozen=True, kw_only=True)
class Benchmark:
    """A run for each combination of a world, a noise and a displacement.

    Attributes:
        name: Name that results refer to.
        worlds: The preset and seed of each; the seed is also that of the route, the model and the noise.
        noises_deg: On every turn (standard deviations, degrees).
        displacements: Of the start, to the left of the route (m; negative: right).
        base: What all runs share.
    """

    name: str
    worlds: tuple[tuple[str, int], ...]
    noises_deg: tuple[float, ...]
    displacements: tuple[float, ...]
    base: Experiment = BASE

    def __len__(self) -> int:
        return len(self.worlds) * len(self.noises_deg) * len(self.displacements)

    def sweep(self, model: str = "perfect-memory", encoding: str = ENCODING, navigator: str = NAVIGATOR) -> Sweep:
        """The runs of a model and a navigator."""
        axes = {
            "world": [{"world": world, "seed": seed} for world, seed in self.worlds],
            "heading_noise": [{"body__heading_noise": math.radians(noise)} for noise in self.noises_deg],
            "start_offset": self.displacements,
        }
        return Sweep.over(self.name, self.base.replace(model=model, encoding=encoding, navigator=navigator), axes)

    def by_world(self, encoding: str = ENCODING) -> Iterator[list[Experiment]]:
        """The runs, those of one world together. Their model is for the entry to bring."""
        for _, group in groupby(self.sweep(encoding=encoding).experiments, key=lambda run: (run.world, run.seed)):
            yield list(group)

    def asked(self) -> list[tuple[str, int, float, float]]:
        """World, seed, noise (degrees) and displacement (m) of every run, in their order."""
        return [
            (world, seed, noise, displacement)
            for (world, seed), noise, displacement in product(self.worlds, self.noises_deg, self.displacements)
        ]

    def chain(self, encoding: str = ENCODING) -> str:
        """An encoding with all its steps."""
        return str(self.base.replace(encoding=encoding).encoding)

    def digest(self) -> str:
        """Digest of all settings, and of the first world of each preset and its route, to a tenth of a millimetre."""
        settings, usual = settings_of(self.base), settings_of(Experiment())
        added = [name for name in LATER if settings[name] == usual[name]]
        shared = {name: value for name, value in settings.items() if name in TYPES and name not in (*OF_ENTRY, *added)}
        digest, generated = hashlib.sha256(json.dumps([shared, ENCODING], sort_keys=True).encode()), set()
        for runs in self.by_world():
            names = ("world", "seed", "heading_noise_deg", "offset_m")
            asked = [[settings[name] for name in names] for settings in map(settings_of, runs)]
            digest.update(json.dumps(asked).encode())
            if runs[0].world in generated:
                continue
            generated.add(runs[0].world)
            world, route = runs[0].open_world_and_route()
            for metres in (world.triangles, route.xy):
                digest.update(np.round(metres.astype(np.float64) * 1e4).astype(np.int64).tobytes())
            digest.update(world.rgb.tobytes())
        return digest.hexdigest()


def _worlds(count: int) -> tuple[tuple[str, int], ...]:
    """`count` worlds of each preset, from seeds that nothing else in the project uses."""
    presets = {"tussock-field": 1000, "meadow": 1100, "scrub": 1200}
    return tuple((preset, first + k) for preset, first in presets.items() for k in range(count))


BENCHMARK = Benchmark(name="tussock-2", worlds=_worlds(4), noises_deg=(0.0, 20.0, 40.0), displacements=(-0.3, 0.0, 0.3))
# A first look, in a minute. Its results compare with no others, as its name says.
QUICK = Benchmark(name="tussock-2-quick", worlds=_worlds(1), noises_deg=(0.0, 40.0), displacements=(-0.3, 0.3))
BENCHMARKS = {each.name: each for each in (BENCHMARK, QUICK)}
