"""Figures that are steered: whether they go where they are told, and stay whole."""
