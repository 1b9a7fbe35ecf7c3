"""Published systems, a package for each paper: nets, data, recipe, experiments. What ships imports nothing of them."""
