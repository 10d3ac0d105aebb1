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
        "blend": f"{_HERE}.blend:Blend",
        "loop-breaker": f"{_HERE}.loop_breaker:LoopBreaker",
        "familiarity-modulated": f"{_HERE}.familiarity_modulated:FamiliarityModulated",
        "cast-and-surge": f"{_HERE}.cast_and_surge:CastAndSurge",
    },
)
