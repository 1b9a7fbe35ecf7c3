"""The error of training data."""

from motet.errors import MotetError


class DataError(MotetError, ValueError):
    """Training data that no model can be trained on."""
