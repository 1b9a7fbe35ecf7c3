"""Feet: which stand (`contacts`), where they are held or locked, and the path that they lay for the root."""
