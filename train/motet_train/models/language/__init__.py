"""Nets between motion and language."""
