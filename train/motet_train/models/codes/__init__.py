"""Motion as words: a codec of motions, and the model that writes its codes."""
