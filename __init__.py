"""tussock: a simulator of insect visual route navigation."""

import os

import lazy_loader

# Threads of torch that wait for one another keep a core busy; where another program needs it, a fit takes 40 times as long. Read once, by
# torch when it is loaded.
os.environ.setdefault("OMP_WAIT_POLICY", "passive")

# The names and where they are stand in __init__.pyi; each is loaded when it is first used.
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
