"""The commands ``motet train`` and ``motet evaluate``, one module for each kind of model."""
