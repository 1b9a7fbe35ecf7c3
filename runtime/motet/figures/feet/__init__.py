"""Feet: which stand (`contacts`), how they are held (`hold`), and the root path that they imply (`treadmill`)."""
