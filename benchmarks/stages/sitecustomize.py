"""Adds up the CPU time of each stage of a job, in every process whose PYTHONPATH begins with this folder, workers included.

Nothing of it is in the library: the functions below are wrapped as their modules are imported. Each process writes its sums to
a file in the folder that TUSSOCK_STAGES names, as it goes, so that a process that is ended loses none.
"""

import functools
import inspect
import mmap
import os
import sys
import threading
import time
from importlib.abc import MetaPathFinder
from importlib.machinery import PathFinder

FOLDER = "TUSSOCK_STAGES"  # the environment's name for the folder
STAGES = ("generate", "route", "train", "walk", "diagnose", "write")
# Functions by module, with the stage of each. What one calls belongs to the stage of the innermost.
FUNCTIONS = {
    "tussock.navigation.surroundings": {"Surroundings.open_world": "generate", "Surroundings.open_route": "route"},
    "tussock.navigation.training": {"training_views": "train"},
    "tussock.navigation.models.base": {"Model.fit": "train"},
    "tussock.navigation.experiment": {"Experiment.train": "train"},
    "tussock.navigation.studies.thesis.study_data": {"data_of_world": "train"},
    "tussock.navigation.walk": {"Walk.steps": "walk"},
    "tussock.navigation.failures": {"Diagnostics.examine": "diagnose"},
    "tussock.navigation.recording.log": dict.fromkeys(
        ("Recording.__init__", "Recording.log", "Recording.close", "Recording._flush"), "write"
    ),
    "tussock.navigation.reports.maps": {"write_overview": "write"},
    "tussock.navigation.reports.report": {"write_report": "write"},
    "tussock.navigation.sweeps.store": {"Store.add": "write", "write_table": "write"},
    "tussock.navigation.trajectory": {"Trajectory.to_csv": "write", "Trajectory.write": "write"},
}


class Clock:
    """Shares the CPU time of a process among the stages that its threads are in; what passes outside of all is counted nowhere."""

    def __init__(self, folder: str):
        self.folder = folder
        self.begin()

    def begin(self) -> None:
        """Begin anew: at the start of a process."""
        self.lock, self.own = threading.Lock(), threading.local()
        self.inside = [0] * len(STAGES)  # threads whose innermost stage it is
        with open(os.path.join(self.folder, f"{os.getpid()}-{time.time_ns()}"), "w+b") as file:
            file.truncate(8 * len(STAGES))
            self.seconds = memoryview(mmap.mmap(file.fileno(), 0)).cast("d")
        self.last = time.process_time()

    def enter(self, stage: int) -> None:
        stack = self.own.__dict__.setdefault("stack", [])
        with self.lock:
            self._share()
            if stack:
                self.inside[stack[-1]] -= 1
            self.inside[stage] += 1
        stack.append(stage)

    def leave(self) -> None:
        stack = self.own.__dict__.get("stack", [])
        if not stack:  # a process that was forked inside of a stage
            return
        with self.lock:
            self._share()
            self.inside[stack.pop()] -= 1
            if stack:
                self.inside[stack[-1]] += 1

    def _share(self) -> None:
        now = time.process_time()
        if threads := sum(self.inside):
            each = (now - self.last) / threads
            for stage, count in enumerate(self.inside):
                self.seconds[stage] += count * each
        self.last = now


def timed(function, stage: int, clock: Clock):
    """A function that tells the clock that it is in a stage; of a generator, while it computes."""

    @functools.wraps(function)
    def call(*arguments, **named):
        clock.enter(stage)
        try:
            return function(*arguments, **named)
        finally:
            clock.leave()

    if not inspect.isgeneratorfunction(function):
        return call

    @functools.wraps(function)
    def steps(*arguments, **named):
        generator = function(*arguments, **named)
        proceed = timed(generator.__next__, stage, clock)
        while True:
            try:
                item = proceed()
            except StopIteration:
                return
            yield item

    return steps


def wrap(module, names: dict[str, str], clock: Clock) -> None:
    """Wrap functions of a module. Raises AttributeError for one that is gone: then FUNCTIONS is to be changed."""
    for path, stage in names.items():
        *owners, name = path.split(".")
        owner = functools.reduce(getattr, owners, module)
        setattr(owner, name, timed(vars(owner)[name] if owners else getattr(owner, name), STAGES.index(stage), clock))


class Finder(MetaPathFinder):
    """Finds the modules of FUNCTIONS as Python does, and wraps their functions once they are there."""

    def __init__(self, clock: Clock):
        self.clock = clock

    def find_spec(self, name, path, target=None):
        if name not in FUNCTIONS:
            return None
        spec = PathFinder.find_spec(name, path, target)
        if spec is not None and spec.loader is not None:
            execute = spec.loader.exec_module

            def exec_module(module):
                execute(module)
                wrap(module, FUNCTIONS[name], self.clock)

            spec.loader.exec_module = exec_module
        return spec


if FOLDER in os.environ:
    clock = Clock(os.environ[FOLDER])
    os.register_at_fork(after_in_child=clock.begin)
    sys.meta_path.insert(0, Finder(clock))
