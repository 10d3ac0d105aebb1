"""What a sweep asks for: experiments, and the axes along which they differ."""

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from ..experiment import Experiment

Change = Mapping[str, Any]  # fields of an experiment that go together, as `Experiment.replace` takes them


@dataclass(frozen=True)
class Sweep:
    """A run for each combination of one choice of every axis.

    Attributes:
        title: In the user's words.
        axes: The choices of each axis, by its name.
        experiments: All combinations, the last axis changing fastest.
    """

    title: str
    axes: Mapping[str, Sequence[Any]]
    experiments: Sequence[Experiment]

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
        experiments = [
            base.replace(**{name: value for change in changes for name, value in change.items()})
            for changes in itertools.product(*choices)
        ]
        return cls(title, axes, experiments)

    def __str__(self) -> str:
        return ", ".join(f"{len(choices)} of {name}" for name, choices in self.axes.items())
