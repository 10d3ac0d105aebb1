"""The protocols by name. A new one is a file in this folder and a line here."""

from tussock.world.registry import Registry

_HERE = "tussock.navigation.studies.protocols"

# The first line of a file's docstring is the sentence that the command line shows for its protocol.
PROTOCOLS = Registry(
    "protocols",
    "protocol",
    {
        "ardin2016": f"{_HERE}.ardin2016:ARDIN2016",
        "baddeley2012": f"{_HERE}.baddeley2012:BADDELEY2012",
        "azevedo2025": f"{_HERE}.azevedo2025:AZEVEDO2025",
        "lemoel2020": f"{_HERE}.lemoel2020:LEMOEL2020",
        "gattaux2025": f"{_HERE}.gattaux2025:GATTAUX2025",
        "kagioulis2024": f"{_HERE}.kagioulis2024:KAGIOULIS2024",
        "apiaviz2026": f"{_HERE}.apiaviz2026:APIAVIZ2026",
        "beenav2026": f"{_HERE}.beenav2026:BEENAV2026",
    },
)
