"""What is there: worlds of coloured triangles, generated or from files, and routes through them."""

import lazy_loader

# The public names are in __init__.pyi, each with its module. A module is loaded when one of its names is first used.
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
