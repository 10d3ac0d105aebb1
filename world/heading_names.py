"""Names of the ways in which a reader may take the headings of a file; headings.py has what they mean. Light to import."""

CONVENTION_NAMES = (
    "ccw",
    "bearing",
    "radians",
    "radians-bearing",
    "clockwise",
    "ccw-from-north",
    "backwards",
    "bearing-backwards",
)
HEADINGS = ("auto", *CONVENTION_NAMES, "path", "as-is")
