"""Motions and sentences as unit vectors of one space, and what is near in it.

    motion or sentence -> its encoder -> unit vector -> scores against an index -> the nearest (nearest.py)

Main names: SearchModel, Index and Hit (model.py), nearest (nearest.py).
Numbers: IndexSettings (model.py) and NearestSettings (nearest.py), in the manifest.
"""
