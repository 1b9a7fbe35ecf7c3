"""Training of motet models in torch."""
