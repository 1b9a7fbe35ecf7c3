"""How well motions are predicted."""
