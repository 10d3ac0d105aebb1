"""What things cost on this machine: one table, each figure beside the naive way of doing the same in the same run.

Run it with nothing else running: `make bench`. It takes about a minute.
"""

import platform
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import torch
from rich.console import Console
from rich.table import Table

from navigation import Agent, Encoding, PerfectMemory, Recording, learn, training_poses
from render import Eye, open_renderer
from world import InputError, World
from world.walk import generate_route


def milliseconds(work: Callable[[], object], repeats: int = 5) -> float:
    """Median time of `work` after one call to warm up."""
    work()
    times = []
    for _ in range(repeats):
        began = time.perf_counter()
        work()
        times.append(time.perf_counter() - began)
    return 1000 * float(np.median(times))


def rendering(table: Table, world: World, backend: str) -> None:
    """ms a view of one backend, in batches and one by one."""
    rng = np.random.default_rng(0)
    poses = np.column_stack([rng.uniform(1, 9, (32, 2)), rng.uniform(-3, 3, 32)])
    for width, height in ((720, 150), (120, 25)):
        try:
            with open_renderer(world, Eye(width=width, height=height), backend) as renderer:
                batch = milliseconds(lambda r=renderer: r.render(poses), 3) / len(poses)
                single = milliseconds(lambda r=renderer: [r.render(poses[i : i + 1]) for i in range(8)], 3) / 8
        except InputError as error:
            table.add_row(f"view {width} x {height}, {backend}", "not here", "", str(error))
            continue
        triangles = f"{len(world.triangles):,} triangles"
        table.add_row(f"view {width} x {height}, {backend}, in batches", f"{batch:.2f} ms", "", triangles)
        table.add_row(f"view {width} x {height}, {backend}, one by one", f"{single:.2f} ms", "", triangles)


def matching(table: Table) -> None:
    """ms a view for all rotations against 1,000 snapshots, and a numpy loop that rolls the view."""
    for width, height in ((90, 25), (180, 50)):
        random = torch.Generator().manual_seed(0)
        snapshots = torch.rand(1000, height, width, generator=random)
        views = torch.rand(32, height, width, generator=random)
        memory = PerfectMemory().fit(snapshots)
        one, many = (
            milliseconds(lambda m=memory, v=views: m.scan(v[:1])),
            milliseconds(lambda m=memory, v=views: m.scan(v)) / 32,
        )

        slow = milliseconds(lambda v=views, s=snapshots: naive_scan(v[0].numpy(), s.numpy()), 1)
        name = f"all rotations of a {width} x {height} view, 1,000 snapshots"
        table.add_row(name, f"{one:.2f} ms", f"{slow:.0f} ms", f"{slow / one:.0f} times")
        table.add_row(name + ", in batches of 32", f"{many:.2f} ms", f"{slow:.0f} ms", f"{slow / many:.0f} times")


def naive_scan(view: np.ndarray, snapshots: np.ndarray) -> np.ndarray:
    """The same with a loop that rolls the view."""
    rolled = (np.roll(view, k, axis=1) for k in range(view.shape[1]))
    return np.array([((turned - snapshots) ** 2).mean(axis=(1, 2)).min() for turned in rolled])


def walking(table: Table, world: World) -> None:
    """Steps a second of the whole loop, with and without recording."""
    route = generate_route(world, 1)
    for width, height, resize, reach in ((720, 150, 6, 0.2), (120, 25, 1, 0.0)):
        encoding = Encoding.named("edges", resize=resize)
        with (
            open_renderer(world, Eye(width=width, height=height), "cpu") as renderer,
            tempfile.TemporaryDirectory() as folder,
        ):
            memory = PerfectMemory()
            poses = learn(memory, encoding, renderer, training_poses(route.resampled(0.04), learning_walk=reach))
            agent = Agent(
                renderer=renderer, encoding=encoding, model=memory, route=route, max_steps=100, lost=9.0, patience=99.0
            )

            def walk(a=agent) -> None:
                for _ in a.walk(a.start()):
                    pass

            def recorded(a=agent, p=poses, folder=folder) -> None:
                path = Path(folder) / "recording.rrd"
                with Recording(path, world, route, renderer=a.renderer, training_poses=p) as recording:
                    for step in a.walk(a.start()):
                        recording.log(step)

            name = f"steps a second at {width} x {height}, {len(poses)} snapshots"
            table.add_row(name, f"{100_000 / milliseconds(walk, 3):.0f}", "", "")
            table.add_row(name + ", recorded", f"{100_000 / milliseconds(recorded, 3):.0f}", "", "")


def main() -> None:
    """Measure and print."""
    table = Table("what", "figure", "naive", "", title=f"{platform.machine()}, {torch.get_num_threads()} threads")
    world = World.generate("tussock-field", 1)
    for backend in ("cpu", "egl"):  # a process has one GL
        rendering(table, world, backend)
    matching(table)
    walking(table, world)
    Console(width=140).print(table)


if __name__ == "__main__":
    main()
