"""The names of fields of settings in messages: those by which they were given, as flags of a command or keys of a sweep file."""

import itertools
from collections.abc import Collection

from tussock.world.errors import FieldError, InputError

from .settings_table import FIELDS

# Classes whose fields are given by flags and keys; the fields of models and navigators are given as parameters, by their own names.
CLASSES = {  # by the fields of `Experiment` that hold them
    "": ("Surroundings", "Experiment"),
    "reading": ("MeshReading",),
    "eye": ("Eye",),
    "posture": ("Posture",),
    "training": ("TrainingSetup",),
    "body": ("Body",),
    "displacement": ("Displacement",),
    "stopping": ("StoppingRules",),
}
OWNERS = {*itertools.chain(*CLASSES.values()), "Scan", "Camera", "Ring", "ImportSettings"}
UNITS = ("", "_m", "_deg", "_s", "_px")  # at the end of a name
NAMES = {  # of those that are not named after their field
    f"{owner}.{field}": name
    for name, (part, _, field) in ((name, place.rpartition(".")) for name, place in FIELDS.items())
    for owner in CLASSES[part]
} | {"Scan.width": "scan_deg", "Scan.about": "scan_about_deg", "ImportSettings.height": "eye_height_m"}
PARTS = {  # given together by one name
    "Eye.width": "size",
    "Eye.height": "size",
    "Camera.width": "size",
    "Camera.height": "size",
}


def message_of(error: InputError, given: Collection[str], mark: str = "") -> str:
    """The text of an error, in which an invalid field has the name by which it was given.

    Args:
        error: What was raised.
        given: Names that were given, such as "step_m".
        mark: What stands before a name, such as "--".
    """
    if not isinstance(error, FieldError) or error.owner not in OWNERS:
        return str(error)
    if not error.field:
        return error.problem
    place = f"{error.owner}.{error.field}"
    if (whole := PARTS.get(place)) in given:
        return f"{mark}{whole}: {error.field} {error.problem}"
    names = [NAMES[place]] if place in NAMES else [error.field + unit for unit in UNITS]
    name = next((each for each in names if each in given), None)
    if name is None:
        return str(error)
    problem = (name.endswith("_deg") and error.in_degrees) or error.problem
    return f"{mark}{name.replace('_', '-')} {problem.removesuffix(' or None')}"  # what is None is left out
