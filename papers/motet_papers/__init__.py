"""Bundles of the papers' own systems. motet finds them by the entry point ``motet.bundles``."""
