"""Refuses the unknown name of a model, a navigator, a change or a world before a command loads what takes seconds."""

import re
from typing import Any

from tussock.world.change import check_names as check_change

from ..experiment_fields import MODEL_SUFFIX
from ..models.registry import MODELS, split_prefix
from ..steering.registry import NAVIGATORS
from .options import ModelOptions


def check_names(command: Any) -> None:
    """Refuse what names an unknown model, navigator, change or world, as the command itself would. Raises SettingError."""
    if not isinstance(command, ModelOptions) or command.use:  # classes that are used may bring names of their own
        return
    model, navigator = (_first_word(getattr(command, name, "")) for name in ("model", "navigator"))
    if model and not model.endswith(MODEL_SUFFIX):
        MODELS.check(split_prefix(model)[1])
    if navigator:
        NAVIGATORS.check(navigator)
    if getattr(command, "test_change", None):
        check_change(command.test_change)  # type: ignore[attr-defined]
    if command.world is not None:
        from tussock.world.files import check_world  # this takes half a second

        check_world(command.world)


def _first_word(spec: str) -> str:
    """The name that a spec begins with."""
    name = re.match(r"[^\s(,|=]+", spec)
    return name[0] if name else ""
