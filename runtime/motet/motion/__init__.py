"""Geometry: motions, skeletons, rotations, and what is done to them without a model."""
