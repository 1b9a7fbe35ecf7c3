"""Prompts, places, facings and poses on a time line become one motion.

    plan (plans.py) -> moments in order of time -> parts: generated passages and steered walks between places
    (steered_segments.py) -> joined -> moved through the given places and poses (keys.py) -> Composition (compose.py)

Main names: compose and Composition (compose.py), Moment (plans.py), Walk (steered_segments.py), Moves (keys.py).
Numbers: at the head of each file.
"""
