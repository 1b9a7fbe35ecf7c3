"""A game's loop: a figure is steered by the player at the model's 30 ticks a second and drawn at 60 pictures.

A second figure watches the player and comes along.

python examples/game_loop.py SECONDS
"""

import sys
import time

import motet

PICTURES = 60.0  # a second

if len(sys.argv) != 2:
    sys.exit(__doc__)
model = motet.load("control")
player, friend = model.start("walk"), model.start("walk", places=[-2.0, 0.0, 90.0])
before = after = player.tick()
ticks, start = 1, time.perf_counter()
for picture in range(round(float(sys.argv[1]) * PICTURES)):
    now = picture / PICTURES
    player.control(velocity=(0.0, 1.2) if now < 1 else (1.2, 0.0))  # the player's stick: ahead, then left
    while ticks / model.fps <= now:
        before, after, ticks = after, player.tick(), ticks + 1
        x, _, z = after.place[0]
        friend.look_at((x, 1.6, z))
        if ticks % 15 == 0:
            friend.go_to((x - 1.0, z))
        watching = friend.tick()
    shown = before.towards(after, now * model.fps - (ticks - 1))
    # an engine sets its bones here: shown.rotations, under shown.place, shown.heading and shown.height
    time.sleep(max(0.0, start + now - time.perf_counter()))
x, _, z = shown.place[0]
away = float(abs(watching.place[0] - shown.place[0]).max())
print(f"{ticks} ticks; the figure stands at x {x:.2f} m, z {z:.2f} m, the friend {away:.1f} m away")
