"""Panoramas of a world at any pose, by a CPU renderer or by OpenGL (EGL or OSMesa)."""

import lazy_loader

# The names are listed in __init__.pyi; each is loaded when it is first used.
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
