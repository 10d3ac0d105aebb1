"""Navigators: what decides, at each look, how an agent turns and steps. One file for each."""

from tussock.world.registry import Registry

__all__ = ["NAVIGATORS"]

NAVIGATORS = Registry("navigators", "navigator", {"scan": "tussock.navigation.steering.scan:Scan"})
