"""Acts by key poses: what hands, head, trunk, hips and feet do at some times, laid over a recorded motion.

An act is read from a file (:mod:`motet.keyed.file`), drawn (:mod:`motet.keyed.draw`: each draw has other times, sizes
and counts) and laid over a base, such as a person who stands and breathes: first the hips with the feet where they
were, then trunk and head (:mod:`motet.keyed.trunk`), then the arms, whose hands are brought to places on the body
(:mod:`motet.keyed.hands`). What the parts of a key may say, and in which ranges, is in :mod:`motet.keyed.parts`.

``motet.keyed.read("acts.toml")`` gives acts by name, ``act.motion(base, seed=0)`` a motion, and ``motet.keyed.ours()``
the acts that ship (:mod:`motet.keyed.shipped`).
"""

from motet.keyed.acts import KeyedAct, laid_over
from motet.keyed.file import read
from motet.keyed.shipped import ours

__all__ = ["KeyedAct", "laid_over", "ours", "read"]
