"""What a sweep asks for: experiments, and the axes along which they differ."""

import copy
import itertools
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from tussock.world.errors import SettingError

from ..experiment import Experiment
from ..experiment_keys import WALK_FIELDS

Change = Mapping[str, Any]  # fields of an experiment that go together, as `Experiment.replace` takes them


@dataclass(frozen=True)
class Sweep:
    """A run for each combination of one choice of every axis.

    Attributes:
        title: In the user's words.
        axes: The choices of each axis, by its name.
        experiments: All combinations, the last axis changing fastest.
        columns: Columns of the steps that are kept of each walk (COLUMNS of trajectory.py). None: all, and the navigator's signals.
            What is wrong with poor steps is only looked for where the column "cause" is kept, as that takes a third of the time.
    """

    title: str
    axes: Mapping[str, Sequence[Any]]
    experiments: Sequence[Experiment]
    columns: Sequence[str] | None = None

    def __len__(self) -> int:
        return len(self.experiments)

    @classmethod
    def over(cls, title: str, base: Experiment, axes: Mapping[str, Sequence[Any]]) -> "Sweep":
        """All combinations of changes of an experiment.

        Args:
            title: In the user's words.
            base: What all runs share.
            axes: The choices of each axis: values of the field that the axis is named after, or a `Change` of several fields.

        Raises:
            InputError: For a combination that makes no sense.
        """
        choices = [
            [choice if isinstance(choice, Mapping) else {name: choice} for choice in of_axis]
            for name, of_axis in axes.items()
        ]
        if not all(choices):
            raise SettingError(
                f"the axis {next(name for name in axes if not axes[name])} has no choice; give at least one"
            )

        def make(changes: Sequence[Change]) -> Experiment:
            return base.replace(**{name: value for change in changes for name, value in change.items()})

        return cls(title, axes, list(combinations(choices, make, lambda name: name.partition("__")[0] in WALK_FIELDS)))

    def __str__(self) -> str:
        return ", ".join(f"{len(choices)} of {name}" for name, choices in self.axes.items())


def combinations(
    axes: Sequence[Sequence[Change]], make: Callable[[Sequence[Change]], Experiment], of_walk: Callable[[str], bool]
) -> Iterator[Experiment]:
    """The experiment of each combination of one choice of every axis, the last axis changing fastest.

    Args:
        axes: The choices of each axis.
        make: Makes and checks an experiment. It is not called where its parts are known already: that which decides the walk alone, and
            the rest. Neither depends on the other, and a sweep has far fewer parts than combinations.
        of_walk: Whether the name of what a choice changes is of the walk alone.
    """
    names = [{name for choice in axis for name in choice} for axis in axes]
    in_rest = [k for k, each in enumerate(names) if not all(map(of_walk, each))]
    in_walk = [k for k, each in enumerate(names) if any(map(of_walk, each))]
    rests: dict[tuple[int, ...], Experiment] = {}
    walks: dict[tuple[int, ...], Experiment] = {}
    for numbers in itertools.product(*(range(len(axis)) for axis in axes)):
        rest, walk = tuple(numbers[k] for k in in_rest), tuple(numbers[k] for k in in_walk)
        if rest not in rests or walk not in walks:
            made = make([axis[k] for axis, k in zip(axes, numbers, strict=True)])
            rests.setdefault(rest, made)
            walks.setdefault(walk, made)
        yield _with_walk(rests[rest], walks[walk])


def _with_walk(experiment: Experiment, other: Experiment) -> Experiment:
    """An experiment with the walk of another one; both are checked already."""
    made = copy.copy(experiment)
    vars(made).update({name: getattr(other, name) for name in WALK_FIELDS})
    return made
