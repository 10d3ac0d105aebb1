"""The names of the renderers. The command line reads them without loading any."""

BACKENDS = ("auto", "cpu", "cuda", "egl", "osmesa")
