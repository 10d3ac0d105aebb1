"""The registry of navigators."""

from tussock.world.registry import Registry

_HERE = "tussock.navigation.steering"

NAVIGATORS = Registry(
    "navigators",
    "navigator",
    {
        "scan": f"{_HERE}.scan:Scan",
        "stepped-scan": f"{_HERE}.stepped_scan:SteppedScan",
        "lateral": f"{_HERE}.lateral:Lateral",
        "opponent": f"{_HERE}.opponent:Opponent",
        "oscillator": f"{_HERE}.oscillator:Oscillator",
    },
)
