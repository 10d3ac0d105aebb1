"""Learn a route from the frames of a panoramic camera, and steer by the frames of another drive.

python 04_camera.py LEARN STEER     two videos; a number instead of a name is a camera of this machine
"""

import sys
import time

import cv2
import numpy as np

from tussock import Encoding, Look, PerfectMemory, Scan
from tussock.render.images.lenses import Ring
from tussock.render.images.unwrapping import Unwrapping


def frames(source):
    """The frames of a video or a camera, RGB."""
    capture = cv2.VideoCapture(int(source) if source.isdigit() else source)
    while (frame := capture.read())[0]:
        yield cv2.cvtColor(frame[1], cv2.COLOR_BGR2RGB)


lens = Ring(centre=(127.5, 127.5), inner=40, outer=120)  # pixels; tussock unwrap finds them in a picture of your camera
unwrap = Unwrapping(lens, width=180, height=45, top=lens.top, bottom=lens.bottom)
encoding = Encoding.parse("grey | vertical-edges | resize 2 | normalise")
learn, steer = sys.argv[1:]

navigator = Scan(model=PerfectMemory())
navigator.learn(encoding(np.stack([unwrap(frame) for frame in frames(learn)])))
memory = [navigator.begin()]
for number, frame in enumerate(frames(steer)):
    began = time.perf_counter()
    views = encoding(unwrap(frame)[None])
    motion = navigator.decide(Look(views=views, compass=np.zeros(1)), memory)
    milliseconds = 1e3 * (time.perf_counter() - began)
    print(f"frame {number}: turn {np.degrees(motion.turn[0]):+6.1f} degrees ({milliseconds:.1f} ms)")
    # Here a robot turns by motion.turn[0] (rad, left positive), then drives a step.
