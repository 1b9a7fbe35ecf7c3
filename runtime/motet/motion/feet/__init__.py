"""Feet: which stand (`contacts`), holding and locking them, and the root path that follows from them."""
