"""
An encoding of your own
=======================

What is kept of a view decides what a model can recognise. An encoding is a chain of steps, written as text; this picture shows the
same view in four of them.
"""

import matplotlib.pyplot as plt

from tussock import Encoding, World, generate_route, open_renderer

chains = [
    "grey | resize 3",
    "grey | clahe 2 8 | resize 3 | normalise",
    "foreground-mask | resize 3",
    "foreground-mask | vertical-edges | resize 3 | normalise",
]
world = World.generate("tussock-field", seed=7)
with open_renderer(world) as renderer:
    view = renderer.render([generate_route(world, seed=7).start])

figure, rows = plt.subplots(len(chains), figsize=(8, 7), layout="constrained")
for axes, chain in zip(rows, chains, strict=True):
    axes.imshow(Encoding.parse(chain)(view)[0], cmap="gray")
    axes.set(title=chain, xticks=[], yticks=[])
