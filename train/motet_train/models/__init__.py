"""The models: one file for each, with its configuration and its graphs."""
