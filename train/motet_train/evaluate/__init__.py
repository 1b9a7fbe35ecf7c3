"""How good trained models are, in numbers and pictures."""
