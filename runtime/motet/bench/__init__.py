"""How fast models run here: complete calls, as a user makes them, beside torch and beside what the machine can do."""
