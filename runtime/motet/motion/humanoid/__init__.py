"""Any human figure to the humanoid and back: which joint is which bone, how it stands at rest, and its rotations."""
