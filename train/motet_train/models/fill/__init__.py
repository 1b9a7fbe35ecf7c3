"""Models that fill gaps of motions."""
