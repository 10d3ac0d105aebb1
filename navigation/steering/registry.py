"""The registry of navigators."""

from tussock.world.registry import Registry

NAVIGATORS = Registry("navigators", "navigator", {"scan": "tussock.navigation.steering.scan:Scan"})
