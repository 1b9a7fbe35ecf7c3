"""Feet: which stand, where they are held and locked, and the path that they lay for the root."""
