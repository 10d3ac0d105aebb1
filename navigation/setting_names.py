"""The names of fields of settings in messages: those by which they were given, as flags of a command or keys of a sweep file."""

from collections.abc import Collection

from tussock.world.errors import FieldError, InputError

# Classes whose fields are given by flags and keys; the fields of models and navigators are given as parameters, by their own names.
OWNERS = (
    "Surroundings", "Experiment", "MeshReading", "Eye", "TrainingSetup", "Body", "StoppingRules", "Scan", "Camera", "Ring",
    "ImportSettings",
)  # fmt: skip
UNITS = ("", "_m", "_deg", "_s", "_px")  # at the end of a name
RENAMED = {
    "Eye.z": "eye_height_m",
    "Body.step_length": "step_m",
    "Experiment.start_offset": "offset_m",
    "StoppingRules.arrival_radius": "arrive_m",
    "StoppingRules.max_deviation": "lost_m",
    "StoppingRules.waypoint_spacing": "waypoint_m",
    "Scan.width": "scan_deg",
    "Scan.about": "scan_about_deg",
    "ImportSettings.height": "eye_height_m",
}
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
    names = [RENAMED[place]] if place in RENAMED else [error.field + unit for unit in UNITS]
    name = next((each for each in names if each in given), None)
    if name is None:
        return str(error)
    problem = (name.endswith("_deg") and error.in_degrees) or error.problem
    return f"{mark}{name.replace('_', '-')} {problem.removesuffix(' or None')}"  # what is None is left out
