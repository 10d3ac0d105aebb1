"""What the test bed asks of every entry: fixed, and known by its name. Whatever changes in it gets a new name."""

import hashlib
import json
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import groupby
from typing import Any, NamedTuple

import numpy as np

from tussock.render.eye import Eye, compound_eye
from tussock.render.posture import Posture
from tussock.world.errors import SettingError
from tussock.world.registry import suggestion

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


class Asked(NamedTuple):
    """What distinguishes the runs of an entry: condition (empty for none), world, seed, noise (degrees), and displacement (m)."""

    condition: str
    world: str
    seed: int
    heading_noise_deg: float
    offset_m: float


ENCODING = "edges"  # of entries that choose none
EARLY = {"world", "world_seed", "cull_back_faces", "route", "route_seed", "route_length_m"}  # as old as the benchmarks
# Settings newer than the benchmarks: where they are as by default, the digest is as it was before them.
LATER = {
    *ROUTE_SETTINGS, "field_deg", "mask", "parallel_views", "put_back_ahead_m", "goal_walk_m", "goal_turns", "goal_views",
    "goal_spread_deg", "goal_only",
    "collisions", "body_radius_m", "senses", "release_m", "release_deg", "displace_at", "displace_m",
    "gaze", "body_length_m", "pitch_noise_deg", "roll_noise_deg",
    "side", "overlap_deg", "eye", "spectrum", "test_change", "change_seed",
} - EARLY  # fmt: skip
OF_ENTRY = ("world", "seed", "encoding", "model", "offset_m", "heading_noise_deg", "navigator")  # settings that differ


@dataclass(frozen=True, kw_only=True)
class Condition:
    """What else is asked of an entry, in each world and from each displacement.

    Attributes:
        name: In results and tables.
        changes: What differs from the runs without a condition, as `Experiment.replace` takes it.
        world: Parameters that the presets of the worlds are given.
        noise_deg: On every turn (standard deviation, degrees).
    """

    name: str
    changes: Mapping[str, Any] = field(default_factory=dict)
    world: str = ""
    noise_deg: float = 20.0


@dataclass(frozen=True, kw_only=True)
class Benchmark:
    """A run for each combination of a world, a noise and a displacement; then, for each condition, of a world and a displacement.

    Attributes:
        name: Name that results refer to.
        worlds: The preset and seed of each; the seed is also that of the route, the model and the noise.
        noises_deg: On every turn (standard deviations, degrees).
        displacements: Of the start, to the left of the route (m; negative: right).
        base: What all runs share.
        conditions: What else is asked, in its order.
    """

    name: str
    worlds: tuple[tuple[str, int], ...]
    noises_deg: tuple[float, ...]
    displacements: tuple[float, ...]
    base: Experiment = BASE
    conditions: tuple[Condition, ...] = ()

    def __len__(self) -> int:
        return len(self.asked())

    def sweep(self, model: str = "perfect-memory", encoding: str = ENCODING, navigator: str = NAVIGATOR) -> Sweep:
        """The runs of a model and a navigator."""
        entry = {"model": model, "encoding": encoding, "navigator": navigator}
        usual = Sweep.over(self.name, self.base.replace(**entry), self._axes("", self.noises_deg))
        others = [
            Sweep.over(self.name, self.base.replace(**entry, **each.changes), self._axes(each.world, [each.noise_deg]))
            for each in self.conditions
        ]
        return Sweep(self.name, usual.axes, [run for sweep in (usual, *others) for run in sweep.experiments])

    def _axes(self, parameters: str, noises_deg: Sequence[float]) -> dict[str, Sequence[Any]]:
        return {
            "world": [{"world": f"{world} {parameters}".strip(), "seed": seed} for world, seed in self.worlds],
            "heading_noise": [{"body__heading_noise": math.radians(noise)} for noise in noises_deg],
            "start_offset": self.displacements,
        }

    def by_world(self, encoding: str = ENCODING) -> Iterator[list[Experiment]]:
        """The runs, those of one world and one condition together. Their model is for the entry to bring."""
        runs = zip(self.asked(), self.sweep(encoding=encoding).experiments, strict=True)
        for _, group in groupby(runs, key=lambda run: (run[0].condition, run[0].world, run[0].seed)):
            yield [run for _, run in group]

    def asked(self) -> list[Asked]:
        """What every run asks, in their order."""
        parts = [("", "", self.noises_deg), *((each.name, each.world, (each.noise_deg,)) for each in self.conditions)]
        return [
            Asked(condition, f"{world} {parameters}".strip(), seed, noise, displacement)
            for condition, parameters, noises in parts
            for world, seed in self.worlds
            for noise in noises
            for displacement in self.displacements
        ]

    def chain(self, encoding: str = ENCODING) -> str:
        """An encoding with all its steps."""
        return str(self.base.replace(encoding=encoding).encoding)

    def digest(self) -> str:
        """Digest of all settings, and of the first world of each preset and its route, to a tenth of a millimetre."""
        base, usual = settings_of(self.base), settings_of(Experiment())
        added = [name for name in LATER if base[name] == usual[name]]
        shared = {name: value for name, value in base.items() if name in TYPES and name not in (*OF_ENTRY, *added)}
        digest, generated = hashlib.sha256(json.dumps([shared, ENCODING], sort_keys=True).encode()), set()
        for runs in self.by_world():
            names = ("world", "seed", "heading_noise_deg", "offset_m")
            asked = [[settings[name] for name in names] for settings in map(settings_of, runs)]
            digest.update(json.dumps(asked).encode())
            settings = settings_of(runs[0])
            special = {name: settings[name] for name in TYPES if name not in OF_ENTRY and settings[name] != base[name]}
            digest.update(json.dumps(special, sort_keys=True).encode() if special else b"")
            if runs[0].world in generated:
                continue
            generated.add(runs[0].world)
            world, route = runs[0].open_world_and_route()
            for metres in (world.triangles, route.xy):
                digest.update(np.round(metres.astype(np.float64) * 1e4).astype(np.int64).tobytes())
            digest.update(world.rgb.tobytes())
        self._digest_changes(digest)
        return digest.hexdigest()

    def _digest_changes(self, digest: Any) -> None:
        """Add the first world of each condition after its change."""
        for _, runs in groupby(
            zip(self.asked(), self.sweep().experiments, strict=True), key=lambda run: run[0].condition
        ):
            _, first = next(runs)
            if first.test_change is None:
                continue
            world, route = first.replace(light=None).open_world_and_route()
            changed = first.test_change.apply(world, first.seed, route)
            digest.update(np.round(changed.triangles.astype(np.float64) * 1e4).astype(np.int64).tobytes())
            if first.light is not None:
                digest.update(repr(first.test_change.lit(first.light.make())).encode())


def _worlds(count: int) -> tuple[tuple[str, int], ...]:
    """`count` worlds of each preset, from seeds that nothing else in the project uses."""
    presets = {"tussock-field": 1000, "meadow": 1100, "scrub": 1200}
    return tuple((preset, first + k) for preset, first in presets.items() for k in range(count))


BENCHMARK = Benchmark(name="tussock-2", worlds=_worlds(4), noises_deg=(0.0, 20.0, 40.0), displacements=(-0.3, 0.0, 0.3))
# A first look, in a minute. Its results compare with no others, as its name says.
QUICK = Benchmark(name="tussock-2-quick", worlds=_worlds(1), noises_deg=(0.0, 40.0), displacements=(-0.3, 0.3))

CONDITIONS = (
    Condition(name="sun + 4 h", changes={"test_change": "sun amount=1 hours=4"}),
    Condition(name="overcast", changes={"test_change": "clouds amount=1"}),
    Condition(name="20 % of plants gone", changes={"test_change": "removed amount=0.2"}),
    Condition(name="wind", changes={"test_change": "wind amount=0.5 direction_deg=90"}),
    Condition(
        name="head tilted",
        changes={"test_change": "eye-turned amount=0.5 axis=pitch | eye-turned amount=0.5 axis=roll"},
    ),
    Condition(name="hills", changes={"posture": Posture(gaze="body")}, world="hill_height=0.6 mound_density=0.1"),
    Condition(name="296 degrees", changes={"eye__field": math.radians(296.0)}),
    Condition(name="ant's eye", changes={"eye": compound_eye("ant", z=0.01)}),
)
MORNING = "sun azimuth_deg=-20 elevation_deg=35"
TUSSOCK_3 = Benchmark(
    name="tussock-3",
    worlds=_worlds(2),
    noises_deg=BENCHMARK.noises_deg,
    displacements=BENCHMARK.displacements,
    base=BASE.replace(light=MORNING),
    conditions=CONDITIONS,
)
QUICK_3 = replace(TUSSOCK_3, name="tussock-3-quick", worlds=_worlds(1), noises_deg=(20.0,), displacements=(0.3,))
BENCHMARKS = {each.name: each for each in (BENCHMARK, QUICK, TUSSOCK_3, QUICK_3)}


def benchmark_of(name: str, *, quick: bool = False) -> Benchmark:
    """The test bed of a name, or its first look. Raises SettingError."""
    if name not in BENCHMARKS:
        raise SettingError(
            f"there is no test bed {name!r}{suggestion(name, BENCHMARKS)}; give {BENCHMARK.name} or {TUSSOCK_3.name}"
        )
    return BENCHMARKS[f"{name}-quick" if quick and not name.endswith("-quick") else name]
