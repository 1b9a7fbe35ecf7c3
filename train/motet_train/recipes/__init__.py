"""What is trained, and how: one recipe for each model family."""
