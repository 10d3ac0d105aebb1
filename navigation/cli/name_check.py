"""Refuses the unknown name of a model, a navigator or a world before a command loads what takes seconds."""

import re
from collections.abc import Mapping
from typing import Any

from ..experiment_fields import MODEL_SUFFIX
from ..models.registry import MODELS, OPPONENT
from ..steering.registry import NAVIGATORS


def check_names(flags: Mapping[str, Any]) -> None:
    """Refuse flags that name what is not known, as the command itself would. Raises SettingError."""
    model, navigator = (_first_word(flags.get(name)) for name in ("model", "navigator"))
    if model and not model.endswith(MODEL_SUFFIX):
        MODELS.check(model.removeprefix(OPPONENT))
    if navigator:
        NAVIGATORS.check(navigator)
    if isinstance(flags.get("world"), str):
        from tussock.world.files import check_world  # this takes half a second

        check_world(flags["world"])


def _first_word(text: Any) -> str:
    """The name that a spec begins with; nothing where it is no text."""
    found = re.match(r"[^\s(,|=]+", text) if isinstance(text, str) else None
    return found[0] if found else ""
