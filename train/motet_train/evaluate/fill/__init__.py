"""How well gaps of motions are filled."""
