"""A robot's loop at 100 Hz: it slows down where a person will soon be near, and stops before they touch.

python examples/robot_loop.py MOTION, which plays the part of the camera.
"""

import sys
import time

import numpy as np

import motet
from motet.motion import positions, to_humanoid

RATE, AHEAD = 100.0, 0.5  # Hz; seconds that the robot looks ahead
STOP, SLOW = 0.5, 2.0  # metres between the person and the robot's hand
HAND = np.array([0.0, 1.0, 2.5])  # of the robot, in the world

if len(sys.argv) != 2:
    sys.exit(__doc__)
camera = to_humanoid(motet.read(sys.argv[1])).motion.resample(RATE)
session = motet.load("predict").stream(camera[:0])
speeds, busy = [], []
start = time.perf_counter()
for tick, frame in enumerate(camera.values):
    began = time.perf_counter()
    session.push(frame)
    if tick >= 0.4 * RATE:  # the model looks at a third of a second
        coming = positions(session.predict(seconds=AHEAD))
        nearest = np.linalg.norm(coming - HAND, axis=-1).min()
        speeds.append(np.clip((nearest - STOP) / (SLOW - STOP), 0.0, 1.0))
        busy.append(time.perf_counter() - began)
    time.sleep(max(0.0, start + (tick + 1) / RATE - time.perf_counter()))
late = np.mean(np.array(busy) > 1 / RATE)
print(
    f"speed from {min(speeds):.0%} to {max(speeds):.0%}; a tick takes {np.median(busy) * 1e3:.1f} ms, {late:.0%} late"
)
