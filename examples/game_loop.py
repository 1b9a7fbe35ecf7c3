"""A game's loop: a figure is steered by the player at the model's 30 ticks a second and drawn at 60 pictures.

python examples/game_loop.py SECONDS
"""

import sys
import time

import motet

PICTURES = 60.0  # a second

model = motet.load("control")
figure = model.start("walk")
before = after = figure.tick()
ticks, start = 1, time.perf_counter()
for picture in range(round(float(sys.argv[1]) * PICTURES)):
    now = picture / PICTURES
    figure.control(velocity=(0.0, 1.2) if now < 1 else (1.2, 0.0))  # the player's stick: ahead, then left
    while ticks / model.fps <= now:
        before, after, ticks = after, figure.tick(), ticks + 1
    shown = before.towards(after, now * model.fps - (ticks - 1))
    # an engine sets its bones here: shown.rotations, under shown.place, shown.heading and shown.height
    time.sleep(max(0.0, start + now - time.perf_counter()))
x, _, z = shown.place[0]
print(f"{ticks} ticks; the figure stands at x {x:.2f} m, z {z:.2f} m")
