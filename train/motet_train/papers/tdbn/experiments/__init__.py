"""The thesis' experiments."""
