"""Navigators: what decides, at each look, how an agent turns and steps. One file for each."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
