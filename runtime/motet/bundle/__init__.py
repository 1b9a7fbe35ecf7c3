"""Bundles on disk: graphs, and a manifest with everything needed to run them."""
