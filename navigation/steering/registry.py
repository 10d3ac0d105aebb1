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
        "homing": f"{_HERE}.homing:Homing",
        "average-landmark-vector": f"{_HERE}.average_landmark_vector:AverageLandmarkVector",
        "image-gradient": f"{_HERE}.image_gradient:ImageGradient",
        "home-vector": f"{_HERE}.home_vector:HomeVector",
        "opponent": f"{_HERE}.opponent:Opponent",
        "oscillator": f"{_HERE}.oscillator:Oscillator",
        "path-integration": f"{_HERE}.path_integration:PathIntegration",
        "central-complex": f"{_HERE}.central_complex:CentralComplexSteering",
        "blend": f"{_HERE}.blend:Blend",
        "loop-breaker": f"{_HERE}.loop_breaker:LoopBreaker",
        "familiarity-modulated": f"{_HERE}.familiarity_modulated:FamiliarityModulated",
        "cast-and-surge": f"{_HERE}.cast_and_surge:CastAndSurge",
    },
)
