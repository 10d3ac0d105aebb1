"""
A picture of your own
=====================

A panoramic photo is a view like any other: (height, width, 3) in 0 to 255. Here a picture is turned by 90 degrees, and the visual compass
finds out by how much. For fisheye lenses and mirrors see ``tussock unwrap``.
"""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from PIL import Image

import tussock
from tussock import Encoding, VisualCompass, turn_of_columns

photo = np.asarray(Image.open(Path(tussock.__file__).with_name("assets") / "panorama.png").convert("RGB"))
turned = np.roll(photo, photo.shape[1] // 4, axis=1)  # as seen after a turn of 90 degrees to the left
encoding = Encoding.parse("grey | resize 6 | normalise")
compass = VisualCompass().fit(encoding(photo[None]))
familiarity = compass.scan(encoding(turned[None]))[0].numpy()

degrees = np.degrees(turn_of_columns(np.arange(len(familiarity)), len(familiarity)))
order = degrees.argsort()
plt.plot(degrees[order], familiarity[order])
plt.axvline(degrees[familiarity.argmax()], color="crimson", label=f"turn back by {degrees[familiarity.argmax()]:.0f}°")
plt.xlabel("turn to the left (degrees)")
plt.ylabel("familiarity")
plt.legend()
