"""tussock: a simulator of insect visual route navigation."""

import os

import lazy_loader

# Threads of torch that wait for one another keep a core busy; where other programs need it, a fit took 40 times as long. It has an effect
# where torch is loaded after this. docs/performance.md has the measurement.
os.environ.setdefault("OMP_WAIT_POLICY", "passive")

# The names and where they are stand in __init__.pyi; each is loaded when it is first used.
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
