"""tussock: a simulator of insect visual route navigation."""

import lazy_loader

# The names and where they are stand in __init__.pyi; each is loaded when it is first used.
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
